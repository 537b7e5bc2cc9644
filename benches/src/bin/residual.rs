//! Times one evaluation of the residual of a study, for the comparison with the same call from Python (`python/bench`).
//!
//!     cargo run --release -p misfit-benches --bin residual -- studies/01-hidden-effect 40
//!
//! Prints the seconds of every call, one a line.

use std::time::Instant;

use misfit::diagnose::Case;
use misfit::diagnose::results::SplitName;
use misfit::identify::LeastSquares;
use misfit::residual::Problem;
use misfit::study::Study;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or("studies/01-hidden-effect".into());
    let n: usize = arguments.next().map_or(Ok(40), |n| n.parse())?;
    let study = Study::load(path.as_ref(), None)?;
    let case = Case::from_study(&study, 1)?;
    let problem = Problem::new(case.plans_of(SplitName::Fit), case.system.clone());
    let variables = problem.variables();
    for _ in 0..n {
        let began = Instant::now();
        let r = problem.residuals(&variables)?;
        std::hint::black_box(&r);
        println!("{}", began.elapsed().as_secs_f64());
    }
    Ok(())
}
