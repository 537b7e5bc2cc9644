//! Campaigns: one table whatever happens on the way.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

/// A folder with a small study `s`, and a campaign of eight fits and one study that is not there.
pub(super) fn bench() -> (tempfile::TempDir, PathBuf) {
    let dir = super::tolerance::folder(&[0.1, 0.2, 0.3], &[0.2, 0.25]);
    let file = dir.path().join("many.toml");
    let text = "schema = 1\nverb = \"fit\"\nstudies = [\".\"]\nretries = 1\n[grid]\n\"c1.x.viscous.c\" = [\"0.1 N s/mm\", \"0.4 N s/mm\"]\nseed = [1, 2, 3, 4]\n\
                [[variant]]\nname = \"lost\"\nstudy = \"gone\"\n";
    std::fs::write(&file, text).unwrap();
    (dir, file)
}

pub(super) fn command(file: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_misfit"));
    command.arg("campaign").arg(file).arg("--json").arg("--out").arg(out).args(more);
    command
}

pub(super) fn run(file: &Path, out: &Path, more: &[&str]) -> Value {
    let run = command(file, out, more).output().unwrap();
    assert!(run.status.success(), "{} {}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

pub(super) fn table(out: &Path) -> Vec<u8> {
    std::fs::read(out.join("table.parquet")).unwrap()
}

pub(super) fn records(out: &Path) -> usize {
    std::fs::read_dir(out.join("tasks")).map_or(0, |d| d.flatten().filter(|e| e.path().extension().is_some_and(|e| e == "json")).count())
}

#[test]
fn a_variant_that_does_not_load_is_named_and_the_rest_goes_on() {
    let (dir, file) = bench();
    let out = dir.path().join("a");
    let result = run(&file, &out, &[]);
    assert_eq!((result["tasks"].as_u64(), result["done"].as_u64(), result["computed"].as_u64()), (Some(9), Some(8), Some(9)), "{result}");
    let failed = result["failed"].as_array().unwrap();
    assert!(failed.len() == 1 && failed[0]["task"] == "lost" && failed[0]["reason"].as_str().unwrap().contains("gone"), "{result}");
    let schema: Value =
        serde_json::from_slice(&Command::new(env!("CARGO_BIN_EXE_misfit")).args(["schema", "campaign", "--json"]).output().unwrap().stdout)
            .unwrap();
    let wrong = super::schema::against(&schema, &schema, &result, "");
    assert!(wrong.is_empty(), "{wrong:#?}");
    let page = std::fs::read_to_string(result["report"].as_str().unwrap()).unwrap();
    assert!(page.contains("8 of 9 tasks") && page.contains("lost") && page.contains("parameters.c1.x.viscous.c.value"), "{page}");
    let first = table(&out);
    // A folder that holds a campaign is not begun anew by mistake; resumed, only the failed task is tried again, and the table stays.
    let again = command(&file, &out, &[]).output().unwrap();
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stdout).contains("--resume"));
    let result = run(&file, &out, &["--resume"]);
    assert_eq!((result["computed"].as_u64(), result["of_other_inputs"].as_u64()), (Some(1), Some(0)), "{result}");
    assert_eq!(table(&out), first);
    // A changed record makes other tasks: nothing old is taken for new.
    let loop_ = dir.path().join("data/loop-0.csv");
    let text = std::fs::read_to_string(&loop_).unwrap();
    std::fs::write(&loop_, text.replacen("0.000000,", "0.000000, ", 1)).unwrap();
    let result = run(&file, &out, &["--resume"]);
    assert_eq!((result["computed"].as_u64(), result["of_other_inputs"].as_u64()), (Some(9), Some(8)), "{result}");
}

#[test]
fn killed_in_the_middle_and_resumed_it_gives_the_same_table() {
    let (dir, file) = bench();
    let (whole, broken) = (dir.path().join("whole"), dir.path().join("broken"));
    run(&file, &whole, &[]);
    let mut child = command(&file, &broken, &["--threads", "1"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while records(&broken) < 3 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = records(&broken);
    assert!((3..9).contains(&kept), "{kept}");
    assert!(!broken.join("table.parquet").exists());
    let result = run(&file, &broken, &["--resume"]);
    let computed = result["computed"].as_u64().unwrap() as usize;
    assert!((9 - kept..9).contains(&computed) && result["done"] == 8, "{kept} kept: {result}");
    assert_eq!(table(&broken), table(&whole));
    let left = std::fs::read_dir(&broken).unwrap().flatten().filter(|e| e.file_name().to_string_lossy().starts_with("work-"));
    assert_eq!(left.count(), 0);
}

fn script(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    std::fs::write(&path, format!("#!/bin/sh\n{text}")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// A stand-in for Slurm in a folder of its own. It runs the elements of an array in the background, one after the other, each with a log of its own.
struct Cluster {
    bin: PathBuf,
}

impl Cluster {
    /// `bad`: arms of a shell `case` over the number of the element `$k`, for nodes that do not do what they are told.
    fn new(folder: &Path, bad: &str) -> Cluster {
        let bin = folder.join("bin");
        std::fs::create_dir(&bin).unwrap();
        let cluster = Cluster { bin };
        cluster.nodes(bad);
        script(&cluster.bin, "squeue", &format!("[ -e {}/ended-$3 ] || echo RUNNING\n", cluster.bin.display()));
        script(&cluster.bin, "scancel", "exit 0\n");
        script(&cluster.bin, "sinfo", "exit 1\n");
        cluster
    }

    /// Jobs from now on run on these nodes.
    fn nodes(&self, bad: &str) {
        let text = format!(
            "for a in \"$@\"; do case \"$a\" in --array=0-*) last=${{a#--array=0-}};; --output=*) log=${{a#--output=}};; esac; script=\"$a\"; done\n\
             echo job >> {home}/jobs; job=$(wc -l < {home}/jobs)\n\
             ( k=0; while [ $k -le $last ]; do export SLURM_ARRAY_TASK_ID=$k\n\
             case $k in {bad} *) sh -c \"$script\";; esac >> \"$(echo \"$log\" | sed \"s/%a/$k/\")\" 2>&1; k=$((k+1)); done; touch {home}/ended-$job \
             ) > /dev/null 2>&1 &\n\
             echo $job\n",
            home = self.bin.display()
        );
        script(&self.bin, "sbatch", &text);
    }

    /// Jobs that were submitted.
    fn jobs(&self) -> usize {
        std::fs::read_to_string(self.bin.join("jobs")).unwrap().lines().count()
    }

    /// The result of a campaign on it.
    fn run(&self, file: &Path, out: &Path, more: &[&str]) -> Value {
        let path = format!("{}:{}", self.bin.display(), std::env::var("PATH").unwrap());
        let run = command(file, out, &[&["--on", "slurm"], more].concat()).env("PATH", path).output().unwrap();
        serde_json::from_slice(&run.stdout).unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&run.stderr)))
    }
}

/// What is handed to `sbatch` runs as an array, the queue is asked, and the table is that of the local run, though the first element was lost once.
#[test]
#[cfg(unix)]
fn through_a_scheduler_the_table_is_the_same_and_a_lost_element_is_queued_again() {
    let (dir, file) = bench();
    let (local, array) = (dir.path().join("local"), dir.path().join("array"));
    run(&file, &local, &[]);
    let cluster = Cluster::new(dir.path(), "0) [ $job -eq 1 ] || sh -c \"$script\";;");
    let result = cluster.run(&file, &array, &[]);
    assert_eq!((&result["done"], cluster.jobs()), (&Value::from(8), 2), "{result}");
    assert_eq!(table(&array), table(&local));
    // A scheduler that refuses is said.
    script(&cluster.bin, "sbatch", "echo 'Batch job submission failed: Invalid partition' >&2; exit 1\n");
    let result = cluster.run(&file, &dir.path().join("refused"), &[]);
    assert_eq!(result["error"]["stage"], "campaign", "{result}");
    assert!(result["error"]["message"].as_str().unwrap().contains("Invalid partition"), "{result}");
}

/// One node has no program, another a full disk: their tasks fail with what was said there, the rest is done, and on sound nodes the campaign goes on.
#[test]
#[cfg(unix)]
fn tasks_of_a_bad_node_fail_with_what_it_said() {
    let (dir, file) = bench();
    let (local, array) = (dir.path().join("local"), dir.path().join("array"));
    run(&file, &local, &[]);
    let cluster =
        Cluster::new(dir.path(), "0) sh -c 'exec /nowhere/misfit campaign';; 1) (trap '' XFSZ; ulimit -f 20; sh -c \"$script\");;");
    let reason = |result: &Value, k: usize| result["failed"][k]["reason"].as_str().unwrap().to_string();
    let result = cluster.run(&file, &array, &[]);
    assert_eq!((&result["done"], result["failed"].as_array().unwrap().len()), (&Value::from(6), 3), "{result}");
    assert!(reason(&result, 0).contains("ended without a result") && reason(&result, 0).contains("/nowhere/misfit"), "{result}");
    assert!(reason(&result, 1).contains("File too large"), "{result}");
    // A task that failed and is then lost as well is queued again as one that never ran, and fails for what was said last.
    let before = cluster.jobs();
    cluster.nodes("*) sh -c 'exec /elsewhere/misfit campaign';;");
    let result = cluster.run(&file, &array, &["--resume"]);
    assert_eq!((result["failed"].as_array().unwrap().len(), cluster.jobs() - before), (3, 2), "{result}");
    assert!((0..3).all(|k| reason(&result, k).contains("/elsewhere/misfit")), "{result}");
    cluster.nodes("");
    assert_eq!(cluster.run(&file, &array, &["--resume"])["done"], 8);
    assert_eq!(table(&array), table(&local));
}

/// What a run draws may be divided among tasks: the table is that of the undivided run, to the byte.
#[test]
fn divided_into_shares_the_table_is_that_of_the_whole_run() {
    let (dir, file) = bench();
    let fit = "verb = \"fit\"\narguments = [\"--bootstrap\", \"7\", \"--profile\", \"all\"]\nstudies = [\".\"]\n[grid]\nseed = [1, 2]\n";
    let trial = "verb = \"trial\"\narguments = [\"--cases\", \"3\", \"--models\", \"sparse\"]\n[grid]\nseed = [5]\n";
    for (name, text) in [("fit", fit), ("trial", trial)] {
        std::fs::write(&file, format!("schema = 1\n{text}")).unwrap();
        let (whole, shared) = (dir.path().join(format!("{name}-whole")), dir.path().join(format!("{name}-shared")));
        let undivided = run(&file, &whole, &[]);
        std::fs::write(&file, format!("schema = 1\nshares = 3\n{text}")).unwrap();
        let result = run(&file, &shared, &[]);
        assert_eq!((&result["tasks"], &result["done"]), (&undivided["tasks"], &undivided["tasks"]), "{result}");
        assert_eq!(table(&shared), table(&whole), "{name}");
        assert!(std::fs::read_dir(shared.join("shares")).unwrap().next().is_none(), "what was put together is not kept twice");
        // Nothing of it is computed again, and no share is taken for a stranger.
        let again = run(&file, &shared, &["--resume"]);
        assert_eq!((again["computed"].as_u64(), again["of_other_inputs"].as_u64()), (Some(0), Some(0)), "{again}");
    }
    // Shares of another number, left by a run that was killed, are no part of a run.
    std::fs::write(&file, format!("schema = 1\nshares = 3\n{fit}")).unwrap();
    let (broken, whole) = (dir.path().join("broken"), dir.path().join("fit-whole"));
    let mut child = command(&file, &broken, &["--threads", "1"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while records(&broken) < 2 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    std::fs::write(&file, format!("schema = 1\nshares = 2\n{fit}")).unwrap();
    run(&file, &broken, &["--resume"]);
    assert_eq!(table(&broken), table(&whole));
    // A share that fails is named in the row of its task.
    let text = "schema = 1\nverb = \"fit\"\nshares = 2\nstudies = [\"gone\"]\narguments = [\"--bootstrap\", \"4\"]\n";
    std::fs::write(&file, text).unwrap();
    let result = run(&file, &dir.path().join("gone-shared"), &[]);
    let reason = result["failed"][0]["reason"].as_str().unwrap();
    assert!(reason.contains("2 of 2 shares failed") && reason.contains("gone"), "{result}");
    // Where nothing is drawn, there is nothing to divide.
    std::fs::write(&file, text.replace("arguments", "# arguments")).unwrap();
    let refused = command(&file, &dir.path().join("nothing"), &[]).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stdout).contains("draws nothing that could be divided"));
}

/// Every candidate of a step of the ladder as a task: the study itself is not touched.
#[test]
fn the_refits_of_a_ladder_are_tasks() {
    let (dir, file) = bench();
    let text =
        "schema = 1\nverb = \"add\"\nstudies = [\".\"]\n[grid]\neffect = [\"coulomb\", \"cubic_stiffness\"]\n\"--at\" = [\"c1.x\"]\n";
    std::fs::write(&file, text).unwrap();
    let study = dir.path().join("study.toml");
    let before = std::fs::read(&study).unwrap();
    let out = dir.path().join("refits");
    let result = run(&file, &out, &[]);
    assert_eq!(result["done"], 2, "{result}");
    assert_eq!(std::fs::read(&study).unwrap(), before);
    let page = std::fs::read_to_string(result["report"].as_str().unwrap()).unwrap();
    assert!(page.contains("coulomb") && page.contains("cubic_stiffness") && page.contains("cost"), "{page}");
}

/// The best candidates of a score map as tasks; a study whose map fails stands for itself, and the rest goes on.
#[test]
fn the_best_of_a_score_map_are_refitted() {
    let (dir, file) = bench();
    let program = |words: &[&str]| {
        let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args(words).output().unwrap();
        serde_json::from_slice::<Value>(&run.stdout).unwrap()
    };
    let (study, folder) = (dir.path().display().to_string(), dir.path().join("map").display().to_string());
    let map = program(&["diagnose", &study, "--scores", "--json", "--out", &folder]);
    let schema = program(&["schema", "scores", "--json"]);
    let wrong = super::schema::against(&schema, &schema, &map, "");
    assert!(wrong.is_empty(), "{wrong:#?}");
    let scores = map["scores"].as_array().unwrap();
    let drops: Vec<f64> = scores.iter().map(|s| s["predicted_drop"].as_f64().unwrap()).collect();
    assert!(drops.len() > 3 && drops.windows(2).all(|w| w[0] >= w[1]), "{drops:?}");
    let text = "schema = 1\nverb = \"add\"\nstudies = [\".\", \"gone\"]\nrefits = 3\n";
    std::fs::write(&file, text).unwrap();
    let out = dir.path().join("refits");
    let result = run(&file, &out, &[]);
    let failed = result["failed"].as_array().unwrap();
    assert_eq!((result["tasks"].as_u64(), result["done"].as_u64(), failed.len()), (Some(4), Some(3), 1), "{result}");
    assert_eq!(failed[0]["task"], "gone", "{result}");
    let page = std::fs::read_to_string(result["report"].as_str().unwrap()).unwrap();
    for s in &scores[..3] {
        assert!(page.contains(s["effect"].as_str().unwrap()), "{s} {page}");
    }
    // The maps are records like the others: nothing is computed twice, and nothing counts as of other inputs.
    let first = table(&out);
    let result = run(&file, &out, &["--resume"]);
    assert_eq!((result["computed"].as_u64(), result["of_other_inputs"].as_u64()), (Some(0), Some(0)), "{result}");
    assert_eq!(table(&out), first);
    for (with, said) in [("verb = \"fit\"", "not of `fit`"), ("verb = \"add\"\n[grid]\neffect = [\"coulomb\"]", "both say")] {
        std::fs::write(&file, format!("schema = 1\nstudies = [\".\"]\nrefits = 3\n{with}\n")).unwrap();
        let run = command(&file, &dir.path().join("x"), &[]).output().unwrap();
        let result: Value = serde_json::from_slice(&run.stdout).unwrap();
        assert!(result["error"]["message"].as_str().unwrap().contains(said), "{result}");
    }
}

#[test]
fn a_campaign_that_cannot_be_is_refused_with_its_line() {
    let (dir, file) = bench();
    let good = std::fs::read_to_string(&file).unwrap();
    for (from, to, said) in [
        ("verb = \"fit\"", "verb = \"fix\"", "fix"),
        ("retries", "retrys", "retrys"),
        ("seed = [1, 2, 3, 4]", "seed = []", "an axis without values"),
        ("seed = [1, 2, 3, 4]", "seed = [1, 1]", "one and the same task"),
        ("study = \"gone\"\n", "", "the same task"),
    ] {
        std::fs::write(&file, good.replacen(from, to, 1)).unwrap();
        let run = command(&file, &dir.path().join("x"), &[]).output().unwrap();
        let result: Value = serde_json::from_slice(&run.stdout).unwrap();
        if said == "the same task" {
            // A variant without study takes the only one there is: that is another task than those of the grid.
            assert_eq!(result["done"], 9, "{result}");
            continue;
        }
        assert_eq!(run.status.code(), Some(1), "{to}: {result}");
        assert!(result["error"]["message"].as_str().unwrap().contains(said), "{to}: {result}");
    }
}
