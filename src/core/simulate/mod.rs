//! The virtual rig: a study's model at its values is the truth, the tests of its dataset are the programme, and what the model answers, with
//! noise, is written as a dataset.

mod curves;
mod error;
mod noise;
mod tables;

use std::fmt::Write;

use serde::Serialize;

use crate::data::{Condition, Dataset, Record, Test};
use crate::diagnose::Case;
use crate::response::{BlockKind, Plan};
use crate::study::Study;
use crate::study::run::{RunError, RunFolder};

pub use error::SimulateError;

use noise::Noise;

/// How the virtual rig measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Standard deviation of the noise [1], 0 or above and below 1: of a channel's range (histories), of each line (FRF), of each value (tables).
    pub noise: f64,
    /// Cycles written of a periodic test, at least 2: their scatter is what a reader takes for the noise.
    pub cycles: u16,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { noise: 0.01, cycles: 6, seed: 1 }
    }
}

impl Settings {
    fn check(&self) -> Result<(), SimulateError> {
        if !(0.0..1.0).contains(&self.noise) {
            let accepted = "a fraction, 0 or above and below 1";
            return Err(SimulateError::Setting { what: "noise", value: self.noise.to_string(), accepted });
        }
        if self.cycles < 2 {
            return Err(SimulateError::Setting { what: "cycles", value: self.cycles.to_string(), accepted: "2 or more" });
        }
        Ok(())
    }
}

/// A test that was written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Simulated {
    /// Id of the test.
    pub id: String,
    /// Kind of the test, as dataset.toml says it.
    pub kind: String,
    /// File of its curve beside dataset.toml; none for a table, which stands in dataset.toml itself.
    pub file: Option<String>,
}

/// A study on the virtual rig, with time steps in which integration does not show.
pub struct Rig {
    study: Study,
    case: Case,
}

impl Rig {
    /// Sets a study up.
    ///
    /// # Errors
    /// [`SimulateError::Case`] for a study whose tests the model cannot be asked for.
    pub fn new(study: &Study, seed: u64) -> Result<Rig, SimulateError> {
        let mut study = study.clone();
        // A fit may compare fewer points of a loop; what is written has all that were measured.
        study.fit.points = None;
        let case = Case::from_study(&study, seed)?;
        let case = case.refined(&case.system).unwrap_or(case);
        Ok(Rig { study, case })
    }

    /// Computes every test, adds noise and writes the files, then `dataset.toml`, without which they are no dataset; reads it back.
    ///
    /// # Errors
    /// [`SimulateError`]: settings out of range, a folder with a dataset, a test the model cannot compute, a file that cannot be written.
    pub fn write(&self, settings: &Settings, folder: &RunFolder) -> Result<Vec<Simulated>, SimulateError> {
        settings.check()?;
        if folder.path.join("dataset.toml").exists() {
            return Err(SimulateError::Occupied { path: folder.path.clone() });
        }
        let made = std::fs::create_dir_all(&folder.path);
        made.map_err(|e| RunError::Write { path: folder.path.clone(), reason: e.to_string() })?;
        let mut toml = self.head(settings);
        let mut tests = Vec::new();
        for (k, (plan, _)) in self.case.plans.iter().enumerate() {
            let Some(test) = self.study.dataset.test(&plan.id) else { continue };
            let mut noise = Noise::new(settings.seed, k as u64, settings.noise);
            let csv = self.measured(&mut toml, test, plan, settings.cycles.into(), &mut noise)?;
            let file = format!("{}.csv", test.id);
            let file = csv.map(|csv| folder.write(&file, csv.as_bytes()).map(|_| file)).transpose()?;
            tests.push(Simulated { id: test.id.clone(), kind: test.kind().word().into(), file });
        }
        let path = folder.write("dataset.toml", toml.as_bytes())?;
        // What was written is read back: a dataset that the program itself would refuse is an error here, not later.
        Dataset::load(&path, None)?;
        Ok(tests)
    }

    /// The head of dataset.toml; the truth stands in it as assumptions.
    fn head(&self, settings: &Settings) -> String {
        let truth = self.study.system.instances.iter().flat_map(|i| {
            let params = i.effect.info().params.iter().zip(&i.params);
            let place = self.study.system.model.places_at(&i.at).ok().and_then(|p| p.first().copied());
            let rotational = place.is_some_and(|p| self.study.system.model.places[p].axis.rotational());
            params.map(move |(p, v)| {
                let (unit, factor) = if v.unit.0.is_empty() { p.dim.practical(rotational) } else { v.unit.clone() };
                format!("{} at {}: {} = {:e} {unit}", i.name(), i.at, p.name, v.value / factor)
            })
        });
        let assumptions: Vec<String> = truth.map(|t| quoted(&t)).collect();
        format!(
            "schema = 1\ntitle = {}\nsource = {}\nassumptions = [{}]\n",
            quoted(&format!("simulated from {}", self.study.title)),
            quoted(&format!("misfit simulate, noise {} %, seed {}", 100.0 * settings.noise, settings.seed)),
            assumptions.join(", ")
        )
    }

    /// One test: its lines in dataset.toml, and the file of its curve; a table has none.
    fn measured(
        &self,
        toml: &mut String,
        test: &Test,
        plan: &Plan,
        cycles: usize,
        noise: &mut Noise,
    ) -> Result<Option<String>, SimulateError> {
        let mut computed = plan.evaluate(&self.case.system, &[], false)?.values;
        // Tables are computed as logarithms.
        for block in plan.blocks.iter().filter(|b| b.kind == BlockKind::Table) {
            computed[block.range.clone()].iter_mut().for_each(|v| *v = v.exp());
        }
        let blocks: Vec<&[f64]> = plan.blocks.iter().map(|b| &computed[b.range.clone()]).collect();
        let _ = write!(toml, "\n[[test]]\nid = {}\nkind = {}\n", quoted(&test.id), quoted(test.kind().word()));
        conditions(toml, test);
        Ok(match &test.record {
            Record::Cycle(r) => Some(curves::cycle(toml, r, &blocks, cycles, noise)?),
            Record::Transient(r) => Some(curves::transient(toml, r, &blocks, noise)),
            Record::Frf(f) => Some(curves::frf(toml, f, blocks.first().copied().unwrap_or(&[]), noise)),
            Record::Energy(e) => {
                tables::energy(toml, e, plan, &computed, noise);
                None
            }
            Record::Backbone(b) => {
                tables::backbone(toml, b, plan, &computed, noise);
                None
            }
            Record::Modal(m) => {
                tables::modal(toml, m, plan, &computed, noise);
                None
            }
        })
    }
}

/// A string as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// The line of the conditions of a test.
fn conditions(toml: &mut String, test: &Test) {
    if !test.conditions.is_empty() {
        let one = |(k, c): (&String, &Condition)| format!("{} = \"{}\"", quoted(k), c.quantity());
        let all: Vec<String> = test.conditions.iter().map(one).collect();
        let _ = writeln!(toml, "conditions = {{ {} }}", all.join(", "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::Explain;

    fn rig() -> Rig {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../studies/04-interference");
        Rig::new(&Study::load(&path, None).unwrap(), 1).unwrap()
    }

    /// What is measured depends on the seed alone, and is not written over.
    #[test]
    fn a_seed_gives_a_dataset_once() {
        let rig = rig();
        let write = |seed| {
            let folder = tempfile::tempdir().unwrap();
            let folder = (RunFolder::at(folder.path().join("rig")), folder);
            let tests = rig.write(&Settings { seed, ..Settings::default() }, &folder.0).unwrap();
            assert_eq!(tests.len(), rig.study.dataset.tests.len());
            let again = rig.write(&Settings::default(), &folder.0).unwrap_err();
            assert!(matches!(&again, SimulateError::Occupied { path } if *path == folder.0.path), "{again}");
            std::fs::read(folder.0.path.join(tests[0].file.as_ref().unwrap())).unwrap()
        };
        let first = write(1);
        assert!(first == write(1) && first != write(2));
    }

    #[test]
    fn noise_and_cycles_out_of_range_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(folder.path().join("rig"));
        for (settings, place) in [
            (Settings { noise: 1.0, ..Settings::default() }, "noise"),
            (Settings { noise: f64::NAN, ..Settings::default() }, "noise"),
            (Settings { cycles: 1, ..Settings::default() }, "cycles"),
        ] {
            let error = rig().write(&settings, &folder).unwrap_err();
            assert_eq!((error.stage(), error.place().as_str()), ("simulate", place));
            assert!(!folder.path.exists(), "nothing is written");
        }
    }
}
