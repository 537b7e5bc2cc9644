//! Datasets over universal files, MATLAB files and text with units in its header.

use super::super::FrfQuantity;
use super::tests::Folder;
use super::*;
use crate::explain::Explain;
use std::f64::consts::TAU;

fn axis(kind: i64, label: &str, unit: &str) -> String {
    format!("{kind:10}{:5}{:5}{:5} {label:<20} {unit:<20}\n", 0, 0, 0)
}

/// A function in ASCII: FRF (4), coherence (6) or history (1) at node 12 -Z over node 7 +Z.
pub(crate) fn function(kind: i64, node: i64, ordinate: (i64, &str), denominator: (i64, &str), values: &[f64], complex: bool) -> String {
    let (form, per) = if complex { (5, 2) } else { (2, 1) };
    let reference = if kind == 1 { (0, 0) } else { (7, 3) };
    let dofs =
        format!("{kind:5}{:10}{:5}{:10} {:<10}{node:10}{:4} {:<10}{:10}{:4}\n", 0, 1, 0, "NONE", 3, "NONE", reference.0, reference.1);
    let points = values.len() / per;
    let (first, step) = if kind == 1 { (0.0, 0.01) } else { (0.0, 1.0) };
    let shape = format!("{form:10}{points:10}{:10}{first:13.5e}{step:13.5e}{:13.5e}\n", 1, 0.0);
    let abscissa = if kind == 1 { axis(17, "Time", "s") } else { axis(18, "Frequency", "Hz") };
    let rows: String = values.chunks(6).map(|r| r.iter().map(|v| format!("{v:13.5e}")).collect::<String>() + "\n").collect();
    format!(
        "    -1\n    58\nNONE\nNONE\nNONE\nNONE\nNONE\n{dofs}{shape}{abscissa}{}{}{}{rows}    -1\n",
        axis(ordinate.0, "NONE", ordinate.1),
        axis(denominator.0, "NONE", denominator.1),
        axis(0, "NONE", "NONE")
    )
}

fn frf() -> Vec<f64> {
    (0..80).flat_map(|k| [0.01 * f64::from(k * k), 0.001 * f64::from(k)]).collect()
}

fn toml(more: &str, unit: &str, quantity: &str) -> String {
    format!(
        "schema = 1\n[[test]]\nid = \"a\"\nkind = \"frf\"\nfile = \"a.uff\"\nexcite = \"m7.z\"\nrespond = \"m12.z\"\nquantity = \"{quantity}\"\n{more}\
         channels = [{{ role = \"frequency\", column = \"frequency\", unit = \"Hz\" }}, {{ role = \"real\", column = \"real\", unit = \"{unit}\" }},\
         {{ role = \"imag\", column = \"imag\", unit = \"{unit}\" }}, {{ role = \"coherence\", column = \"coherence\", averages = 20 }}]\n"
    )
}

#[test]
fn an_frf_of_a_universal_file() {
    let coherence: Vec<f64> = (0..80).map(|k| 0.9 + 0.001 * f64::from(k)).collect();
    let uff = function(4, 12, (12, "mm/s^2"), (13, "N"), &frf(), true) + &function(6, 12, (0, "NONE"), (0, "NONE"), &coherence, false);
    let load = |text: &str| Folder::new(text).with("a.uff", &uff).load();
    for record in ["", "record = \"12:+Z/7:+Z\"\n", "record = \"#1\"\n"] {
        let d = load(&toml(record, "mm/s2/N", "accelerance")).unwrap_or_else(|e| panic!("{record}: {e} {}", e.accepted()));
        let Record::Frf(f) = &d.tests[0].record else { panic!() };
        assert_eq!((f.frequency.len(), f.frequency[0], f.quantity), (79, 1.0, FrfQuantity::Accelerance));
        // mm/s2 to m/s2; written with five digits.
        assert!((f.measured[9].re - 1e-3).abs() < 1e-8 && (f.coherence.as_ref().unwrap()[0] - 0.901).abs() < 1e-6);
        assert!(f.notes.iter().any(|n| n.text.contains("0 Hz")));
    }
    let e = |text: String| load(&text).unwrap_err();
    assert!(e(toml("", "m/s2/N", "accelerance")).to_string().contains("the file says"), "{}", e(toml("", "m/s2/N", "accelerance")));
    assert!(e(toml("", "mm/N", "receptance")).to_string().contains("the file says"));
    let ignored = load(&toml("header_units = \"ignore\"\n", "m/s2/N", "accelerance")).unwrap();
    let Record::Frf(f) = &ignored.tests[0].record else { panic!() };
    assert!((f.measured[9].re - 1.0).abs() < 1e-5);
    let none = e(toml("record = \"13:+Z/7:+Z\"\n", "mm/s2/N", "accelerance"));
    assert!(
        none.to_string().contains("no function `13:+Z/7:+Z`") && none.accepted().contains("#1 12:+Z/7:+Z"),
        "{none} {}",
        none.accepted()
    );
    let two = uff.clone() + &function(4, 13, (12, "mm/s^2"), (13, "N"), &frf(), true);
    let several = Folder::new(&toml("", "mm/s2/N", "accelerance")).with("a.uff", &two).load().unwrap_err();
    assert!(several.to_string().contains("2 functions"), "{several}");
    // Cut short, but closed: said when it is used.
    let short = uff.replacen(&format!("{:10}{:10}{:10}", 5, 80, 1), &format!("{:10}{:10}{:10}", 5, 90, 1), 1);
    let e = Folder::new(&toml("record = \"#1\"\n", "mm/s2/N", "accelerance")).with("a.uff", &short).load().unwrap_err();
    assert!(e.to_string().contains("90 points are declared"), "{e}");
}

#[test]
fn a_loop_of_a_universal_file() {
    let wave = |phase: f64, size: f64| (0..600).map(|i| size * (TAU * 0.01 * f64::from(i) + phase).sin()).collect::<Vec<f64>>();
    let uff =
        function(1, 1, (8, "mm"), (0, "NONE"), &wave(0.0, 2.0), false) + &function(1, 2, (13, "N"), (0, "NONE"), &wave(0.2, 30.0), false);
    let text = "schema = 1\n[[test]]\nid = \"a\"\nkind = \"cycle\"\nfile = \"a.uff\"\ncontrol = \"displacement\"\nchannels = [\
        { role = \"time\", column = \"time\", unit = \"s\" }, { role = \"displacement\", at = \"c1.x\", column = \"#1\", unit = \"mm\" },\
        { role = \"force\", at = \"c1.x\", column = \"2:+Z\", unit = \"N\" }]\n";
    let d = Folder::new(text).with("a.uff", &uff).load().unwrap_or_else(|e| panic!("{e}"));
    let Record::Cycle(r) = &d.tests[0].record else { panic!() };
    let l = r.settled().unwrap();
    assert!((l.frequency - 1.0).abs() < 1e-6 && (l.input.sin[0] - 2e-3).abs() < 1e-8);
    let w = l.energy(None).unwrap().dissipated.value;
    assert!((w / (std::f64::consts::PI * 2e-3 * 30.0 * 0.2f64.sin()) - 1.0).abs() < 1e-4, "{w}");
    // Channels of unlike length.
    let unlike = function(1, 1, (8, "mm"), (0, "NONE"), &wave(0.0, 2.0), false)
        + &function(1, 2, (13, "N"), (0, "NONE"), &wave(0.2, 30.0)[..500], false);
    let e = Folder::new(text).with("a.uff", &unlike).load().unwrap_err();
    assert!(e.to_string().contains("different abscissae (600 and 500 points)"), "{e}");
}

#[test]
fn units_in_a_header_are_held_against_the_declaration() {
    let rows: String = (0..600)
        .map(|i| {
            format!("{:.2},{:.6},{:.6}\n", 0.01 * f64::from(i), (TAU * 0.01 * f64::from(i)).sin(), (TAU * 0.01 * f64::from(i) + 0.1).sin())
        })
        .collect();
    let csv = "t [s],x [mm],F [kN]\n".to_string() + &rows;
    let text = |force: &str, column: &str, more: &str| {
        format!(
            "schema = 1\n[[test]]\nid = \"a\"\nkind = \"cycle\"\nfile = \"a.csv\"\ncontrol = \"displacement\"\n{more}channels = [\
        {{ role = \"time\", column = \"t\", unit = \"s\" }}, {{ role = \"displacement\", at = \"c1.x\", column = \"x\", unit = \"mm\" }},\
        {{ role = \"force\", at = \"c1.x\", column = \"{column}\", unit = \"{force}\" }}]\n"
        )
    };
    let load = |t: String| Folder::new(&t).with("a.csv", &csv).load();
    assert!(load(text("kN", "F", "")).is_ok() && load(text("kN", "F [kN]", "")).is_ok());
    let e = load(text("N", "F", "")).unwrap_err();
    assert!(e.to_string().contains("the file says `kN`, and `N` is declared"), "{e}");
    assert!(e.accepted().contains("unit = \"kN\""));
    assert!(load(text("N", "F", "header_units = \"ignore\"\n")).is_ok());
}

#[test]
fn an_frf_from_histories() {
    // A mass of 2 kg under random force, sampled: A = 1 / m at every line.
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1u32 << 24) - 0.5
    };
    let rows: String =
        (0..4096).map(|i| (i, random())).map(|(i, f)| format!("{},{},{}\n", f64::from(i) / 512.0, f, f / 2.0 + 0.0)).collect();
    let csv = "t,F,a\n".to_string() + &rows;
    let text = |more: &str| {
        format!(
            "schema = 1\n[[test]]\nid = \"a\"\nkind = \"frf\"\nfile = \"a.csv\"\nexcite = \"m1.x\"\nrespond = \"m1.x\"\nquantity = \"accelerance\"\n\
         {more}channels = [{{ role = \"time\", column = \"t\", unit = \"s\" }}, {{ role = \"force\", at = \"m1.x\", column = \"F\", unit = \"N\" }},\
         {{ role = \"acceleration\", at = \"m1.x\", column = \"a\", unit = \"m/s2\" }}]\n"
        )
    };
    let load = |t: String| Folder::new(&t).with("a.csv", &csv).load();
    let first = |d: Dataset| match &d.tests[0].record {
        Record::Frf(f) => f.as_ref().clone(),
        _ => panic!(),
    };
    let f = first(load(text("estimate = { block = \"0.5 s\" }\n")).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!((f.frequency.len(), f.frequency[0]), (128, 2.0));
    assert!(f.measured.iter().all(|h| (h - 0.5).norm() < 1e-9), "{:?}", f.measured[3]);
    // 0.5 kg of it is the load cell.
    let f = first(load(text("estimate = { block = \"0.5 s\", method = \"Hv\" }\nload_cell_mass = \"500 g\"\n")).unwrap());
    assert!(f.measured.iter().all(|h| (h - 1.0 / 1.5).norm() < 1e-9), "{:?}", f.measured[3]);
    let e = load(text("estimate = { block = \"100 s\" }\n")).unwrap_err();
    assert!(e.to_string().contains("a block of"), "{e}");
    let e = load(text("estimate = { block = \"2 N\" }\n")).unwrap_err();
    assert!(e.place().contains("line"), "{}", e.place());
}
