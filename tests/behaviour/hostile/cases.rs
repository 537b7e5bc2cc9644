//! A study with tolerance cases in a file of their own, distributions of parts, bands and a synthesis.

use super::super::tolerance;
use super::studies::Seed;

const MORE: &str = r#"
[[tolerance.parts]]
name = "t"
distribution = "normal"
cost = 1.0
[[tolerance.parts]]
name = "i_min"
distribution = "uniform"
[[tolerance.correlations]]
between = ["t", "i_min"]
coefficient = 0.3
[[tolerance.bands]]
quantity = "W_D"
max = "2 mJ"
[tolerance.synthesis]
case = "3"
yield = "90 %"
"#;

pub fn seed() -> Seed {
    let folder = tolerance::folder(&[0.1, 0.2, 0.3], &[0.15, 0.2, 0.25]);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let mut table = read("data/cases.toml");
    for t in ["0.1 mm", "0.2 mm", "0.4 mm"] {
        table = table.replacen("conditions = { i_min", &format!("conditions = {{ t = \"{t}\", i_min"), 1);
    }
    let files = (0..3).map(|k| format!("loop-{k}.csv")).map(|name| (name.clone(), read(&format!("data/{name}")).into_bytes()));
    let files = files.chain([("cases.toml".into(), table.into_bytes())]).collect();
    Seed { name: "cases", study: read("study.toml") + MORE, dataset: read("data/dataset.toml"), files }
}
