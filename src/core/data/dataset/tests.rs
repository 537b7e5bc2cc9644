use super::*;
use crate::explain::Explain;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// A dataset in a temporary folder.
pub(crate) struct Folder {
    dir: tempfile::TempDir,
}

impl Folder {
    pub fn new(toml: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("dataset.toml"), toml).unwrap();
        Self { dir }
    }

    pub fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.dir.path().join(name), text).unwrap();
        self
    }

    pub fn load(&self) -> Result<Dataset, DataError> {
        Dataset::load(self.dir.path(), None)
    }
}

/// Loads, expects an error with `message` in dataset.toml at `line`.
pub(crate) fn error(toml: &str, files: &[(&str, &str)], message: &str, line: usize) {
    let folder = files.iter().fold(Folder::new(toml), |f, (name, text)| f.with(name, text));
    let e = folder.load().expect_err(message);
    assert!(e.to_string().contains(message), "expected `{message}`, got `{e}`");
    assert!(e.place().contains(&format!("dataset.toml, line {line}")), "{message}: {}", e.place());
    assert!(!e.accepted().is_empty());
}

/// The example of the contract.
const EXAMPLE: &str = r#"schema = 1
[[test]]
id = "loop-1Hz"
kind = "cycle"
file = "loop.csv"            # t,x,F
control = "displacement"     # or "force"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
discard_cycles = 2
channels = [
 { role="time", column="t", unit="s" },
 { role="displacement", at="c1.x", column="x", unit="mm" },
 { role="force", at="c1.x", column="F", unit="N", sigma="0.5 N" }]   # sigma optional: from the cycles' scatter

[[test]]
id = "frf-a"
kind = "frf"
file = "frf.csv"             # f,re,im,coh
excite = "m1.x"
respond = "m8.x"
quantity = "accelerance"     # or mobility, receptance
excitation = "0.1 N"         # peak; omitted = small signal
conditions = { load = "80 N" }
channels = [
 { role="frequency", column="f", unit="Hz" },
 { role="real", column="re", unit="m/s2/N" },
 { role="imag", column="im", unit="m/s2/N" },
 { role="coherence", column="coh", averages=20 }]
"#;

fn loop_csv() -> String {
    let row = |i: usize| {
        let t = i as f64 * 0.01;
        format!("{t:.4},{:.8},{:.8}\n", 0.4 * (TAU * t).sin(), 8.0 * (TAU * t + 0.3).sin())
    };
    "t,x,F\n".to_string() + &(0..600).map(row).collect::<String>()
}

fn frf_csv() -> String {
    "f,re,im,coh\n".to_string() + &(10..60).map(|f| format!("{f},{},{},0.99\n", -0.1 * f as f64, 0.02 * f as f64)).collect::<String>()
}

fn example() -> Folder {
    Folder::new(EXAMPLE).with("loop.csv", &loop_csv()).with("frf.csv", &frf_csv())
}

#[test]
fn the_contracts_example() {
    let d = example().load().unwrap();
    assert_eq!(d.tests.iter().map(Test::kind).collect::<Vec<_>>(), [TestKind::Cycle, TestKind::Frf]);
    let Record::Cycle(r) = &d.tests[0].record else { panic!() };
    assert_eq!((r.discard_cycles, r.frequency, r.time.len()), (2, Some(1.0), 600));
    assert_eq!(d.tests[0].conditions["i"].value, 0.3e-3);
    let l = r.settled().unwrap();
    assert_eq!((l.cycles, l.n, l.channels[1].sigma_sample), (4, 100, 0.5));
    assert!((l.input.sin[0] - 0.4e-3).abs() < 1e-11);
    let Record::Frf(f) = &d.test("frf-a").unwrap().record else { panic!() };
    assert_eq!((f.excitation, f.excite.as_str(), f.respond.as_str()), (Some(0.1), "m1.x", "m8.x"));
    let h = num_complex::Complex64::new(-1.0, 0.2);
    assert!((f.receptance[0] + h / (TAU * 10.0).powi(2)).norm() < 1e-15);
    assert!((f.sigma[0] - h.norm() * (0.01f64 / (2.0 * 20.0 * 0.99)).sqrt()).abs() < 1e-12);
    assert!((f.receptance_sigma[0] - f.sigma[0] / (TAU * 10.0).powi(2)).abs() < 1e-15);
}

#[test]
fn declarations_that_are_wrong_name_their_line() {
    let (csv, frf) = (loop_csv(), frf_csv());
    let files = [("loop.csv", csv.as_str()), ("frf.csv", frf.as_str())];
    let case = |from: &str, to: &str, message: &str, line: usize| {
        assert!(EXAMPLE.contains(from), "{from}");
        error(&EXAMPLE.replacen(from, to, 1), &files, message, line);
    };
    case("schema = 1", "schema = 2", "schema 2 is not known", 1);
    case("schema = 1", "schema = \"1\"", "found the string \"1\"", 1);
    case("schema = 1", "shema = 1", "unknown key `shema`, nearest is `schema`", 1);
    case("schema = 1", "", "required key `schema` is missing", 1);
    case("id = \"frf-a\"", "id = \"loop-1Hz\"", "test `loop-1Hz` stands twice, first in line 3", 15);
    case("id = \"loop-1Hz\"", "id = \"\"", "an empty string", 3);
    case("id = \"loop-1Hz\"", "id = \"a b\"", "not a name", 3);
    case("id = \"loop-1Hz\"\n", "", "required key `id` is missing", 2);
    case("kind = \"cycle\"", "kind = \"cicle\"", "unknown kind `cicle`, nearest is `cycle`", 4);
    case("kind = \"cycle\"", "kind = 3", "found the integer 3", 4);
    case("kind = \"cycle\"\n", "", "required key `kind` is missing", 2);
    case("file = \"loop.csv\"  ", "fil = \"loop.csv\"  ", "unknown key `fil`, nearest is `file`", 5);
    case("control = \"displacement\"", "control = \"displacment\"", "nearest is `displacement`", 6);
    case("control = \"displacement\"     # or \"force\"\n", "", "required key `control` is missing", 2);
    case("\"1 Hz\"", "\"1 mm\"", "is a length (m), where a frequency is expected", 7);
    case("\"1 Hz\"", "1", "has no unit", 7);
    case("\"1 Hz\"", "\"-1 Hz\"", "a frequency of -1 Hz", 7);
    case("\"1 Hz\"", "\"nan Hz\"", "not a finite number", 7);
    case("\"0.3 mm\"", "\"0.3 nm^x\"", "power", 7);
    case("\"0.3 mm\"", "[1]", "found a list of 1", 7);
    case("conditions = { frequency", "conditions = { \"a b\" = 1, frequency", "not a name for a condition", 7);
    case("conditions = {", "condition = {", "unknown key `condition`, nearest is `conditions`", 7);
    case("discard_cycles = 2", "discard_cycles = -2", "-2 is out of range", 8);
    case("discard_cycles = 2", "discard_cycles = 2.0", "found the number 2", 8);
    case("role=\"time\"", "role=\"tme\"", "unknown role `tme`, nearest is `time`", 10);
    case("role=\"time\", ", "", "required key `role` is missing", 10);
    case("role=\"time\"", "role=\"coherence\"", "unknown role `coherence`", 10);
    case("column=\"t\", ", "", "required key `column` is missing", 10);
    case("unit=\"s\"", "unit=\"mm\"", "is a length (m), where a time is expected", 10);
    case(", unit=\"s\"", "", "required key `unit` is missing", 10);
    case(", unit=\"s\"", ", unt=\"s\"", "unknown key `unt`, nearest is `unit`", 10);
    case("at=\"c1.x\", column=\"x\"", "column=\"x\"", "required key `at` is missing", 11);
    case("at=\"c1.x\", column=\"x\"", "at=\"c1\", column=\"x\"", "`c1` is not a place", 11);
    case("at=\"c1.x\", column=\"x\"", "at=\"c 1.x\", column=\"x\"", "is not a place", 11);
    case("unit=\"mm\"", "unit=\"N\"", "is a force (N), where a length is expected", 11);
    case("unit=\"mm\"", "unit=\"deg\"", "where a length is expected", 11);
    case("unit=\"mm\"", "unit=\"mmm\"", "unknown unit `mmm`", 11);
    case("role=\"displacement\"", "role=\"force\"", "where a force is expected", 11);
    case("role=\"force\"", "role=\"force\", input = true", "is marked as input, and control is displacement", 2);
    case("sigma=\"0.5 N\"", "sigma=\"0.5 mm\"", "is a length", 12);
    case("sigma=\"0.5 N\"", "sigma=\"0 N\"", "not above 0", 12);
    case("sigma=\"0.5 N\"", "sigma=0.5", "has no unit", 12);
    case(" { role=\"time\", column=\"t\", unit=\"s\" },\n", "", "no channel role = \"time\"", 2);
    case(",\n { role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.5 N\" }", "", "no channel that answers", 2);
    case(
        " { role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" },\n",
        " { role=\"time\", column=\"x\", unit=\"s\" },\n",
        "channel `time` stands twice",
        11,
    );
    case("excite = \"m1.x\"\n", "", "required key `excite` is missing", 14);
    case("respond = \"m8.x\"", "respond = \"m8\"", "`m8` is not a place", 19);
    case("quantity = \"accelerance\"", "quantity = \"inertance\"", "unknown quantity `inertance`", 20);
    // The quantity and the unit are held against each other.
    case("quantity = \"accelerance\"", "quantity = \"receptance\"", "is an accelerance (m/s2/N), where a receptance is expected", 25);
    case("unit=\"m/s2/N\"", "unit=\"m/N\"", "is a receptance (m/N), where an accelerance is expected", 25);
    case("excitation = \"0.1 N\"", "excitation = \"0.1 mm\"", "is a length", 21);
    case("excitation = \"0.1 N\"", "excitation = \"0 N\"", "an excitation of 0 N", 21);
    case("load = \"80 N\"", "load = \"80 mm\"", "is a length", 22);
    case("averages=20", "averages=0", "0 is out of range", 27);
    case(", averages=20", "", "required key `averages` is missing", 27);
    case(" { role=\"imag\", column=\"im\", unit=\"m/s2/N\" },\n", "", "no channel role = \"real\" and one with role = \"imag\"", 14);
    case(" { role=\"frequency\", column=\"f\", unit=\"Hz\" },\n", "", "no channel role = \"frequency\"", 14);
    error("schema = 1\n", &[], "required key `test` is missing", 1);
    error("schema = 1\ntest = []\n", &[], "no test", 1);
    error("schema = 1\ntest = 3\n", &[], "found the integer 3, where a list", 2);
}

#[test]
fn files_that_are_wrong_name_their_line() {
    let case = |name: &str, text: String, message: &str, place: &str| {
        let e = example().with(name, &text).load().unwrap_err();
        assert!(e.to_string().contains(message), "expected `{message}`, got `{e}`");
        assert!(e.place().contains(place), "{message}: {}", e.place());
    };
    let line = |text: String, n: usize, new: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines[n - 1] = new;
        lines.join("\n") + "\n"
    };
    case(
        "loop.csv",
        line(loop_csv(), 7, "0.0400,1,1"),
        "time is repeated: 0.04 s after 0.04 s",
        "loop.csv, line 7, test loop-1Hz, channel time",
    );
    case("loop.csv", line(loop_csv(), 7, "0.0300,1,1"), "time goes back: 0.03 s after 0.04 s", "loop.csv, line 7");
    case("loop.csv", line(loop_csv(), 7, "0.0500,1,nan"), "not a finite number", "loop.csv, line 7, column `F`");
    let kilo = EXAMPLE.replacen("unit=\"N\", sigma=\"0.5 N\"", "unit=\"kN\"", 1);
    let text = line(loop_csv(), 7, "0.0500,1,1e308");
    let e = Folder::new(&kilo).with("loop.csv", &text).with("frf.csv", &frf_csv()).load().unwrap_err();
    assert!(e.to_string().contains("beyond any number") && e.place().contains("loop.csv, line 7"), "{e}");
    case("loop.csv", line(loop_csv(), 7, "0.0500,1"), "2 cells", "loop.csv, line 7");
    case(
        "loop.csv",
        loop_csv().lines().take(350).collect::<Vec<_>>().join("\n"),
        "1 complete cycles after 2 discarded",
        "loop.csv, test loop-1Hz",
    );
    case("loop.csv", loop_csv().lines().take(150).collect::<Vec<_>>().join("\n"), "complete cycles", "loop.csv");
    case("loop.csv", loop_csv().lines().take(4).collect::<Vec<_>>().join("\n"), "3 samples are too few", "loop.csv");
    case("loop.csv", loop_csv().replace("t,x,F", "time,x,F"), "no column `t`", "loop.csv");
    case("loop.csv", String::new(), "the file is empty", "loop.csv");
    case(
        "frf.csv",
        line(frf_csv(), 4, "11,1,1,0.9"),
        "the frequency is repeated: 11 Hz after 11 Hz",
        "frf.csv, line 4, test frf-a, channel frequency",
    );
    case("frf.csv", line(frf_csv(), 4, "1,1,1,0.9"), "the frequency goes back: 1 Hz after 11 Hz", "frf.csv, line 4");
    case(
        "frf.csv",
        line(frf_csv(), 51, "1e300,1,1,0.9"),
        "1e300 Hz is beyond any number",
        "frf.csv, line 51, test frf-a, channel frequency",
    );
    case("frf.csv", line(frf_csv(), 2, "-1,1,1,0.9"), "a frequency of -1 Hz has no receptance", "frf.csv, line 2");
    // The line at 0 Hz is left out, and what follows keeps its place.
    let zero = example().with("frf.csv", &line(frf_csv(), 2, "0,1,1,0.9")).load().unwrap();
    let Record::Frf(f) = &zero.tests[1].record else { panic!() };
    assert!(f.frequency[0] == 11.0 && f.notes.iter().any(|n| n.text.contains("0 Hz")), "{:?}", f.notes);
    case("frf.csv", line(line(frf_csv(), 2, "0,1,1,0.9"), 5, "12,1,1,0.9"), "the frequency is repeated", "frf.csv, line 5");
    case("frf.csv", line(frf_csv(), 4, "12,1,1,1.01"), "a coherence of 1.01", "frf.csv, line 4, test frf-a, channel coherence");
    case("frf.csv", line(frf_csv(), 4, "12,1,1,0"), "a coherence of 0", "frf.csv, line 4");
    let toml = EXAMPLE.replacen("\"1 Hz\"", "\"1.1 Hz\"", 1);
    let e = Folder::new(&toml).with("loop.csv", &loop_csv()).with("frf.csv", &frf_csv()).load().unwrap_err();
    assert!(e.to_string().contains("1.1 Hz is declared") && e.place().contains("channel displacement at c1.x"), "{e}");
}

#[test]
fn folders() {
    let missing = Folder::new(EXAMPLE).load().unwrap_err();
    assert!(missing.to_string().contains("loop.csv") && missing.place().contains("test loop-1Hz"), "{missing}");
    let data = Folder::new("").with("loop.csv", &loop_csv()).with("frf.csv", &frf_csv());
    let bare = Folder::new(EXAMPLE);
    let d = Dataset::load(bare.dir.path(), Some(data.dir.path())).unwrap();
    assert_eq!(d.folder, data.dir.path());
    let e = Dataset::load(bare.dir.path(), Some(bare.dir.path())).unwrap_err();
    assert!(e.to_string().contains("given on the command line") && e.accepted().contains("--data"), "{e}");
    let folder = format!("folder = {:?}\n{EXAMPLE}", data.dir.path());
    assert_eq!(Folder::new(&folder).load().unwrap().tests.len(), 2);
    let e = Dataset::load(&bare.dir.path().join("nowhere"), None).unwrap_err();
    assert!(e.to_string().contains("cannot be read"), "{e}");
}

#[test]
fn frf_noise_and_polar_form() {
    let polar = EXAMPLE
        .replace("{ role=\"real\", column=\"re\", unit=\"m/s2/N\" }", "{ role=\"amplitude\", column=\"re\", unit=\"g/N\", sigma=\"1 %\" }")
        .replace("{ role=\"imag\", column=\"im\", unit=\"m/s2/N\" }", "{ role=\"phase\", column=\"im\", unit=\"deg\" }");
    let csv = "f,re,im,coh\n".to_string() + &(10..60).map(|f| format!("{f},2,90,0.9\n")).collect::<String>();
    let d = Folder::new(&polar).with("loop.csv", &loop_csv()).with("frf.csv", &csv).load().unwrap();
    let Record::Frf(f) = &d.tests[1].record else { panic!() };
    assert!((f.measured[0] - num_complex::Complex64::new(0.0, 2.0 * 9.80665)).norm() < 1e-12);
    assert!((f.sigma[0] - 0.02 * 9.80665).abs() < 1e-12);
    let bare = EXAMPLE.replace(",\n { role=\"coherence\", column=\"coh\", averages=20 }", "");
    let load = |toml: &str| {
        let d = Folder::new(toml).with("loop.csv", &loop_csv()).with("frf.csv", &frf_csv()).load().unwrap();
        let Record::Frf(f) = d.tests[1].record.clone() else { panic!() };
        f
    };
    assert!(load(&bare).notes.iter().any(|n| n.text.contains("neighbouring lines")));
    let noisy = load(&bare.replace("quantity =", "noise = \"2 %\"\nquantity ="));
    assert!((noisy.sigma[3] - 0.02 * noisy.measured[3].norm()).abs() < 1e-15 && noisy.notes.is_empty());
}

#[test]
fn transient_and_several_channels() {
    let transient = EXAMPLE.replacen("kind = \"cycle\"", "kind = \"transient\"", 1).replacen("discard_cycles = 2\n", "", 1).replacen(
        "control = \"displacement\"     # or \"force\"\n",
        "",
        1,
    );
    let files = [("loop.csv", loop_csv()), ("frf.csv", frf_csv())];
    let load = |toml: &str| files.iter().fold(Folder::new(toml), |f, (n, t)| f.with(n, t)).load();
    let e = load(&transient).unwrap_err();
    assert!(e.to_string().contains("nothing drives this test"), "{e}");
    let d = load(&transient.replacen("column=\"x\",", "column=\"x\", input=true,", 1)).unwrap();
    let Record::Transient(r) = &d.tests[0].record else { panic!() };
    let motion = r.history().motion("c1.x").unwrap();
    let w = TAU;
    let error = (50..550).map(|i| (motion.velocity[i] - 0.4e-3 * w * (w * r.time[i]).cos()).abs()).fold(0.0, f64::max);
    assert!(error < 1e-3 * 0.4e-3 * w, "{error}");
    assert!(r.history().motion("c2.x").is_err());
    let two = EXAMPLE.replacen(
        " { role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" },",
        " { role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" },\n { role=\"displacement\", at=\"m1.x\", column=\"x\", unit=\"mm\" },",
        1,
    );
    let e = load(&two).unwrap_err();
    assert!(e.to_string().contains("none is marked as the controlled one"), "{e}");
    let d = load(&two.replacen("at=\"m1.x\",", "at=\"m1.x\", input=true,", 1)).unwrap();
    let Record::Cycle(r) = &d.tests[0].record else { panic!() };
    assert_eq!(r.controlled().unwrap().at, "m1.x");
    assert_eq!(r.settled().unwrap().controlled, 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn mutated_datasets_do_not_panic(
        which in 0usize..3,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        gone in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut files = [("dataset.toml", EXAMPLE.to_string()), ("loop.csv", loop_csv()), ("frf.csv", frf_csv())].map(|(n, t)| (n, t.into_bytes()));
        let bytes = &mut files[which].1;
        if let Some(gone) = gone {
            let mut lines: Vec<&[u8]> = bytes.split(|b| *b == b'\n').collect();
            lines.remove(gone.index(lines.len()));
            *bytes = lines.join(&b'\n');
        }
        for (at, byte) in flips {
            let i = at.index(bytes.len());
            bytes[i] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let dir = tempfile::tempdir().unwrap();
        for (name, bytes) in &files {
            std::fs::write(dir.path().join(name), bytes).unwrap();
        }
        if let Err(e) = Dataset::load(dir.path(), None) {
            prop_assert!(!e.to_string().is_empty() && !e.place().is_empty() && !e.accepted().is_empty());
        }
    }
}
