//! Fits a study and prints its parameters with their 95 % intervals: `cargo run --release --example fit [STUDY]`.

use misfit::prelude::*;

/// The program.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("studies/04-interference".into());
    println!("{}", run(&path)?);
    Ok(())
}

/// What it prints of the study at `path`.
pub fn run(path: &str) -> Result<String, Box<dyn std::error::Error>> {
    let study = Study::load(path.as_ref(), None)?;
    let case = Case::from_study(&study, 1)?;
    let (_, _, result) = fit(&case, &[SplitName::Fit, SplitName::Select, SplitName::HeldOut], &Monitor::default())?;
    let mut text = format!("{}: {}, cost {:.1}\n", result.study, result.termination, result.cost);
    for p in &result.parameters {
        text += &format!("{} = {}, 95 % {}\n", p.name, p.printed, p.printed_interval);
    }
    // The error of a test is relative to what was measured; the floor is the error that noise alone would leave.
    for t in &result.tests {
        text += &format!("{} ({:?}): error {:.2} %, noise {:.2} %\n", t.id, t.split, 100.0 * t.error, 100.0 * t.floor);
    }
    Ok(text)
}
