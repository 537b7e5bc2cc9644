use super::*;
use std::f64::consts::TAU;

fn write(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    (dir, path)
}

#[test]
fn roles_by_unit_and_name() {
    for (name, unit, role) in [
        ("time [s]", Some("s"), Some(Role::Time)),
        ("Kanal 3", Some("kip"), Some(Role::Force)),
        ("Weg", Some("mm"), Some(Role::Displacement)),
        ("acc_z", Some("g"), Some(Role::Acceleration)),
        ("t", None, Some(Role::Time)),
        ("Load cell", None, Some(Role::Force)),
        ("disp2", None, Some(Role::Displacement)),
        ("H re", Some("m/s2/N"), Some(Role::Real)),
        ("Frequency", Some("Hz"), Some(Role::Frequency)),
        ("coh", None, Some(Role::Coherence)),
        ("phase", Some("deg"), Some(Role::Phase)),
        ("twist", Some("deg"), Some(Role::Displacement)),
        ("Strain gauge", Some("V"), None),
        ("operator", None, None),
    ] {
        assert_eq!(guess_role(name, unit), role, "{name} {unit:?}");
    }
    let guessed = |name: &str, unit: Option<&str>| guess::by_letter(name, unit);
    assert!(guessed("F", None) && guessed("x2", None) && guessed("run.t", None));
    assert!(!guessed("F [N]", Some("N")) && !guessed("force", None) && !guessed("run.force", None));
}

#[test]
fn a_cyclic_history() {
    let rows = (0..2600).map(|i| {
        let t = f64::from(i) / 256.0;
        // Full size in the middle of the second cycle.
        let up = (t / 1.9).min(1.0);
        let p = TAU * 0.8 * t;
        format!("{t:.6};{:.6};{:.6}\n", up * 2.0 * p.sin(), up * (30.0 * (p + 0.2).sin() + 3.0 * (3.0 * p).sin()))
    });
    let text = "rig 7\n\nt [s];Weg [mm];Kraft [N]\n".to_string() + &rows.collect::<String>();
    let (_dir, path) = write("a.txt", &text.replace('.', ","));
    let file = inspect(&path, None).unwrap();
    let FoundItem::History(h) = &file.items[0] else { panic!("{file:?}") };
    assert_eq!((h.samples, h.rate.round()), (2600, 256.0));
    let c = h.cyclic.as_ref().unwrap();
    assert!((c.frequency - 0.8).abs() < 1e-4, "{}", c.frequency);
    assert_eq!((c.cycles, c.start_up, c.control), (8, 2, super::super::Control::Displacement));
    let amplitude = c.settled.input.sin[0];
    assert!((amplitude - 2e-3).abs() < 1e-6, "{amplitude}");
}

#[test]
fn run_up_and_run_down_of_a_short_record() {
    // Two cycles up, three full, two down, from a mean that is not zero.
    let rows = (0..7001).map(|i| {
        let t = f64::from(i) / 1000.0;
        let size = (t / 2.0).min((7.0 - t) / 2.0).clamp(0.0, 1.0);
        let p = TAU * t;
        format!("{t},{},{}\n", 0.3 + size * p.sin(), size * (p + 0.3).sin() + 0.2 * (3.0 * p).sin() * size)
    });
    let (_dir, path) = write("a.csv", &("time [s],displacement [in],force [kip]\n".to_string() + &rows.collect::<String>()));
    let FoundItem::History(h) = inspect(&path, None).unwrap().items.remove(0) else { panic!() };
    let c = h.cyclic.as_ref().unwrap();
    assert!((c.frequency - 1.0).abs() < 1e-4, "{}", c.frequency);
    assert_eq!((c.cycles, c.start_up, c.settled.cycles), (7, 2, 3));
    assert!((c.settled.energy(None).unwrap().travel.value / 0.0508 - 1.0).abs() < 1e-3);
}

#[test]
fn an_frf_and_what_is_neither() {
    let rows: String = (1..200).map(|k| format!("{k},0.1,0.2,0.9\n")).collect();
    let (_dir, path) = write("b.csv", &("f [Hz],re [m/s2/N],im [m/s2/N],coh\n".to_string() + &rows));
    let file = inspect(&path, None).unwrap();
    let FoundItem::Frf(f) = &file.items[0] else { panic!("{file:?}") };
    assert_eq!((f.lines, f.band, f.quantity, f.columns.len()), (199, (1.0, 199.0), Some(FrfQuantity::Accelerance), 4));
    let (_dir, path) = write("c.csv", "colour,taste\n1,2\n3,4\n");
    assert!(inspect(&path, None).unwrap_err().to_string().contains("neither a history"));
    let (_dir, path) = write("d.xlsx", "x");
    assert!(matches!(inspect(&path, None), Err(DataError::NoReader { .. })));
}

/// Four cycles of 1 Hz at 100 samples under stamps of this form.
fn stamped(header: &str, stamp: impl Fn(usize) -> String) -> String {
    let row = |i: usize| {
        let p = TAU * i as f64 / 100.0;
        format!("{},{:.6},{:.6}\n", stamp(i), 2.0 * p.sin(), 30.0 * (p + 0.2).sin())
    };
    format!("{header},x [mm],F [N]\n") + &(0..400).map(row).collect::<String>()
}

fn clock(i: usize) -> String {
    format!("19:15:{:02}.{:02}", 10 + i / 100, i % 100)
}

#[test]
fn histories_over_date_and_time() {
    for (header, date) in [("Datum", "14.11.2025 "), ("Date,Time", "2025-11-14,"), ("when", "2025-11-14T")] {
        let (_dir, path) = write("a.csv", &stamped(header, |i| format!("{date}{}", clock(i))));
        let FoundItem::History(h) = inspect(&path, None).unwrap_or_else(|e| panic!("{header}: {e}")).items.remove(0) else { panic!() };
        assert!((h.rate - 100.0).abs() < 1e-6 && h.cyclic.is_some(), "{header}: {h:?}");
    }
}

#[test]
fn a_bad_cell_is_named_with_its_column() {
    use crate::explain::Explain;
    let refused = |text: &str| {
        let (_dir, path) = write("a.csv", text);
        let e = inspect(&path, None).unwrap_err();
        (e.to_string(), e.place(), e.accepted())
    };
    let bad = |i: usize| if i == 300 { "2025-11-14 19:75:00".to_string() } else { format!("2025-11-14 {}", clock(i)) };
    let (said, place, accepted) = refused(&stamped("time", bad));
    assert!(said.contains("`2025-11-14 19:75:00` is not a date and time") && place.ends_with("line 302, column `time`"), "{said} {place}");
    assert!(accepted.contains("2025-11-14 19:15:18.25"), "{accepted}");
    // A column that is not called a time is named beside the others.
    let (said, ..) = refused(&stamped("record", |i| format!("03/04/2025 {}", clock(i))));
    assert!(said.contains("`record` is not read, line 2: `03/04/2025 19:15:10.00`"), "{said}");
    // A channel that is not read is told with the others.
    let text = stamped("time", |i| format!("2025-11-14 {}", clock(i)));
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    let stamp = lines[9].split(',').next().unwrap().to_string();
    lines[9] = format!("{stamp},0.1,x");
    let (_dir, path) = write("a.csv", &lines.join("\n"));
    let FoundItem::History(h) = inspect(&path, None).unwrap().items.remove(0) else { panic!() };
    assert!(h.findings.iter().any(|n| n.about == "F [N]" && n.text.contains("line 10: `x` is not a number")), "{:?}", h.findings);
}

#[test]
fn rounded_stamps_are_taken_as_check_takes_them() {
    let rate = 3004.8;
    for digits in [4, 5] {
        let row = |i: usize| {
            let (t, p) = (i as f64 / rate, TAU * i as f64 / rate);
            format!("{t:.digits$},{:.6},{:.6}\n", 2.0 * p.sin(), 30.0 * (p + 0.2).sin())
        };
        let (_dir, path) = write("a.csv", &("t [s],x [mm],F [N]\n".to_string() + &(0..15_024).map(row).collect::<String>()));
        let FoundItem::History(h) = inspect(&path, None).unwrap().items.remove(0) else { panic!() };
        let said = |what: &str| h.findings.iter().filter(|n| n.text.contains(what)).count();
        assert_eq!((said("taken as sampled uniformly at 3004."), said("not sampled uniformly")), (1, 0), "{digits}: {:?}", h.findings);
    }
}

#[test]
fn a_force_that_settles_under_a_constant_stroke_has_a_start_up() {
    let row = |i: usize| {
        let t = i as f64 / 200.0;
        let p = TAU * t;
        format!("{t:.4},{:.6},{:.6}\n", 2.0 * p.sin(), 40.0 * (1.0 + 0.4 * (-t / 1.2).exp()) * (p + 0.1).sin())
    };
    let (_dir, path) = write("a.csv", &("t [s],x [mm],F [N]\n".to_string() + &(0..2000).map(row).collect::<String>()));
    let FoundItem::History(h) = inspect(&path, None).unwrap().items.remove(0) else { panic!() };
    let start_up = h.cyclic.as_ref().unwrap().start_up;
    assert!((4..=5).contains(&start_up), "{start_up}");
}

#[test]
fn accelerations_at_nodes_have_their_places() {
    use crate::data::dataset::files_tests::function;
    let wave = |shift: f64| (0..300).map(|k| (0.37 * f64::from(k * k) * 0.01 + shift).sin()).collect::<Vec<_>>();
    let channel = |node: i64, kind: i64, unit: &str| function(1, node, (kind, unit), (0, "NONE"), &wave(node as f64), false);
    let text = channel(1, 13, "N") + &channel(1, 12, "m/s2") + &channel(2, 12, "m/s2") + &channel(3, 12, "m/s2");
    let (_dir, path) = write("a.uff", &text);
    let file = inspect(&path, None).unwrap();
    let Some(FoundItem::History(h)) = file.items.iter().find(|i| matches!(i, FoundItem::History(_))) else { panic!("{file:?}") };
    assert!(h.findings.is_empty(), "{:?}", h.findings);
    let places: Vec<_> = h.columns.iter().filter(|c| c.role == Some(Role::Acceleration)).map(|c| c.at.unwrap().0).collect();
    assert_eq!(places, [1, 2, 3]);
}

#[test]
fn a_stated_rate_stands_for_a_column_of_time() {
    let text = "x [mm],F [N]\n".to_string()
        + &(0..400)
            .map(|i| TAU * f64::from(i) / 100.0)
            .map(|p| format!("{:.6},{:.6}\n", 2.0 * p.sin(), 30.0 * (p + 0.2).sin()))
            .collect::<String>();
    let (_dir, path) = write("a.csv", &text);
    let e = inspect(&path, None).unwrap_err();
    assert!(crate::explain::Explain::accepted(&e).contains("--rate"), "{e}");
    let FoundItem::History(h) = inspect(&path, Some(51.2)).unwrap().items.remove(0) else { panic!() };
    assert!((h.rate / 51.2 - 1.0).abs() < 1e-12 && h.columns[0].clock == Some(51.2), "{h:?}");
    assert!((h.cyclic.as_ref().unwrap().frequency - 0.512).abs() < 1e-5);
    // A file with a column of time keeps it, and one of frequency responses has none.
    let (_dir, path) = write("b.csv", &stamped("time", clock));
    let FoundItem::History(h) = inspect(&path, Some(51.2)).unwrap().items.remove(0) else { panic!() };
    assert!((h.rate - 100.0).abs() < 1e-6);
}

#[test]
fn structures_with_a_time_of_their_own_are_a_test_each() {
    let column = |name: &str, role: Role, n: usize| FoundColumn {
        column: name.into(),
        role: Some(role),
        unit: None,
        values: (0..n).map(|k| if role == Role::Time { k as f64 } else { (0.1 * k as f64).sin() }).collect(),
        guessed: false,
        at: None,
        clock: None,
    };
    let columns: Vec<FoundColumn> = [("runs(1)", 300), ("runs(2)", 400)]
        .iter()
        .flat_map(|(run, n)| {
            [("time", Role::Time), ("force", Role::Force), ("disp", Role::Displacement)].map(|(f, r)| column(&format!("{run}.{f}"), r, *n))
        })
        .chain([column("gain", Role::Force, 3)])
        .collect();
    let items = records(Path::new("a.mat"), Table { columns, unread: vec![] }, None).unwrap();
    let samples: Vec<usize> = items.iter().filter_map(|i| if let FoundItem::History(h) = i { Some(h.samples) } else { None }).collect();
    assert_eq!(samples, [300, 400], "{items:?}");
    assert!(matches!(&items[2], FoundItem::Other(what) if what.contains("`gain`")), "{items:?}");
}
