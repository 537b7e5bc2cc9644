//! Bad input: a clear error each, with its stage, its place and what would be accepted. Never a panic.

use super::rig::{Rig, loop_csv, test_toml};

/// One way to be wrong: file, what stands there, what stands there instead; what the error must say (place, message or accepted).
struct Wrong {
    file: &'static str,
    old: &'static str,
    new: &'static str,
    stage: &'static str,
    says: &'static [&'static str],
}

const fn study(old: &'static str, new: &'static str, says: &'static [&'static str]) -> Wrong {
    Wrong { file: "study.toml", old, new, stage: "study", says }
}

const fn data(old: &'static str, new: &'static str, says: &'static [&'static str]) -> Wrong {
    Wrong { file: "data/dataset.toml", old, new, stage: "data", says }
}

/// Runs `fit` on each and holds the error object against what it must say.
fn refuses(all: &[Wrong]) {
    let mut faults = Vec::new();
    for wrong in all {
        let rig = Rig::new();
        // One test is enough here, and its texts stand once.
        rig.write("data/dataset.toml", &("schema = 1\n".to_string() + &test_toml(1)));
        rig.change(
            "study.toml",
            "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }",
            "split = { select = [], held_out = [] }",
        );
        rig.change(wrong.file, wrong.old, wrong.new);
        let ran = rig.run("fit", &["--json"]);
        let what = format!("`{}` for `{}`", wrong.new, wrong.old);
        if ran.code != 1 || ran.stderr.contains("panicked") {
            faults.push(format!("{what}: exit {} {}", ran.code, ran.stderr));
            continue;
        }
        let [stage, place, message, accepted] = ran.error();
        let whole = format!("{place} | {message} | {accepted}");
        if stage != wrong.stage {
            faults.push(format!("{what}: stage {stage}: {whole}"));
        }
        if place.is_empty() || accepted.is_empty() {
            faults.push(format!("{what}: no place or nothing accepted: {whole}"));
        }
        faults.extend(wrong.says.iter().filter(|s| !whole.contains(**s)).map(|s| format!("{what}: `{s}` not in: {whole}")));
        if !rig.runs().is_empty() {
            faults.push(format!("{what}: a run folder is left"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn study_toml() {
    refuses(&[
        study("schema = 1", "schema = 2", &["schema", "line 1"]),
        study("schema = 1", "schema = \"one\"", &["schema"]),
        study("schema = 1", "shcema = 1", &["shcema", "schema"]),
        study("dataset = \"data\"", "datset = \"data\"", &["datset", "dataset", "line 2"]),
        study("dataset = \"data\"", "dataset = \"dat\"", &["dataset.toml", "line 2"]),
        study("dataset = \"data\"", "dataset = 3", &["dataset", "string"]),
        study("dataset = \"data\"", "", &["dataset"]),
        study("dataset = \"data\"", "dataset = \"data", &["line 2"]),
        study("select = []", "selct = []", &["selct", "select"]),
        study("select = []", "select = [\"loop-3Hz\"]", &["loop-3Hz", "loop-1Hz"]),
        study("select = []", "select = [\"loop-1Hz\"]", &["fit"]),
        study("held_out = []", "held_out = [\"loop-1Hz\"]", &["fit"]),
        study("select = [], held_out = []", "select = [\"loop-1Hz\"], held_out = [\"loop-1Hz\"]", &["loop-1Hz", "select", "held_out"]),
        study("name = \"end\"", "nam = \"end\"", &["nam", "name"]),
        study("name = \"end\"", "name = \"ground\"", &["ground"]),
        study("free = [\"x\"]", "free = [\"w\"]", &["w", "psi"]),
        study("free = [\"x\"]", "free = []", &["free"]),
        study("free = [\"x\"]", "fre = [\"x\"]", &["fre", "free"]),
        study("free = [\"x\"]", "free = [\"x\"]\nmass = \"1 N\"", &["mass", "kg"]),
        study("free = [\"x\"]", "free = [\"x\"]\nmass = \"-1 kg\"", &["mass"]),
        study("free = [\"x\"]", "free = [\"x\"]\ncount = 0", &["count"]),
        study("to = \"end\"", "to = \"ende\"", &["ende", "end"]),
        study("to = \"end\"", "to = \"ground\"", &["ground"]),
        study("to = \"end\"", "", &["to"]),
        study("effect = \"viscous\"", "effect = \"viscuos\"", &["viscuos", "viscous"]),
        study("effect = \"viscous\"", "effect = 1", &["effect"]),
        study("effect = \"viscous\"\nat = \"c1.x\"", "effect = \"viscous\"\nat = \"c7.x\"", &["c7.x", "c1.x"]),
        study("effect = \"viscous\"\nat = \"c1.x\"", "effect = \"viscous\"\nat = \"c1.w\"", &["w"]),
        study("effect = \"viscous\"\nat = \"c1.x\"", "effect = \"viscous\"\nat = \"c1\"", &["c1"]),
        study("effect = \"viscous\"\nat = \"c1.x\"", "effect = \"viscous\"", &["at"]),
        study("c = { start = \"0.3 N s/mm\"", "d = { start = \"0.3 N s/mm\"", &["d", "c"]),
        study("\"0.3 N s/mm\"", "\"0.3 N/mm\"", &["0.3 N/mm", "N s/mm"]),
        study("\"0.3 N s/mm\"", "\"0.3\"", &["unit"]),
        study("\"0.3 N s/mm\"", "\"0,3 N s/mm\"", &["comma"]),
        study("\"0.3 N s/mm\"", "\"nan N s/mm\"", &["nan", "finite"]),
        study("\"0.3 N s/mm\"", "\"inf N s/mm\"", &["inf", "finite"]),
        study("\"0.3 N s/mm\"", "\"\"", &["empty"]),
        study("\"0.3 N s/mm\"", "\"0.3 N s/mmm\"", &["mmm"]),
        study("\"0.3 N s/mm\"", "true", &["boolean"]),
        study("min = \"0 N s/mm\"", "min = \"0.5 N s/mm\"", &["0.3", "0.5"]),
        study("min = \"0 N s/mm\"", "min = \"-1 N s/mm\"", &["negative"]),
        study("min = \"0 N s/mm\"", "max = \"0.1 N s/mm\"", &["0.3", "0.1"]),
        study("min = \"0 N s/mm\"", "mn = \"0 N s/mm\"", &["mn", "min"]),
        study("min = \"0 N s/mm\"", "prior = { mean = \"0.1 N s/mm\", sigma = \"0 N s/mm\" }", &["sigma"]),
        study("[[body]]\nname = \"ground\"", "[[bodies]]\nname = \"ground\"", &["bodies", "body"]),
        study("[[body]]\nname = \"ground\"", "fit = { loss = \"hubr\" }\n[[body]]\nname = \"ground\"", &["hubr", "huber"]),
        study("[[body]]\nname = \"ground\"", "fit = { starts = 0 }\n[[body]]\nname = \"ground\"", &["starts"]),
        study("[[body]]\nname = \"ground\"", "search = { effects = [\"colomb\"] }\n[[body]]\nname = \"ground\"", &["colomb", "coulomb"]),
    ]);
}

#[test]
fn dataset_toml() {
    refuses(&[
        data("schema = 1", "schema = 7", &["schema"]),
        data("[[test]]", "[[tests]]", &["tests", "test"]),
        data("id = \"loop-1Hz\"", "", &["id"]),
        data("id = \"loop-1Hz\"", "id = \"\"", &["id"]),
        data("id = \"loop-1Hz\"", "id = 4", &["id"]),
        data("kind = \"cycle\"", "kind = \"cicle\"", &["cicle", "cycle"]),
        data("kind = \"cycle\"", "", &["kind"]),
        data("file = \"loop1.csv\"", "file = \"loop9.csv\"", &["loop9.csv", "loop-1Hz"]),
        data("file = \"loop1.csv\"", "file = \"dataset.toml\"", &["toml"]),
        data("file = \"loop1.csv\"", "", &["file"]),
        data("control = \"displacement\"", "control = \"displacment\"", &["displacment", "displacement"]),
        data("control = \"displacement\"", "", &["control"]),
        data("frequency = \"1 Hz\"", "frequency = \"1 mm\"", &["1 mm", "Hz"]),
        data("frequency = \"1 Hz\"", "frequency = \"3 Hz\"", &["frequency"]),
        data("frequency = \"1 Hz\"", "frequency = \"-1 Hz\"", &["-1"]),
        data("discard_cycles = 2", "discard_cycles = -1", &["discard_cycles"]),
        data("discard_cycles = 2", "discard_cycles = 7", &["two"]),
        data("discard_cycles = 2", "discard_cycle = 2", &["discard_cycle", "discard_cycles"]),
        data("role=\"time\"", "role=\"tme\"", &["tme", "time"]),
        data("column=\"t\"", "column=\"tt\"", &["tt"]),
        data("column=\"F\", ", "", &["column"]),
        data("unit=\"s\"", "unit=\"mm\"", &["mm"]),
        data("unit=\"N\", sigma", "unit=\"mm\", sigma", &["mm"]),
        data("unit=\"N\", sigma", "unti=\"N\", sigma", &["unti", "unit"]),
        data("sigma=\"0.05 N\"", "sigma=\"0 N\"", &["sigma"]),
        data("sigma=\"0.05 N\"", "sigma=\"-1 N\"", &["sigma"]),
        data("sigma=\"0.05 N\"", "sigma=\"0.05 mm\"", &["0.05 mm"]),
        data("role=\"force\", at=\"c1.x\"", "role=\"force\"", &["at"]),
    ]);
    // A place is the model's to know.
    refuses(&[Wrong {
        file: "data/dataset.toml",
        old: "role=\"force\", at=\"c1.x\"",
        new: "role=\"force\", at=\"c9.x\"",
        stage: "study",
        says: &["c9.x", "c1.x", "loop-1Hz"],
    }]);
}

/// The measurement file itself, changed by `change`.
fn csv(change: impl Fn(String) -> String, says: &[&str]) {
    let rig = Rig::new();
    let text = change(loop_csv(1.0, |_, _| 0.0));
    rig.write("data/loop1.csv", &text);
    let [stage, place, message, accepted] = rig.run("fit", &["--json"]).error();
    assert_eq!(stage, "data");
    let whole = format!("{place} | {message} | {accepted}");
    for word in says {
        assert!(whole.contains(word), "`{word}` not in: {whole}");
    }
    assert!(!accepted.is_empty());
}

/// Line `n` of the file (the header is line 1) put through `change`.
fn line(text: &str, n: usize, change: impl Fn(&str) -> String) -> String {
    text.lines().enumerate().map(|(k, l)| if k + 1 == n { change(l) } else { format!("{l}\n") }).collect()
}

#[test]
fn measurement_files() {
    csv(|_| String::new(), &["loop1.csv", "empty"]);
    csv(|t| t.lines().next().unwrap().to_string() + "\n", &["loop1.csv", "no rows"]);
    csv(|t| t.replacen("t,x,F", "t,x,Force", 1), &["loop1.csv", "`F`", "Force"]);
    csv(|t| t.replacen("t,x,F", "t,x,x", 1), &["loop1.csv"]);
    csv(|t| line(&t, 7, |_| "0.05,nan,1\n".into()), &["loop1.csv", "7", "x"]);
    csv(|t| line(&t, 7, |_| "0.05,inf,1\n".into()), &["loop1.csv", "7", "x"]);
    csv(|t| line(&t, 7, |_| "0.05,,1\n".into()), &["loop1.csv", "7", "x"]);
    csv(|t| line(&t, 7, |_| "0.05,abc,1\n".into()), &["loop1.csv", "7", "abc"]);
    csv(|t| line(&t, 7, |l| format!("{l},9\n")), &["loop1.csv", "7"]);
    csv(|t| line(&t, 7, |l| format!("{l}\n{l}\n")), &["loop1.csv", "8", "repeated"]);
    csv(|t| line(&t, 7, |l| format!("0.3{}\n", &l[4..])), &["loop1.csv", "8", "back"]);
    csv(|t| line(&t, 7, |_| "\n".into()), &["loop1.csv", "7", "blank"]);
    csv(|t| t[..t.len() / 2 - 20].rsplit_once(',').unwrap().0.to_string(), &["loop1.csv", "middle"]);
    csv(|t| t.lines().take(130).map(|l| format!("{l}\n")).collect(), &["loop-1Hz", "two"]);
    csv(
        |t| {
            t.lines()
                .enumerate()
                .map(|(k, l)| if k == 0 { format!("{l}\n") } else { format!("{},0.5,1\n", l.split(',').next().unwrap()) })
                .collect()
        },
        &["loop-1Hz"],
    );
    let rig = Rig::new();
    std::fs::write(rig.path("data/loop1.csv"), [0x74, 0x2c, 0xff, 0xfe, 0x0a]).unwrap();
    assert_eq!(rig.run("fit", &["--json"]).error()[0], "data");
}

#[test]
fn doubled_names() {
    let rig = Rig::new();
    rig.write("data/dataset.toml", &(rig.read("data/dataset.toml") + &test_toml(1)));
    let [stage, _, message, _] = rig.run("fit", &["--json"]).error();
    assert!(stage == "data" && message.contains("loop-1Hz") && message.contains("twice"), "{message}");
    let rig = Rig::new();
    rig.write("study.toml", &(rig.read("study.toml") + "[[connector]]\nname = \"c1\"\nfrom = \"ground\"\nto = \"end\"\n"));
    let [_, _, message, _] = rig.run("fit", &["--json"]).error();
    assert!(message.contains("c1"), "{message}");
}

#[test]
fn every_test_held_out() {
    let rig = Rig::new();
    rig.change("study.toml", "select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"]", "held_out = [\"loop-1Hz\", \"loop-2Hz\", \"loop-5Hz\"]");
    let [stage, place, message, _] = rig.run("fit", &["--json"]).error();
    assert!(stage == "study" && place.contains("line 3"), "{stage} {place} {message}");
}

#[test]
fn an_order_that_no_point_satisfies() {
    let rig = Rig::new();
    let more = "[[effect]]\neffect = \"linear_stiffness\"\nat = \"c1.x\"\nk = { start = \"1 N/mm\", min = \"0 N/mm\", max = \"2 N/mm\" }\n\
                [[order]]\norder = [\"c1.x.linear_stiffness.k\", \"c1.x.linear_stiffness#2.k\"]\ngap = \"5 N/mm\"\n";
    rig.write("study.toml", &(rig.read("study.toml") + more));
    let [stage, place, message, accepted] = rig.run("fit", &["--json"]).error();
    assert!(stage == "study" && place.contains("line"), "{place}");
    assert!(message.contains("c1.x.linear_stiffness#2.k") && !accepted.is_empty(), "{message}");
}

#[test]
fn a_mechanism() {
    let rig = Rig::new();
    let more = "[[body]]\nname = \"loose\"\nfree = [\"x\"]\n[[connector]]\nname = \"c2\"\nfrom = \"ground\"\nto = \"loose\"\n";
    rig.write("study.toml", &(rig.read("study.toml") + more));
    let [stage, place, message, _] = rig.run("fit", &["--json"]).error();
    assert!(stage == "study" && message.contains("loose.x"), "{place} {message}");
}

/// A spring that softens, F = k x - k3 x^3, loaded to nine tenths of the force at which it snaps through. From the stiffness that fits best
/// without k3, the k3 that the score asks for has no equilibrium at that force: the refit cannot even start.
#[test]
fn a_candidate_that_cannot_follow_a_test_is_not_taken() {
    use std::fmt::Write;
    let rig = Rig::new();
    let (k, k3) = (20.0, 20.0 / 3.0);
    // Below the snap at 1 mm the force rises with x: bisection.
    let at = |f: f64| {
        let (mut low, mut high) = (-1.0, 1.0);
        for _ in 0..60 {
            let x = 0.5 * (low + high);
            if k * x - k3 * x * x * x < f { low = x } else { high = x }
        }
        0.5 * (low + high)
    };
    let mut csv = String::from("t,F,x\n");
    let mut state = 1u64;
    for j in 0..=800 {
        let t = f64::from(j) / 100.0;
        let force = 12.0 * (std::f64::consts::TAU * t).sin();
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let noise = (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        writeln!(csv, "{t:.6},{force:.9},{:.9}", at(force) + 1e-3 * noise).unwrap();
    }
    rig.write("data/loop1.csv", &csv);
    // The select test pulls so hard that the softening spring snaps through: at the strength that the first test asks for it cannot be computed there.
    let mut hard = String::from("t,F,x\n");
    for j in 0..=800 {
        let t = f64::from(j) / 100.0;
        let force = 40.0 * (std::f64::consts::TAU * t).sin();
        writeln!(hard, "{t:.6},{force:.9},{:.9}", at(12.0) / 12.0 * force).unwrap();
    }
    rig.write("data/loop2.csv", &hard);
    let test = |id: &str, file: &str| {
        format!(
            "[[test]]\nid = \"{id}\"\nkind = \"cycle\"\nfile = \"{file}\"\ncontrol = \"force\"\ndiscard_cycles = 2\n\
             conditions = {{ frequency = \"1 Hz\" }}\nchannels = [\n {{ role=\"time\", column=\"t\", unit=\"s\" }},\n \
             {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\" }},\n \
             {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\", sigma=\"0.001 mm\" }}]\n"
        )
    };
    rig.write("data/dataset.toml", &format!("schema = 1\n{}{}", test("pull", "loop1.csv"), test("hard", "loop2.csv")));
    let split = "split = { select = [\"hard\"] }\nsearch = { max_added = 1 }\n";
    rig.change("study.toml", "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", split);
    let ran = rig.run("ladder", &["--json"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let json = ran.json();
    let weighed = json["rungs"][0]["candidates"].as_array().unwrap();
    assert!(!weighed.is_empty() && weighed.iter().all(|c| c["effect"] != "cubic_stiffness" || c["accepted"] == false), "{weighed:#?}");
    // Every candidate says why it was not taken.
    assert!(weighed.iter().all(|c| !c["remark"].as_str().unwrap().is_empty()), "{weighed:#?}");
    assert!(json["rungs"].as_array().unwrap().len() <= 2 && !json["ended"].as_str().unwrap().is_empty());
}

/// Modes of a model without any mass: there are none, and that is said.
#[test]
fn modes_without_mass() {
    let rig = Rig::new();
    rig.write(
        "data/dataset.toml",
        "schema = 1\n[[test]]\nid = \"modes\"\nkind = \"modal\"\nrows = [{ mode = 1, frequency = \"290 Hz\" }]\n",
    );
    rig.change("study.toml", "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", "");
    let [stage, place, message, accepted] = rig.run("fit", &["--json"]).error();
    let whole = format!("{stage} | {place} | {message} | {accepted}");
    assert!(whole.contains("modes") && whole.contains("has 0 flexible modes"), "{whole}");
}

/// Two parameters meet two energies whatever the model is: that is said, and not that the model agrees.
#[test]
fn as_many_parameters_as_values_prove_nothing() {
    let rig = Rig::new();
    rig.write(
        "data/dataset.toml",
        "schema = 1\n[[test]]\nid = \"loop-1Hz\"\nkind = \"energy\"\nat = \"c1.x\"\ncontrol = \"displacement\"\namplitude = \"1 mm\"\n\
         rows = [{ frequency = \"1 Hz\", W_D = \"1 mJ\", W_s = \"10 mJ\" }]\n",
    );
    rig.change("study.toml", "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", "");
    let told = rig.run("fit", &[]);
    assert!(told.code == 0 && told.stdout.contains("2 are free and 2 values are compared"), "{}{}", told.stdout, told.stderr);
    assert!(told.stdout.contains("as any would") && !told.stdout.contains("agrees to within the noise"), "{}", told.stdout);
}
