//! The solver's score on NIST's Statistical Reference Datasets: 27 nonlinear regressions with certified answers, two starts each.
//!
//! Source: NIST/ITL StRD, nonlinear regression. The data stand in `datasets/nist-strd`, in the project's own form. Jacobians are exact
//! (dual numbers); no start, scale or bound beyond NIST's own is given to the solver.

use super::*;
use num_dual::{Dual64, DualNum, DualNumCopy};
use serde::Deserialize;

/// One certified regression.
#[derive(Debug, Clone, Deserialize)]
pub struct Certified {
    pub name: String,
    pub starts: [Vec<f64>; 2],
    pub certified: Vec<f64>,
    /// standard deviations of the parameters, rescaled by the residual standard deviation
    pub certified_std: Vec<f64>,
    /// certified residual sum of squares
    pub certified_rss: f64,
    pub y: Vec<f64>,
    /// one list per predictor
    pub x: Vec<Vec<f64>>,
}

macro_rules! datasets {
    ($($name:literal),* $(,)?) => {
        [$(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../datasets/nist-strd/", $name, ".toml"))),*]
    };
}

const DATASETS: [&str; 27] = datasets![
    "Bennett5", "BoxBOD", "Chwirut1", "Chwirut2", "DanWood", "ENSO", "Eckerle4", "Gauss1", "Gauss2", "Gauss3", "Hahn1", "Kirby2",
    "Lanczos1", "Lanczos2", "Lanczos3", "MGH09", "MGH10", "MGH17", "Misra1a", "Misra1b", "Misra1c", "Misra1d", "Nelson", "Rat42", "Rat43",
    "Roszman1", "Thurber",
];

/// All 27 problems, by name.
pub fn problems() -> Result<Vec<Certified>, toml::de::Error> {
    DATASETS.iter().map(|text| toml::from_str(text)).collect()
}

/// The published model y(b, x).
fn model<D: DualNumCopy + DualNum<Primitive = f64>>(name: &str, b: &[D], x: &[f64]) -> Option<D> {
    use std::f64::consts::PI;
    let x0 = x[0];
    let gauss = |a: D, centre: D, width: D| a * (-((centre - x0) / width).powi(2)).exp();
    let cycle = |c: D, s: D, period: D| {
        let phase = period.recip() * (2.0 * PI * x0);
        c * phase.cos() + s * phase.sin()
    };
    let poly =
        |coefficients: &[D], constant: D| coefficients.iter().enumerate().fold(constant, |sum, (k, &c)| sum + c * x0.powi(k as i32 + 1));
    let one = D::from(1.0);
    Some(match name {
        "Bennett5" => b[0] * (b[1] + x0).powd(-b[2].recip()),
        "BoxBOD" | "Misra1a" => b[0] * (one - (-b[1] * x0).exp()),
        "Chwirut1" | "Chwirut2" => (-b[0] * x0).exp() / (b[1] + b[2] * x0),
        "DanWood" => b[0] * D::from(x0).powd(b[1]),
        "ENSO" => b[0] + cycle(b[1], b[2], D::from(12.0)) + cycle(b[4], b[5], b[3]) + cycle(b[7], b[8], b[6]),
        "Eckerle4" => b[0] / b[1] * (((b[2] - x0) / b[1]).powi(2) * -0.5).exp(),
        "Gauss1" | "Gauss2" | "Gauss3" => b[0] * (-b[1] * x0).exp() + gauss(b[2], b[3], b[4]) + gauss(b[5], b[6], b[7]),
        "Hahn1" | "Thurber" => poly(&b[1..4], b[0]) / poly(&b[4..7], one),
        "Kirby2" => poly(&b[1..3], b[0]) / poly(&b[3..5], one),
        "Lanczos1" | "Lanczos2" | "Lanczos3" => b[0] * (-b[1] * x0).exp() + b[2] * (-b[3] * x0).exp() + b[4] * (-b[5] * x0).exp(),
        "MGH09" => b[0] * (b[1] * x0 + x0 * x0) / (b[2] * x0 + b[3] + x0 * x0),
        "MGH10" => b[0] * (b[1] / (b[2] + x0)).exp(),
        "MGH17" => b[0] + b[1] * (-b[3] * x0).exp() + b[2] * (-b[4] * x0).exp(),
        "Misra1b" => b[0] * (one - (b[1] * (0.5 * x0) + 1.0).powi(-2)),
        "Misra1c" => b[0] * (one - (b[1] * (2.0 * x0) + 1.0).powf(-0.5)),
        "Misra1d" => b[0] * b[1] * x0 / (b[1] * x0 + 1.0),
        "Nelson" => b[0] - b[1] * x0 * (-b[2] * x[1]).exp(),
        "Rat42" => b[0] / ((b[1] - b[2] * x0).exp() + 1.0),
        "Rat43" => b[0] / ((b[1] - b[2] * x0).exp() + 1.0).powd(b[3].recip()),
        "Roszman1" => b[0] - b[1] * x0 - (b[2] / (-b[3] + x0)).atan() / PI,
        _ => return None,
    })
}

impl Certified {
    fn evaluate<D: DualNumCopy + DualNum<Primitive = f64>>(&self, b: &[D]) -> Result<Vec<D>, EvalError> {
        let unknown = || EvalError::new(format!("no model named {}", self.name));
        (0..self.y.len())
            .map(|i| {
                let x: Vec<f64> = self.x.iter().map(|column| column[i]).collect();
                // Nelson's regression is on log[y]
                let y = if self.name == "Nelson" { self.y[i].ln() } else { self.y[i] };
                Ok(model(&self.name, b, &x).ok_or_else(unknown)? - y)
            })
            .collect()
    }
}

/// Residuals model - y, not divided by a noise: NIST states none.
impl LeastSquares for Certified {
    fn n_params(&self) -> usize {
        self.certified.len()
    }

    fn n_residuals(&self) -> usize {
        self.y.len()
    }

    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        Ok(DVector::from_vec(self.evaluate(p)?))
    }

    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let r = self.residuals(p)?;
        let mut j = DMatrix::zeros(r.len(), p.len());
        for c in 0..p.len() {
            let seeded: Vec<Dual64> = p.iter().enumerate().map(|(k, &v)| Dual64::new(v, if k == c { 1.0 } else { 0.0 })).collect();
            self.evaluate(&seeded)?.iter().enumerate().for_each(|(i, v)| j[(i, c)] = v.eps);
        }
        Ok((r, j))
    }
}

/// One line of the score.
#[derive(Debug, Clone)]
pub struct Score {
    pub name: String,
    /// 1 (far) or 2 (near)
    pub start: usize,
    /// correct digits of the worst parameter, -log10 |b - certified| / |certified|, at most 11 (the digits certified)
    pub digits: f64,
    /// the same of the residual sum of squares
    pub rss_digits: f64,
    pub outcome: FitOutcome,
}

/// Digits of `value` that agree with `certified`, between 0 and 11.
pub fn digits(value: f64, certified: f64) -> f64 {
    let error = (value - certified).abs() / if certified == 0.0 { 1.0 } else { certified.abs() };
    if error.is_nan() { 0.0 } else { (-error.log10()).clamp(0.0, 11.0) }
}

/// Runs all 54 fits with the solver's default options.
pub fn score(options: impl Fn(&mut FitOptions)) -> Result<Vec<Score>, IdentifyError> {
    let problems = problems().map_err(|why| IdentifyError::StartFails(EvalError::new(why.to_string())))?;
    let mut scores = Vec::with_capacity(54);
    for problem in &problems {
        for (k, start) in problem.starts.iter().enumerate() {
            let mut stated = FitOptions::new((0..start.len()).map(|j| format!("b{}", j + 1)));
            options(&mut stated);
            let outcome = fit(problem, start, &stated, &Monitor::default())?;
            let worst = outcome.p.iter().zip(&problem.certified).map(|(&p, &c)| digits(p, c)).fold(11.0, f64::min);
            let rss_digits = digits(2.0 * outcome.cost, problem.certified_rss);
            let name = problem.name.clone();
            scores.push(Score { name, start: k + 1, digits: worst, rss_digits, outcome });
        }
    }
    Ok(scores)
}

/// The score as a table for people.
pub fn table(scores: &[Score]) -> String {
    let mut out = format!("{:10} {:>5} {:>6} {:>6} {:>5} {:>6}  termination\n", "problem", "start", "digits", "rss", "iter", "evals");
    for s in scores {
        let (r, j) = s.outcome.evaluations;
        let end = format!("{:?}", s.outcome.termination);
        out += &format!(
            "{:10} {:>5} {:6.1} {:6.1} {:>5} {:>6}  {end}\n",
            s.name,
            s.start,
            s.digits,
            s.rss_digits,
            s.outcome.iterations,
            r + j
        );
    }
    let good = scores.iter().filter(|s| s.digits >= 6.0).count();
    out + &format!("{good} of {} fits reach 6 digits in every parameter\n", scores.len())
}

#[test]
fn nist_strd_54() {
    let scores = score(|_| {}).unwrap();
    println!("{}", table(&scores));
    assert_eq!(scores.len(), 54);
    let good = scores.iter().filter(|s| s.digits >= 6.0).count();
    assert!(good >= 52, "{good} of 54");
}

#[test]
fn published_models_reproduce_the_certified_sum_of_squares() {
    for problem in problems().unwrap() {
        let rss = problem.residuals(&problem.certified).unwrap().norm_squared();
        // Lanczos1's certified sum (1.4e-25) is below what ten certified digits of the parameters reproduce
        let floor = if problem.name == "Lanczos1" { 1e-18 } else { 0.0 };
        assert!((rss - problem.certified_rss).abs() <= 1e-7 * problem.certified_rss + floor, "{}: {rss:e}", problem.name);
    }
}
