//! Campaigns on a Slurm that runs: `tests/slurm/run` starts one on a bare machine and runs these tests there.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::campaign::{bench, command, records, run, table};
use super::hostile::mutate::Random;

/// The table of a job array is that of the local run, also where the submitter is killed and
/// another goes on with its job.
#[test]
#[ignore = "needs a running Slurm: tests/slurm/run starts one and runs this test"]
fn on_a_running_slurm_the_table_is_the_same_and_a_killed_submitter_is_taken_over() {
    let (dir, file) = bench();
    let (local, array, killed) = (dir.path().join("local"), dir.path().join("array"), dir.path().join("killed"));
    run(&file, &local, &[]);
    let result = run(&file, &array, &["--on", "slurm"]);
    assert_eq!(result["done"], 8, "{result}");
    assert_eq!(table(&array), table(&local));
    let mut child = command(&file, &killed, &["--on", "slurm"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while !killed.join("job").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no job in a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let refused = command(&file, &killed, &["--resume"]).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stdout).contains("still queued or running"), "{}", String::from_utf8_lossy(&refused.stdout));
    let result = run(&file, &killed, &["--on", "slurm", "--resume"]);
    assert_eq!(result["done"], 8, "{result}");
    assert_eq!(table(&killed), table(&local));
    // What a run draws, divided among the elements of two arrays, one after the other.
    std::fs::write(&file, "schema = 1\nverb = \"fit\"\nstudies = [\".\"]\narguments = [\"--bootstrap\", \"6\"]\n").unwrap();
    let (whole, shared) = (dir.path().join("whole"), dir.path().join("shared"));
    run(&file, &whole, &[]);
    std::fs::write(&file, std::fs::read_to_string(&file).unwrap() + "shares = 3\n").unwrap();
    assert_eq!(run(&file, &shared, &["--on", "slurm"])["done"], 1);
    assert_eq!(table(&shared), table(&whole));
}

/// The daemons, as an operator sees to them.
struct Daemons {
    conf: String,
}

impl Daemons {
    fn new() -> Daemons {
        Daemons { conf: std::fs::read_to_string(std::env::var("SLURM_CONF").expect("tests/slurm/run sets SLURM_CONF")).unwrap() }
    }

    fn value(&self, key: &str) -> &str {
        let line = self.conf.lines().find(|l| l.starts_with(key)).unwrap();
        line[key.len() + 1..].split_whitespace().next().unwrap()
    }

    /// Kills a daemon and starts it again a second later.
    fn kill(&self, name: &str, pid_file: &str) {
        let pid = std::fs::read_to_string(self.value(pid_file)).unwrap();
        let _ = Command::new("kill").args(["-9", pid.trim()]).status();
        std::thread::sleep(Duration::from_secs(1));
        assert!(Command::new(name).status().unwrap().success(), "{name} does not start again");
    }

    /// Puts a node that the scheduler has taken out after the kill of a daemon back, lets go what it holds or has put off, and has it ask its nodes what they run: what
    /// ended while it was dead it takes for running until then.
    fn see_to_it(&self) {
        let _ = Command::new("scontrol").arg("reconfigure").stderr(Stdio::null()).status();
        let node = self.value("NodeName");
        let asked = |program: &str, args: &[&str]| {
            let done = Command::new(program).args(args).output().unwrap();
            String::from_utf8_lossy(&done.stdout).into_owned()
        };
        if asked("sinfo", &["--noheader", "--format", "%t"]).contains("dr") {
            asked("scontrol", &["update", &format!("NodeName={node}"), "State=RESUME"]);
        }
        for line in asked("squeue", &["--noheader", "--format", "%A %r"]).lines() {
            let job = line.split_whitespace().next().unwrap_or_default();
            match line {
                _ if line.contains("Held") => drop(asked("scontrol", &["release", job])),
                _ if line.contains("BeginTime") => drop(asked("scontrol", &["update", &format!("JobId={job}"), "StartTime=now"])),
                _ => {}
            }
        }
    }
}

/// Kills one of the processes of the tasks in a folder; nothing where none is at work.
fn kill_a_task(out: &Path) {
    let mark = out.join("work-").display().to_string();
    for process in std::fs::read_dir("/proc").unwrap().flatten() {
        let line = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
        if String::from_utf8_lossy(&line).contains(&mark) {
            let _ = Command::new("kill").args(["-9", &process.file_name().to_string_lossy()]).stderr(Stdio::null()).status();
            return;
        }
    }
}

/// Waits for a campaign, with an operator who looks after the scheduler; whether it ended by itself.
fn ended(child: &mut Child, daemons: &Daemons) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(300) {
        if child.try_wait().unwrap().is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_secs(1));
        // A job must have run for ten seconds before a node that does not know it is believed.
        if begun.elapsed().as_secs() % 12 == 11 {
            daemons.see_to_it();
        }
    }
    let _ = child.kill();
    let _ = child.wait();
    false
}

/// `MISFIT_SLURM_KILLS=50 tests/slurm/run` kills submitter, task, slurmd and slurmctld in turn, so many times in all, at random moments; three kills otherwise, since a
/// slurmctld that was killed needs an operator for half a minute.
#[test]
#[ignore = "needs a running Slurm: tests/slurm/run starts one and runs this test"]
fn on_a_running_slurm_kills_lose_nothing_and_double_nothing() {
    let number = |name: &str, or: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(or);
    let (kills, mut random) = (number("MISFIT_SLURM_KILLS", 3), Random(number("MISFIT_HOSTILE_SEED", 20_261_127)));
    let (dir, file) = bench();
    // Sixty tasks, tried again as often as somebody may kill them.
    let text = std::fs::read_to_string(&file).unwrap();
    let seeds: Vec<String> = (1..=30).map(|k| k.to_string()).collect();
    let text = text.replacen("seed = [1, 2, 3, 4]", &format!("seed = [{}]", seeds.join(", ")), 1).replacen("retries = 1", "retries = 3", 1);
    std::fs::write(&file, text.split("[[variant]]").next().unwrap()).unwrap();
    let local = dir.path().join("local");
    assert_eq!(run(&file, &local, &[])["done"], 60);
    let daemons = Daemons::new();
    let begun = Instant::now();
    let path: PathBuf = dir.path().join("timed");
    run(&file, &path, &["--on", "slurm"]);
    let took = begun.elapsed().as_secs_f64();
    for k in 0..kills {
        let out = dir.path().join(format!("out-{k}"));
        let start = |more: &[&str]| command(&file, &out, more).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let mut child = start(&["--on", "slurm"]);
        std::thread::sleep(Duration::from_secs_f64(took * random.below(1 << 20) as f64 / f64::from(1 << 20)));
        let what = ["submitter", "task", "slurmd", "slurmctld"][(k % 4) as usize];
        let at = records(&out);
        match what {
            "submitter" => child.kill().unwrap(),
            "task" => kill_a_task(&out),
            "slurmd" => daemons.kill("slurmd", "SlurmdPidFile"),
            _ => daemons.kill("slurmctld", "SlurmctldPidFile"),
        }
        let whole = ended(&mut child, &daemons) && out.join("table.parquet").exists();
        // Whoever was killed, or gave up, is followed by one who goes on.
        if !whole {
            assert!(ended(&mut start(&["--on", "slurm", "--resume"]), &daemons), "kill {k} of {what}: the resumed campaign does not end");
        }
        let result = run(&file, &out, &["--on", "slurm", "--resume"]);
        assert!(result["done"] == 60 && records(&out) == 60, "kill {k} of {what}: {result}");
        assert_eq!(table(&out), table(&local), "kill {k} of {what}");
        println!(
            "kill {k} of {what} after {at} of 60 tasks: the table of the undisturbed campaign{}",
            if whole { "" } else { ", resumed" }
        );
    }
}
