//! FRF of the chain for benches/peers/frf.py.
//!
//! `frf_chain DIR BODIES LINES` writes DIR/system.json (what a peer needs to build the same system) and DIR/h.bin (H as little-endian
//! complex f64, line by line). Then, for each line of its standard input, it prints the median seconds over 21 repetitions: of a sweep on
//! as many threads as the line says, or, for the line `march`, of an implicit time step (two Newton iterations) of the same chain.

use std::error::Error;
use std::io::Write;
use std::time::Instant;

use misfit::engine::blocktri::{Response, Sweep};
use misfit_benches::chain::{Chain, LAWS, coefficients, lines};
use misfit_benches::march::March;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, bodies, count] = arguments.as_slice() else { return Err("usage: frf_chain DIR BODIES LINES".into()) };
    let (chain, omega) = (Chain::new(bodies.parse()?), lines(count.parse()?));
    let system = chain.system()?;
    let (inputs, outputs) = ([chain.input()], chain.outputs());
    let sweep = Sweep { omega: &omega, inputs: &inputs, outputs: &outputs, sensitivities: false };
    let mut response = Response::default();
    system.sweep(&sweep, coefficients, &mut response)?;
    std::fs::write(format!("{folder}/system.json"), chain.to_json(&omega, &LAWS).to_string())?;
    let bytes: Vec<u8> = response.h.iter().flat_map(|h| [h.re, h.im]).flat_map(f64::to_le_bytes).collect();
    std::fs::write(format!("{folder}/h.bin"), bytes)?;
    println!("ready");
    let mut march = March::new(chain.bodies, 1e-5)?;
    for line in std::io::stdin().lines() {
        let line = line?;
        let seconds = if line.trim() == "march" {
            median(|| Ok(march.step().map(|_| ())?))?
        } else {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(line.trim().parse()?).build()?;
            median(|| Ok(pool.install(|| system.sweep(&sweep, coefficients, &mut response))?))?
        };
        println!("{seconds:e}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn median(mut work: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut times = Vec::new();
    for _ in 0..21 {
        let clock = Instant::now();
        work()?;
        times.push(clock.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}
