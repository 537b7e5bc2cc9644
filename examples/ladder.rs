//! Looks for missing effects: adds what explains the data until nothing earns its place. `cargo run --release --example ladder [STUDY]`.

use misfit::prelude::*;

/// The program.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("studies/08-two-effects".into());
    let (_, text) = run(&path, &|step| eprintln!("{step}"))?;
    println!("{text}");
    Ok(())
}

/// What the ladder finds in the study at `path`, and the same in words; `say` is told what it does.
pub fn run(path: &str, say: &(dyn Fn(&str) + Sync)) -> Result<(LadderResult, String), Box<dyn std::error::Error>> {
    let study = Study::load(path.as_ref(), None)?;
    let case = Case::from_study(&study, 1)?;
    // A time limit ends the search with the best model it has.
    let (found, system) = ladder(&case, &Monitor::default().max_seconds(300.0), say)?;
    let mut text = format!("{:?}: {}\n", found.verdict, found.why);
    for m in &found.missing {
        text += &format!("missing: {} at {}{}\n", m.effect, m.at, if m.proven == Some(true) { ", proven" } else { "" });
    }
    // The model with what was found, at its fitted values, as a study of its own.
    let folder = std::env::temp_dir().join(format!("misfit-ladder-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    text += &format!("written to {}\n", study.save(&system, &folder)?.display());
    Ok((found, text))
}
