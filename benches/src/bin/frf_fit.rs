//! Six-parameter FRF fit for benches/peers/fit.py.
//!
//! `frf_fit DIR BODIES LINES SIGMA` writes DIR/system.json (truth and start included) and prints `ready`; for each line of its standard
//! input it reads DIR/measured.bin (little-endian complex f64, line by line, outputs fastest), fits it, and prints one JSON object.

use std::error::Error;
use std::io::Write;
use std::time::Instant;

use misfit::engine::blocktri::BlockTriError;
use misfit_benches::chain::{C64, lines};
use misfit_benches::fit::{FrfFit, PARAMETERS, START, TRUTH, chain, laws};
use nalgebra::{DMatrix, DVector};
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, bodies, count, sigma] = arguments.as_slice() else { return Err("usage: frf_fit DIR BODIES LINES SIGMA".into()) };
    let (chain, omega) = (chain(bodies.parse()?), lines(count.parse()?));
    let mut system = chain.to_json(&omega, &laws(&TRUTH));
    (system["truth"], system["start"]) = (json!(TRUTH), json!(START));
    std::fs::write(format!("{folder}/system.json"), system.to_string())?;
    println!("ready");
    for line in std::io::stdin().lines() {
        line?;
        let numbers: Vec<f64> =
            std::fs::read(format!("{folder}/measured.bin"))?.as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
        let measured = numbers.chunks_exact(2).map(|c| C64::new(c[0], c[1])).collect();
        let clock = Instant::now();
        let problem = FrfFit::new(&chain, omega.clone(), measured, sigma.parse()?)?;
        let (p, cost, evaluations) = levenberg_marquardt(&problem, &START)?;
        let wall_s = clock.elapsed().as_secs_f64();
        println!("{}", json!({"p": p.as_slice(), "cost": cost, "evaluations": evaluations, "wall_s": wall_s}));
        std::io::stdout().flush()?;
    }
    Ok(())
}

/// Unconstrained Levenberg-Marquardt on cost = 1/2 ||r||^2 with column scaling, until the predicted drop is 1e-10 of the cost.
fn levenberg_marquardt(problem: &FrfFit, start: &[f64]) -> Result<(DVector<f64>, f64, usize), BlockTriError> {
    let mut p = DVector::from_column_slice(start);
    let (mut r, mut jacobian) = problem.jacobian(start)?;
    let (mut cost, mut damping, mut evaluations) = (0.5 * r.norm_squared(), 1e-3, 1);
    loop {
        // One reduction per Jacobian: everything after works on the triangle and Q'r.
        let scale: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
        let qr = jacobian.clone().qr();
        let mut rotated = r.clone();
        qr.q_tr_mul(&mut rotated);
        let (triangle, rotated) = (qr.r(), rotated.rows(0, PARAMETERS).into_owned());
        loop {
            let mut damped = DMatrix::zeros(2 * PARAMETERS, PARAMETERS);
            damped.rows_mut(0, PARAMETERS).copy_from(&triangle);
            (0..PARAMETERS).for_each(|i| damped[(PARAMETERS + i, i)] = f64::sqrt(damping) * scale[i]);
            let mut right = DVector::zeros(2 * PARAMETERS);
            right.rows_mut(0, PARAMETERS).copy_from(&-&rotated);
            let small = damped.qr();
            small.q_tr_mul(&mut right);
            let Some(step) = small.r().solve_upper_triangular(&right.rows(0, PARAMETERS).into_owned()) else {
                return Ok((p, cost, evaluations));
            };
            let predicted = 0.5 * rotated.norm_squared() - 0.5 * (&triangle * &step + &rotated).norm_squared();
            let trial = &p + &step;
            evaluations += 1;
            // A step so long that the model is singular there is a step too long.
            let Ok((next, slope)) = problem.jacobian(trial.as_slice()) else {
                damping *= 10.0;
                continue;
            };
            let lower = 0.5 * next.norm_squared();
            let done = predicted <= 1e-10 * cost;
            if lower < cost {
                (p, r, jacobian, cost) = (trial, next, slope, lower);
                damping = (damping * 0.1).max(1e-12);
            } else {
                damping *= 10.0;
            }
            if done || damping > 1e12 {
                return Ok((p, cost, evaluations));
            }
            if lower <= cost {
                break;
            }
        }
    }
}
