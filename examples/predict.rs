//! Calibrates a study and prints what it predicts: `cargo run --release --example predict [STUDY]`. The study asks by `[[prediction]]`.

use misfit::prelude::*;

/// The program.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("studies/06-virtual-tensioner".into());
    println!("{}", run(&path)?);
    Ok(())
}

/// What it prints of the study at `path`.
pub fn run(path: &str) -> Result<String, Box<dyn std::error::Error>> {
    let study = Study::load(path.as_ref(), None)?;
    let case = Case::from_study(&study, 1)?;
    let (_, fitted, _) = fit(&case, &[SplitName::Fit], &Monitor::default())?;
    let mut text = String::new();
    for p in predictions(&study, &fitted)? {
        let deviation = p.std.map_or("not determined by the data".into(), |s| format!("+- {s:.2e}"));
        let against = p.spec.reference.as_ref().map_or(String::new(), |r| format!(", reference {r}"));
        text += &format!(
            "{} {} = {:.4e} {} {deviation}{against}\n",
            p.spec.case,
            p.spec.quantity.word(),
            p.found.value,
            p.spec.dimension().si_unit()
        );
    }
    Ok(text)
}
