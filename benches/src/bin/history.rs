//! A long history: from CSV to the settled loop with its scatter, against polars alone reading the same file, in turn.
//!
//! `history [ROWS]` writes a file of so many rows (10 million) of t, x, F in a temporary folder and prints the best of three rounds, their ratio, and the peak memory.

use std::error::Error;
use std::fmt::Write;
use std::io::Write as _;
use std::time::Instant;

use misfit::data::{Dataset, Record};
use polars::prelude::*;

const TOML: &str = r#"schema = 1
[[test]]
id = "long"
kind = "cycle"
file = "long.csv"
control = "displacement"
channels = [{ role = "time", column = "t", unit = "s" }, { role = "displacement", at = "c1.x", column = "x", unit = "mm" },
            { role = "force", at = "c1.x", column = "F", unit = "N" }]
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let rows: usize = std::env::args().nth(1).map_or(Ok(10_000_000), |n| n.parse())?;
    let folder = std::env::temp_dir().join(format!("misfit-history-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let run = || -> Result<(), Box<dyn Error>> {
        let path = folder.join("long.csv");
        write(&path, rows)?;
        std::fs::write(folder.join("dataset.toml"), TOML)?;
        println!(
            "{rows} rows, {:.0} MB, {} processors",
            std::fs::metadata(&path)?.len() as f64 / 1e6,
            std::thread::available_parallelism()?
        );
        let (mut alone, mut ours) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..3 {
            let clock = Instant::now();
            let frame = CsvReadOptions::default().with_has_header(true).try_into_reader_with_file_path(Some(path.clone()))?.finish()?;
            alone = alone.min(clock.elapsed().as_secs_f64());
            assert_eq!(frame.height(), rows);
            drop(frame);
            let clock = Instant::now();
            let dataset = Dataset::load(&folder, None)?;
            let Record::Cycle(record) = &dataset.tests[0].record else { return Err("no cycle".into()) };
            let settled = record.settled()?;
            ours = ours.min(clock.elapsed().as_secs_f64());
            println!(
                "{:.6} Hz, {} cycles of {} points, sigma of the force {:.4} N",
                settled.frequency, settled.cycles, settled.n, settled.channels[1].sigma_sample
            );
        }
        println!("polars alone {alone:.3} s, settled loop with sigma {ours:.3} s: {:.2}x", ours / alone);
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        status.lines().filter(|l| l.starts_with("VmHWM")).for_each(|l| println!("{l}"));
        Ok(())
    };
    let outcome = run();
    std::fs::remove_dir_all(&folder)?;
    outcome
}

fn write(path: &std::path::Path, rows: usize) -> Result<(), Box<dyn Error>> {
    let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
    out.write_all(b"t,x,F\n")?;
    let (mut line, mut state) = (String::new(), 1u64);
    for i in 0..rows {
        let t = i as f64 / 1024.0;
        let p = std::f64::consts::TAU * 1.0037 * t;
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let noise = (state >> 40) as f64 / f64::from(1u32 << 24) - 0.5;
        line.clear();
        writeln!(line, "{t:.6},{:.6},{:.5}", 2.0 * p.sin(), 40.0 * p.sin() + 8.0 * p.cos() + noise)?;
        out.write_all(line.as_bytes())?;
    }
    Ok(out.flush()?)
}
