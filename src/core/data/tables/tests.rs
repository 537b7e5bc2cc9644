use super::super::dataset::tests::{Folder, error};
use super::super::{Dataset, Record};
use super::*;
use crate::explain::Explain;

const TABLE_3: &str = r#"
schema = 1
[[test]]
id = "table-3"
kind = "energy"
at = "c1.x"
control = "force"
force_min = "21.6 N"
force_max = "138.3 N"
rows = [
  { frequency = "0.01 Hz", W_D = "1.04 mJ",  W_s = "249.07 mJ", D = 0.004 },
  { frequency = "0.33 Hz", W_D = "16.43 mJ", W_s = "248.95 mJ", D = 0.066 },
  { frequency = "1 Hz",    W_D = "38.77 mJ", W_s = "248.57 mJ", D = 0.156 },
  { frequency = "5 Hz",    W_D = "73.77 mJ", W_s = "248.39 mJ", D = 0.297, sigma_W_D = "2 %" },
]
"#;

#[test]
fn table_3_of_the_paper() {
    let d = Folder::new(TABLE_3).load().unwrap();
    let Record::Energy(t) = &d.tests[0].record else { panic!() };
    assert_eq!((t.limits, t.control, t.rows.len()), (Some((21.6, 138.3)), Control::Force, 4));
    let row = &t.rows[1];
    let w = row.dissipated.as_ref().unwrap();
    assert_eq!((row.frequency, w.value, w.sigma), (Some(0.33), 16.43e-3, None));
    assert!((w.rounding - 1e-5 / 12f64.sqrt()).abs() < 1e-18);
    assert!((t.rows[3].dissipated.as_ref().unwrap().sigma.unwrap() - 0.02 * 73.77e-3).abs() < 1e-15);
    assert_eq!(row.stored.as_ref().unwrap().unit.symbol, "mJ");
}

#[test]
fn energy_from_a_file_and_its_errors() {
    let toml = r#"
schema = 1
[[test]]
id = "e"
kind = "energy"
at = "c1.x"
control = "displacement"
amplitude = "0.5 mm"
conditions = { i = "0.3 mm" }
file = "e.csv"
channels = [
  { role = "frequency", column = "f", unit = "Hz" },
  { role = "W_D", column = "wd", unit = "mJ", sigma_column = "s" },
]
"#;
    let folder = Folder::new(toml).with("e.csv", "f,wd,s\n1,2.5,0.1\n2,3.5,0.2\n");
    let d = folder.load().unwrap();
    let Record::Energy(t) = &d.tests[0].record else { panic!() };
    assert_eq!(t.limits, Some((-0.5e-3, 0.5e-3)));
    assert_eq!(t.rows[1].dissipated.as_ref().unwrap().sigma, Some(0.2e-3));
    assert_eq!(t.rows[1].conditions["i"].value, 0.3e-3);
    let bad = |csv: &str| Folder::new(toml).with("e.csv", csv).load().unwrap_err();
    let e = bad("f,wd,s\n1,2.5,0.1\n2,3.5,0\n");
    assert!(e.place().contains("e.csv, line 3") && e.to_string().contains("standard deviation"), "{e} {}", e.place());
    let e = bad("f,wd,s\n1,-2.5,0.1\n");
    assert!(e.place().contains("e.csv, line 2") && e.to_string().contains("-2.5 mJ"), "{e} {}", e.place());
    let e = bad("f,wd\n1,2.5\n");
    assert!(e.to_string().contains("no column `s`"), "{e}");
}

#[test]
fn errors_of_energy_tables() {
    let case = |from: &str, to: &str, message: &str, line: usize| error(&TABLE_3.replace(from, to), &[], message, line);
    case("force_max = \"138.3 N\"", "", "not complete", 3);
    case("138.3 N", "13.8 N", "limits cross", 3);
    case("force_max = \"138.3 N\"", "displacement_max = \"1 mm\"", "not a limit under force control", 9);
    case("138.3 N", "138.3 mm", "a length", 9);
    case("W_D = \"1.04 mJ\"", "W_d = \"1.04 mJ\"", "unknown key `W_d`, nearest is `W_D`", 11);
    case("W_D = \"1.04 mJ\",  W_s = \"249.07 mJ\", D = 0.004", "", "none of W_D", 11);
    case("\"0.33 Hz\"", "\"0 Hz\"", "not above 0", 12);
    case("\"0.33 Hz\"", "\"0.33 s\"", "a time", 12);
    case("sigma_W_D = \"2 %\"", "sigma_W_D = \"0 mJ\"", "not above 0", 14);
    case("rows = [", "rows = []\nrosw = [", "unknown key `rosw`, nearest is `rows`", 11);
    case("control = \"force\"", "control = \"forse\"", "nearest is `force`", 7);
    case("at = \"c1.x\"\n", "", "required key `at` is missing", 3);
}

#[test]
fn modal_tables() {
    let toml = r#"
schema = 1
[[test]]
id = "modal-80N"
kind = "modal"
conditions = { load = "80 N" }
noise = "1 %"
rows = [
  { mode = 1, frequency = "290.5 Hz +- 0.5 Hz", damping = "5.3 %", sigma_damping = "0.2 %", family = "bending" },
  { mode = 2, frequency = "810 Hz" },
]
"#;
    let d: Dataset = Folder::new(toml).load().unwrap();
    let Record::Modal(t) = &d.tests[0].record else { panic!() };
    assert_eq!(t.rows[0].frequency.sigma, Some(0.5));
    assert_eq!(t.rows[0].damping.as_ref().unwrap().value, 0.053);
    assert!((t.rows[0].damping.as_ref().unwrap().sigma.unwrap() - 0.002).abs() < 1e-15);
    assert!((t.rows[1].frequency.sigma.unwrap() - 8.1).abs() < 1e-12);
    assert!((t.rows[1].frequency.rounding - 0.1 / 12f64.sqrt()).abs() < 1e-15, "{}", t.rows[1].frequency.rounding);
    error(&toml.replace("mode = 2", "mode = 1"), &[], "mode 1 stands twice", 10);
    error(&toml.replace("mode = 2", "mode = 1.5"), &[], "1.5 is not the number of a mode", 10);
    error(&toml.replace("mode = 2, ", ""), &[], "no number of the mode", 10);
    error(&toml.replace("810 Hz", "-810 Hz"), &[], "natural frequency of -810 Hz", 10);
    error(&toml.replace("810 Hz", "810"), &[], "has no unit", 10);
    error(&toml.replace("810 Hz", "810 rad/s"), &[], "angular velocity", 10);
}
