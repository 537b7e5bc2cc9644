//! study.toml from the engineer's side: what is read, what is refused and where, what is written.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use crate::data::Dataset;
use crate::data::toml_strict::TomlFile;
use crate::explain::Explain;

use super::{Study, StudyError};

mod bench;
mod formula;
mod exchanged;
mod every_field;
mod every_key;
mod instruments;
mod known;
mod levels;
mod odds;
mod property;
mod read;
mod refuse;
mod searched;
mod secants;
mod slack;
mod space;
mod tensioner;
mod weighed;
mod write;

/// The contract's first example.
pub const ONE: &str = r#"schema = 1
dataset = "data"
split = { select = ["loop-2Hz"], held_out = ["loop-5Hz"] }
[[body]]
name = "ground"
fixed = true
[[body]]
name = "end"                 # massless, driven
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "20 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.1 N s/mm", min = "0 N s/mm" }
"#;

/// The contract's chain.
pub const CHAIN: &str = r#"schema = 1
dataset = "data"
[[body]]
name = "m"
count = 8                    # m1..m8
mass = "0.1 kg"
free = ["x"]
[[connector]]
name = "base"
from = "ground"
to = "m1"
[[connector]]
name = "c"
chain = "m"                  # c1..c7, each m_j to m_j+1
[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = "150 N/mm"
[[effect]]
effect = "linear_stiffness"
at = "c1-7.x"                # one shared value
k = { start = "100 N/mm", min = "0 N/mm" }
"#;

fn cycle(hz: f64, conditions: &str) -> String {
    format!(
        "[[test]]\nid = \"loop-{hz}Hz\"\nkind = \"cycle\"\nfile = \"loop-{hz}.csv\"\ncontrol = \"displacement\"\n\
         conditions = {{ frequency = \"{hz} Hz\"{conditions} }}\nchannels = [\n {{ role=\"time\", column=\"t\", unit=\"s\" }},\n \
         {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" }},\n {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.5 N\" }}]\n"
    )
}

const FRF: &str = "[[test]]\nid = \"frf-a\"\nkind = \"frf\"\nfile = \"frf.csv\"\nexcite = \"m1.x\"\nrespond = \"m8.x\"\nquantity = \"accelerance\"\n\
    conditions = { load = \"80 N\" }\nchannels = [\n { role=\"frequency\", column=\"f\", unit=\"Hz\" },\n { role=\"real\", column=\"re\", unit=\"m/s2/N\" },\n \
    { role=\"imag\", column=\"im\", unit=\"m/s2/N\" },\n { role=\"coherence\", column=\"coh\", averages=20 }]\n";

/// A study in a temporary folder, with its data.
pub struct Folder {
    dir: tempfile::TempDir,
}

impl Folder {
    pub fn new(study: &str, dataset: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let data = dir.path().join("data");
        std::fs::create_dir(&data).unwrap();
        std::fs::write(dir.path().join("study.toml"), study).unwrap();
        std::fs::write(data.join("dataset.toml"), format!("schema = 1\n{dataset}")).unwrap();
        for hz in [1.0, 2.0, 5.0] {
            let row = |i: usize| {
                let t = i as f64 * 0.01 / hz;
                format!("{t:.6},{:.8},{:.8}\n", 0.4 * (TAU * hz * t).sin(), 8.0 * (TAU * hz * t + 0.3).sin())
            };
            let csv = "t,x,F\n".to_string() + &(0..400).map(row).collect::<String>();
            std::fs::write(data.join(format!("loop-{hz}.csv")), csv).unwrap();
        }
        let frf = "f,re,im,coh\n".to_string()
            + &(10..60).map(|f| format!("{f},{},{},0.99\n", -0.1 * f as f64, 0.02 * f as f64)).collect::<String>();
        std::fs::write(data.join("frf.csv"), frf).unwrap();
        Folder { dir }
    }

    /// The contract's first example with loops at 1, 2 and 5 Hz at the interference 0.1, 0.3, 0.5 mm.
    pub fn one(study: &str) -> Self {
        let tests = [(1.0, "0.1"), (2.0, "0.3"), (5.0, "0.5")].map(|(hz, i)| cycle(hz, &format!(", i = \"{i} mm\"")));
        Folder::new(study, &tests.concat())
    }

    /// The contract's chain with an FRF and a loop across c1.
    pub fn chain(study: &str) -> Self {
        Folder::new(study, &format!("{FRF}{}", cycle(1.0, "")))
    }

    pub fn path(&self) -> &Path {
        self.dir.path()
    }

    pub fn file(&self) -> PathBuf {
        self.path().join("study.toml")
    }

    pub fn text(&self) -> String {
        std::fs::read_to_string(self.file()).unwrap()
    }

    pub fn load(&self) -> Result<Study, StudyError> {
        Study::load(self.path(), None)
    }

    pub fn dataset(&self) -> Dataset {
        Dataset::load(&self.path().join("data"), None).unwrap()
    }
}

/// Reads `text` with a dataset already at hand.
pub fn read(text: &str, dataset: &Dataset) -> Result<Study, StudyError> {
    let toml = TomlFile::parse(Path::new("study.toml"), text.to_string(), "study")?;
    Study::from_toml(&toml, dataset.clone())
}

/// What two studies have in common when one is the other written and read again.
pub fn essence(study: &Study) -> String {
    let instances: Vec<_> = study
        .system
        .instances
        .iter()
        .map(|i| {
            let params: Vec<_> = i.params.iter().map(|p| (p.value, p.min, p.max, p.free, p.prior)).collect();
            format!("{} {} {:?} {params:?} {:?} {:?}\n", i.name(), i.at, i.site, i.target, i.only)
        })
        .collect();
    let orders: Vec<_> = study.orders.iter().map(|o| (&o.below, &o.above, o.gap)).collect();
    let predictions: Vec<_> = study.predictions.iter().map(|p| format!("{} {:?} {:?}", p.case, p.quantity, p.reference)).collect();
    format!(
        "{} {:?} {:?} {:?} {:?} {:?} {:?} {instances:#?} {orders:?} {predictions:?}",
        study.title, study.system.model, study.graph, study.split, study.fit, study.search, study.assumptions
    )
}

/// Loads, expects an error with `message` at `place` of the file.
#[track_caller]
pub fn refused(result: Result<Study, StudyError>, message: &str, place: &str) {
    let e = match result {
        Ok(_) => panic!("accepted, where `{message}` was expected"),
        Err(e) => e,
    };
    assert!(e.to_string().contains(message), "expected `{message}`, got `{e}`");
    assert!(e.place().ends_with(place), "{message}: expected the place `{place}`, got `{}`", e.place());
    assert!(!e.accepted().is_empty(), "{message}: nothing is said to be accepted");
}
