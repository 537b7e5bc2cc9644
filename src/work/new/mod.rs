//! A study from files of a test bench: what is found in them, what an engineer corrects, and the folder that is written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::data::inspect::{BackboneColumn, Cyclic, FoundFile, FoundItem, inspect};
use crate::data::modal_fit::{self, FrfSet, ModalFit};
use crate::data::{Dataset, Estimate, Record, Role};

use super::Failure;

mod correction;
mod scaffold;

pub use correction::{ColumnCorrection, Correction};
pub use scaffold::Scaffold;

/// What files hold.
pub struct Looked {
    /// Files that can be read.
    pub found: Vec<FoundFile>,
    /// Their paths.
    pub files: Vec<PathBuf>,
    /// Why the others cannot.
    pub left: Vec<Failure>,
    /// The two files of the study; none where no test was found.
    pub scaffold: Option<Scaffold>,
}

/// Names of the files in the folder of the study.
///
/// # Errors
/// Two files of one name.
pub fn names(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let mut names: Vec<String> = Vec::new();
    for file in files {
        let name = named(file);
        if names.contains(&name) {
            let message = format!("two files are named `{name}`");
            return Err(Failure::new("data", file.display().to_string(), message, "files of different names"));
        }
        names.push(name);
    }
    Ok(names)
}

/// Name of a file without its folder.
pub fn named(file: &Path) -> String {
    file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Reads every file, corrects what was found as the engineer says, and writes down the study it makes. Nothing is written to the disk. `rate` [Hz] is that of
/// files without a column of time.
///
/// # Errors
/// Where no file can be read, and corrections of what is not there.
pub fn look(files: &[PathBuf], rate: Option<f64>, corrections: &[Correction]) -> Result<Looked, Failure> {
    let mut looked = Looked { found: vec![], files: vec![], left: vec![], scaffold: None };
    for file in files {
        match inspect(file, rate) {
            Ok(one) => {
                looked.found.push(one);
                looked.files.push(file.clone());
            }
            Err(e) => looked.left.push(Failure::from(e)),
        }
    }
    if looked.found.is_empty()
        && let Some(first) = looked.left.drain(..).next()
    {
        return Err(first);
    }
    for correction in corrections {
        correction.apply(&mut looked.found)?;
    }
    looked.scaffold = scaffold::write(&looked.found);
    Ok(looked)
}

/// What is still wrong with the dataset that was written down, its files in `folder`.
pub fn trouble(scaffold: &Scaffold, folder: &Path) -> Option<Failure> {
    let cannot = |e: io::Error| Failure::new("data", "dataset.toml", e.to_string(), "a folder for temporary files that can be written to");
    let temporary = match tempfile::tempdir() {
        Ok(temporary) => temporary,
        Err(e) => return Some(cannot(e)),
    };
    let file = temporary.path().join("dataset.toml");
    if let Err(e) = fs::write(&file, &scaffold.dataset) {
        return Some(cannot(e));
    }
    let f = Failure::from(Dataset::load(&file, Some(folder)).err()?);
    let place = [temporary.path(), folder].iter().fold(f.place().to_string(), |p, inside| p.replace(&format!("{}/", inside.display()), ""));
    Some(Failure::new("data", place, f.message(), f.accepted()))
}

/// Whether a study may be written there.
///
/// # Errors
/// Where something is there already.
pub fn free(dir: &Path) -> Result<(), Failure> {
    let taken = match fs::read_dir(dir) {
        Ok(mut entries) => entries.next().is_some(),
        Err(e) => e.kind() != io::ErrorKind::NotFound,
    };
    if taken {
        return Err(Failure::new(
            "study",
            dir.display().to_string(),
            "something is there already, and nothing is written over",
            "a new folder, or an empty one",
        ));
    }
    Ok(())
}

/// Writes everything beside the target and moves it there in one step: whole, or not at all. Reads the new dataset once for what is still wrong with it.
pub fn create(dir: &Path, files: &[PathBuf], scaffold: &Scaffold) -> Result<(Option<Failure>, Option<Modes>), Failure> {
    let fail = |e: io::Error| {
        Failure::new("study", dir.display().to_string(), format!("the study cannot be written: {e}"), "a folder that can be written to")
    };
    let parent = dir.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(fail)?;
    let temporary = tempfile::Builder::new().prefix(".misfit-new-").tempdir_in(parent).map_err(fail)?;
    let data = temporary.path().join("data");
    fs::create_dir(&data).map_err(fail)?;
    for file in files {
        if let Some(name) = file.file_name() {
            fs::copy(file, data.join(name)).map_err(fail)?;
        }
    }
    fs::write(data.join("dataset.toml"), &scaffold.dataset).map_err(fail)?;
    fs::write(temporary.path().join("study.toml"), &scaffold.study).map_err(fail)?;
    let (problem, modes) = match Dataset::load(&data, None) {
        Ok(dataset) => (None, modes(&dataset)),
        Err(e) => {
            let f = Failure::from(e);
            let place = f.place().replace(&temporary.path().display().to_string(), &dir.display().to_string());
            (Some(Failure::new("data", place, f.message(), f.accepted())), None)
        }
    };
    if dir.is_dir() {
        // Empty, as `free` has seen; if it is not any more, this fails and nothing is lost.
        fs::remove_dir(dir).map_err(fail)?;
    }
    fs::rename(temporary.path(), dir).map_err(fail)?;
    // What the guard would delete has moved.
    let _ = temporary.keep();
    Ok((problem, modes))
}

/// Values of FRFs up to which modes are looked for.
const VALUES: usize = 200_000;

/// Modal parameters of the FRFs, or why there are none.
pub type Modes = Result<ModalFit, String>;

/// Modal parameters of the FRFs, where they make one set; none where there are no FRFs.
fn modes(dataset: &Dataset) -> Option<Modes> {
    let frfs: Vec<_> = dataset.tests.iter().filter_map(|t| if let Record::Frf(f) = &t.record { Some(f.as_ref()) } else { None }).collect();
    if frfs.is_empty() {
        return None;
    }
    let found = |set: FrfSet| {
        // A look, not a study: large sets would take minutes.
        let values = set.h.len() * set.frequency.len();
        if values > VALUES {
            return Err(format!("the FRFs have {values} values, and more than {VALUES} would take minutes"));
        }
        match modal_fit::fit(&set, &modal_fit::Settings::default()) {
            Ok(fit) if fit.modes.is_empty() => Err("no pole of the FRFs stays over the orders of the fit".into()),
            Ok(fit) => Ok(fit),
            Err(e) => Err(e.to_string()),
        }
    };
    Some(FrfSet::from_frfs(&frfs).map_err(|e| e.to_string()).and_then(found))
}

/// Modal parameters as JSON.
pub fn modes_json(fit: &ModalFit) -> Value {
    let mode = |m: &modal_fit::Mode| {
        json!({ "frequency_hz": m.frequency, "frequency_std": m.frequency_sigma, "damping": m.damping, "damping_std": m.damping_sigma, "complexity": m.complexity,
                "shape": m.shape.iter().map(|s| [s.re, s.im]).collect::<Vec<_>>() })
    };
    Value::from(fit.modes.iter().map(mode).collect::<Vec<_>>())
}

/// What was found, as JSON; `path` is what its file is called.
pub fn item(path: &str, item: &FoundItem) -> Value {
    match item {
        FoundItem::History(h) => {
            let channel = |c: &crate::data::inspect::FoundColumn| {
                let (low, high) = c.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
                json!({ "column": c.column, "role": c.role.map(|r| r.word()), "guessed": c.guessed && c.role.is_some(), "unit": c.unit, "min": low, "max": high })
            };
            let cyclic = h.cyclic.as_ref();
            json!({ "file": path, "what": if cyclic.is_some() { "cycle" } else { "transient" }, "channels": h.columns.iter().map(channel).collect::<Vec<_>>(),
                    "samples": h.samples, "rate_hz": h.rate, "seconds": h.seconds, "frequency_hz": cyclic.map(|c| c.frequency), "cycles": cyclic.map(|c| c.cycles),
                    "start_up_cycles": cyclic.map(|c| c.start_up), "control": cyclic.map(|c| c.control.role().word()),
                    "control_recognised": cyclic.map(|c| c.recognised), "loop": cyclic.and_then(measured), "units_given": h.has_units(),
                    "findings": h.findings.iter().map(|n| format!("{}: {}", n.about, n.text)).collect::<Vec<_>>() })
        }
        FoundItem::Frf(f) => {
            let place = |p: Option<(i64, &str, bool)>| p.map(|(n, axis, against)| format!("{n}:{}{axis}", if against { "-" } else { "+" }));
            json!({ "file": path, "what": "frf", "record": f.record, "respond": place(f.respond), "excite": place(f.excite), "quantity": f.quantity.map(|q| q.word()),
                    "channels": f.columns.iter().map(|(r, c, u)| json!({ "column": c, "role": r.word(), "unit": u })).collect::<Vec<_>>(),
                    "lines": f.lines, "from_hz": f.band.0, "to_hz": f.band.1, "findings": f.findings })
        }
        FoundItem::Modes(m) => {
            let mode = |(f, z): &(f64, Option<f64>)| json!({ "frequency_hz": f, "damping": z });
            json!({ "file": path, "what": "modal", "modes": m.modes.iter().map(mode).collect::<Vec<_>>() })
        }
        FoundItem::Backbone(b) => {
            let channel = |c: &BackboneColumn| json!({ "column": c.column, "role": c.role.word(), "guessed": c.guess.is_some(), "unit": c.unit, "min": c.range.0, "max": c.range.1 });
            json!({ "file": path, "what": "backbone", "channels": b.columns.iter().map(channel).collect::<Vec<_>>(), "rows": b.rows })
        }
        FoundItem::Other(text) => json!({ "file": path, "what": "other", "text": text }),
    }
}

/// The settled loop in SI: amplitudes, energies with their deviations.
fn measured(c: &Cyclic) -> Option<Value> {
    let e = c.settled.energy(None)?;
    let pair = |e: Estimate| json!({ "value": e.value, "std": e.sigma });
    let noise = |role: Role| c.settled.channels.iter().find(|c| c.role == role).map(|c| c.sigma_sample);
    Some(
        json!({ "cycles_averaged": c.settled.cycles, "points": c.settled.n, "displacement_amplitude": 0.5 * e.travel.value, "force_amplitude": 0.5 * e.force_range.value,
                 "displacement_noise": noise(Role::Displacement), "force_noise": noise(Role::Force), "W_D": pair(e.dissipated),
                 "W_s_slope": e.stored_slope.map(pair), "W_s_product": pair(e.stored_product), "D": pair(e.loss_ratio) }),
    )
}

#[cfg(test)]
mod tests;
