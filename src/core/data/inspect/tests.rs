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
    let file = inspect(&path).unwrap();
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
    let FoundItem::History(h) = inspect(&path).unwrap().items.remove(0) else { panic!() };
    let c = h.cyclic.as_ref().unwrap();
    assert!((c.frequency - 1.0).abs() < 1e-4, "{}", c.frequency);
    assert_eq!((c.cycles, c.start_up, c.settled.cycles), (7, 2, 3));
    assert!((c.settled.energy(None).unwrap().travel.value / 0.0508 - 1.0).abs() < 1e-3);
}

#[test]
fn an_frf_and_what_is_neither() {
    let rows: String = (1..200).map(|k| format!("{k},0.1,0.2,0.9\n")).collect();
    let (_dir, path) = write("b.csv", &("f [Hz],re [m/s2/N],im [m/s2/N],coh\n".to_string() + &rows));
    let file = inspect(&path).unwrap();
    let FoundItem::Frf(f) = &file.items[0] else { panic!("{file:?}") };
    assert_eq!((f.lines, f.band, f.quantity, f.columns.len()), (199, (1.0, 199.0), Some(FrfQuantity::Accelerance), 4));
    let (_dir, path) = write("c.csv", "colour,taste\n1,2\n3,4\n");
    assert!(inspect(&path).unwrap_err().to_string().contains("neither a history"));
    let (_dir, path) = write("d.xlsx", "x");
    assert!(matches!(inspect(&path), Err(DataError::NoReader { .. })));
}
