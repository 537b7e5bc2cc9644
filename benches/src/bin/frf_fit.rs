//! Six-parameter FRF fit for benches/peers/fit.py.
//!
//! `frf_fit DIR BODIES LINES SIGMA` writes DIR/system.json (truth and start included) and prints `ready`; for each line of its standard
//! input it reads DIR/measured.bin (little-endian complex f64, line by line, outputs fastest), fits it, and prints one JSON object.

use std::error::Error;
use std::io::Write;
use std::time::Instant;

use misfit::identify::{FitOptions, Monitor, fit};
use misfit_benches::chain::{C64, lines};
use misfit_benches::fit::{FrfFit, START, TRUTH, chain, laws};
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, bodies, count, sigma] = arguments.as_slice() else { return Err("usage: frf_fit DIR BODIES LINES SIGMA".into()) };
    let (chain, omega) = (chain(bodies.parse()?), lines(count.parse()?));
    let mut system = chain.to_json(&omega, &laws(&TRUTH));
    (system["truth"], system["start"]) = (json!(TRUTH), json!(START));
    std::fs::write(format!("{folder}/system.json"), system.to_string())?;
    println!("ready");
    for line in std::io::stdin().lines() {
        line?;
        let numbers: Vec<f64> =
            std::fs::read(format!("{folder}/measured.bin"))?.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
        let measured = numbers.chunks_exact(2).map(|c| C64::new(c[0], c[1])).collect();
        let clock = Instant::now();
        let problem = FrfFit::new(&chain, omega.clone(), measured, sigma.parse()?)?;
        let options = FitOptions::new(["s1", "s2", "s3", "eta1", "eta2", "eta3"]);
        let outcome = fit(&problem, &START, &options, &Monitor::default())?;
        let wall_s = clock.elapsed().as_secs_f64();
        let evaluations = outcome.evaluations.0 + outcome.evaluations.1;
        println!("{}", json!({"p": outcome.p, "cost": outcome.cost, "evaluations": evaluations, "wall_s": wall_s}));
        std::io::stdout().flush()?;
    }
    Ok(())
}
