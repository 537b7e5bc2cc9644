//! Files that are none, systems that are short of something, names that are code.

use std::process::Stdio;

use super::super::rig::{Ran, Rig, misfit, program};

/// Through a shell that sets `limits` first.
fn under(limits: &str, rig: &Rig, arguments: &[&str]) -> Ran {
    let study = rig.folder().display().to_string();
    let output = std::process::Command::new("sh")
        .args(["-c", &format!("{limits}; exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_misfit"), arguments[0], &study])
        .args(&arguments[1..])
        .output()
        .unwrap();
    Ran {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

#[test]
fn pipes_devices_and_folders_are_no_files() {
    let rig = Rig::new();
    std::fs::remove_file(rig.path("data/loop1.csv")).unwrap();
    std::fs::create_dir(rig.path("data/loop1.csv")).unwrap();
    assert!(rig.run("fit", &["--json"]).error().concat().contains("loop1.csv"));
    std::fs::remove_file(rig.path("study.toml")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(rig.path("study.toml")).status().unwrap().success());
    let [_, place, message, _] = rig.run("fit", &["--json"]).error();
    assert!(place.contains("study.toml") && message.contains("no regular file"), "{place}: {message}");
    let [_, place, message, _] = misfit(&["fit", "/dev/zero", "--json"]).error();
    assert!(place.contains("/dev/zero") && message.contains("no regular file"), "{place}: {message}");
    let new = rig.path("new").display().to_string();
    for file in ["/dev/zero", rig.path("study.toml").to_str().unwrap()] {
        assert!(!misfit(&["new", &new, "--json", "--from", file]).error()[1].is_empty());
    }
}

#[test]
fn few_descriptors_and_little_address_space_will_do() {
    let rig = Rig::new();
    for limits in ["ulimit -n 16", "ulimit -v 300000"] {
        let ran = under(limits, &rig, &["fit", "--json", "--threads", "2"]);
        assert_eq!(ran.code, 0, "{limits}: {}", ran.stderr);
    }
}

/// No room for the report: the error names the file, and nothing half written bears its name.
#[test]
fn a_full_disk_is_told() {
    let rig = Rig::new();
    let out = rig.path("out");
    let ran = under("trap '' XFSZ; ulimit -f 20", &rig, &["fit", "--json", "--out", out.to_str().unwrap()]);
    let [_, place, _, accepted] = ran.error();
    assert!(place.contains("out/report.html") && accepted.contains("folder"), "{place} {accepted}");
    assert!(!out.join("report.html").exists() && !out.join("result.json").exists());
}

#[test]
fn runs_of_one_second_have_folders_of_their_own() {
    let rig = Rig::new();
    let start = |_| program().arg("fit").arg(rig.folder()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let children: Vec<_> = (0..3).map(start).collect();
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    assert_eq!(rig.runs().len(), 3);
    assert!(rig.runs().iter().all(|r| r.join("result.json").is_file() && r.join("report.html").is_file()));
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let rig = Rig::new();
    let mut child = program().arg("fit").arg(rig.folder()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

/// What was found and cannot be written is not done; an error that nobody can read is one all the same.
#[test]
#[cfg(target_os = "linux")]
fn a_full_output_is_no_success() {
    let rig = Rig::new();
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for words in [&["fit", "--json"][..], &["compare"]] {
        let output = program().arg(words[0]).arg(rig.folder()).args(&words[1..]).stdout(full()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && said.contains("standard output"), "{:?} {said}", output.status);
    }
    let output = program().args(["fit", "/nowhere"]).stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
}

/// A title that would clear the screen and name the window is told in letters, by a table and by an error.
#[test]
fn a_title_commands_no_terminal() {
    let rig = Rig::new();
    let evil = "\\u001b[2J\\u001b]0;owned\\u0007";
    rig.change("study.toml", "schema = 1\n", &format!("schema = 1\ntitle = \"{evil}\"\n"));
    let told = rig.run("compare", &[]);
    assert!(told.code == 0 && told.stdout.contains("owned") && !told.stdout.contains('\u{1b}'), "{}", told.stdout);
    rig.change("study.toml", "name = \"ground\"", &format!("name = \"{evil}\""));
    let refused = rig.run("compare", &[]);
    assert!(refused.code == 1 && refused.stderr.contains("owned") && !refused.stderr.contains('\u{1b}'), "{}", refused.stderr);
}

/// SIGTERM stops a fit as Ctrl-C does, within an evaluation of the model too.
#[test]
fn terminate_is_interrupt() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    rig.change("study.toml", "[[body]]\nname = \"ground\"", "fit = { starts = 5000 }\n[[body]]\nname = \"ground\"");
    let child = program().arg("fit").arg(rig.folder()).arg("--json").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["termination"], "interrupted");
}

const EVIL: &str = "x\"';`$(touch evil)`</title></script><script>alert(1)</script>&amp;\r\n!END\u{2028}\"\"\"\nimport os\\";

/// Titles, columns, descriptions and sources that are code in HTML, TOML, Python, a shell, Adams.
#[test]
fn names_that_are_code_stay_names() {
    let rig = Rig::new();
    let toml = |text: &str| toml::Value::from(text).to_string();
    let title = toml(EVIL);
    rig.write(
        "study.toml",
        &rig.read("study.toml").replacen("schema = 1\n", &format!("schema = 1\ntitle = {title}\nassumptions = [{title}]\n"), 1),
    );
    let dataset = rig.read("data/dataset.toml");
    let column = "F';$(touch evil)<script>alert(1)</script>";
    let dataset = dataset
        .replacen(
            "schema = 1\n",
            &format!("schema = 1\ntitle = {title}\nsource = {title}\nlicence = {title}\nassumptions = [{title}]\n"),
            1,
        )
        .replace("kind = \"cycle\"\n", &format!("kind = \"cycle\"\ndescription = {title}\n"))
        .replace("column=\"F\"", &format!("column={}", toml(column)));
    rig.write("data/dataset.toml", &dataset);
    for f in [1, 2, 5] {
        let file = format!("data/loop{f}.csv");
        let quoted = format!("t,x,\"{column}\"");
        rig.write(&file, &rig.read(&file).replacen("t,x,F", &quoted, 1));
    }
    let out = rig.path("out");
    let json = rig.json("export", &["--to", "json,csv,parquet,adams,exudyn,study", "--out", out.to_str().unwrap()]);
    assert!(json["files"].as_array().unwrap().len() > 6, "{json}");
    let text = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    for line in text("mechanism.cmd").lines() {
        assert!(!line.trim_start().starts_with("import") && !line.starts_with("!END"), "{line}");
    }
    let python = std::process::Command::new("python3").args(["-m", "py_compile"]).arg(out.join("mechanism.py")).status();
    assert!(python.is_err() || python.unwrap().success());
    assert!(!text("mechanism.py").lines().any(|l| l.starts_with("import os\\") || l.starts_with("import os\"")));
    let fit = rig.json("fit", &["--out", rig.path("run").to_str().unwrap()]);
    assert_eq!(fit["study"].as_str(), Some(EVIL));
    let html = rig.read("run/report.html");
    assert!(!html.contains("<script>alert") && html.contains("&lt;script&gt;alert"));
    // The study that came out is read as it was, from its own folder alone.
    let alone = rig.path("moved");
    std::fs::rename(out.join("study"), &alone).unwrap();
    std::fs::remove_dir_all(rig.path("data")).unwrap();
    let ran = misfit(&["fit", alone.to_str().unwrap(), "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(ran.json()["study"].as_str(), fit["study"].as_str());
    assert!(!rig.path("evil").exists());
}

/// A driving-point FRF with its sign turned is refused by `check`, and what its fit does to a parameter is told by name.
#[test]
fn a_turned_driving_point_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let seed = super::studies::all().into_iter().find(|s| s.name == "chain").unwrap();
    let study = folder.path().join("study");
    seed.write(&study);
    let arguments = ["check", study.to_str().unwrap(), "--json", "--max-seconds", "5"];
    let turned = |json: serde_json::Value| {
        json["problems"].as_array().unwrap().iter().any(|p| p["message"].as_str().unwrap().contains("driving point"))
    };
    assert!(!turned(misfit(&arguments).json()));
    let frf = String::from_utf8(seed.files[0].1.clone()).unwrap();
    let lines = frf.lines().enumerate().map(|(k, line)| match line.split(',').collect::<Vec<_>>()[..] {
        [f, re, im, coh] if k > 0 => format!("{f},{},{},{coh}\n", -re.parse::<f64>().unwrap(), -im.parse::<f64>().unwrap()),
        _ => format!("{line}\n"),
    });
    std::fs::write(study.join("data/frf.csv"), lines.collect::<String>()).unwrap();
    let ran = misfit(&arguments);
    assert_eq!(ran.code, 1);
    assert!(turned(ran.json()), "{}", ran.stdout);
}
