//! Cases of `misfit trial` for benches/peers/sindy.py.
//!
//! `trial_cases DIR SEED CASES` writes one-connector cases with one hidden effect each as studies DIR/0, DIR/1, ..., the truth beside each.

use std::error::Error;
use std::path::Path;

use misfit::trial::{Kind, Options, Structure, write_case};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, seed, cases] = arguments.as_slice() else { return Err("usage: trial_cases DIR SEED CASES".into()) };
    let options = Options { seed: seed.parse()?, kinds: vec![Kind::One], structure: Structure::Connector, ..Options::default() };
    for index in 0..cases.parse()? {
        write_case(&options, index, None, &Path::new(folder).join(index.to_string()))?;
    }
    Ok(())
}
