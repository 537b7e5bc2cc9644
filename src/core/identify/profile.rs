//! Profile likelihood: the interval of one parameter with all others refitted.

use super::IdentifyError;
use super::fit::{FitOptions, FitOutcome, fit};
use super::monitor::Monitor;
use super::problem::LeastSquares;
use super::uncertainty::RISE_95;

/// The profile of one parameter: cost(v) = min over the others at p_index = v.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    pub name: String,
    pub value: f64,
    /// where the cost has risen by 1.92 (95 %, one degree of freedom, noise known); None is an end at infinity: beyond a thousand times
    /// the parameter's size the rise is still less
    pub interval: (Option<f64>, Option<f64>),
    /// an end of the interval is the bound (lower, upper): the rise there is less than 1.92
    pub at_bound: (bool, bool),
    /// every (value, cost) computed, by value
    pub points: Vec<(f64, f64)>,
    /// a point better than the fit's answer, met on the way: the fit had not found the minimum
    pub better: Option<(Vec<f64>, f64)>,
}

enum End {
    At(f64),
    Bound(f64),
    Open,
}

struct Walk<'a, P: LeastSquares + ?Sized> {
    problem: &'a P,
    outcome: &'a FitOutcome,
    index: usize,
    options: FitOptions,
    monitor: Monitor<'static>,
    points: Vec<(f64, f64)>,
    better: Option<(Vec<f64>, f64)>,
    /// unit of each parameter for moving a warm start back onto the constraints
    scale: Vec<f64>,
}

impl<P: LeastSquares + ?Sized> Walk<'_, P> {
    /// Refits the others at p_index = v from a warm start; returns sqrt(2 rise), nearly linear in v, and the point.
    fn z(&mut self, v: f64, warm: &[f64]) -> Result<(f64, Vec<f64>), IdentifyError> {
        (self.options.constraints.lower[self.index], self.options.constraints.upper[self.index]) = (v, v);
        let mut start = warm.to_vec();
        start[self.index] = v;
        let start = self.options.constraints.project(&start, &self.scale)?;
        let found = fit(self.problem, &start, &self.options, &self.monitor)?;
        self.points.push((v, found.cost));
        if found.cost < self.outcome.cost * (1.0 - 1e-9) && self.better.as_ref().is_none_or(|b| found.cost < b.1) {
            self.better = Some((found.p.clone(), found.cost));
        }
        Ok(((2.0 * (found.cost - self.outcome.cost)).max(0.0).sqrt(), found.p))
    }

    /// Walks from the answer in one direction until the level is bracketed, then closes in.
    fn end(&mut self, first: f64, limit: f64, reach: f64) -> Result<End, IdentifyError> {
        let level = (2.0 * RISE_95).sqrt();
        let origin = self.outcome.p[self.index];
        let (mut inside, mut z_inside, mut warm) = (origin, 0.0, self.outcome.p.clone());
        let mut length = first;
        let (mut outside, mut z_outside) = loop {
            let mut v = origin + length;
            let stop = (v - limit) * first.signum() >= 0.0;
            if stop {
                v = limit;
            }
            if v == origin {
                return Ok(End::Bound(limit));
            }
            // where the model fails, the interval certainly ends before: halve the way to it
            let (z, p) = match self.z(v, &warm) {
                Ok(found) => found,
                Err(IdentifyError::StartFails(_)) => (f64::INFINITY, warm.clone()),
                Err(why) => return Err(why),
            };
            if z >= level {
                break (v, z);
            }
            (inside, z_inside, warm) = (v, z, p);
            if stop {
                return Ok(End::Bound(limit));
            }
            if (v - origin).abs() > reach || self.monitor.stop().is_some() {
                return Ok(End::Open);
            }
            // near enough to linear: aim at the level, at least doubling what does not get there
            let aim = if z > 0.0 { (level / z * 1.1).clamp(1.5, 10.0) } else { 10.0 };
            length *= aim;
        };
        for _ in 0..40 {
            let share = (level - z_inside) / (z_outside - z_inside);
            let share = if share.is_finite() && z_outside.is_finite() { share.clamp(0.05, 0.95) } else { 0.5 };
            let v = inside + share * (outside - inside);
            if (outside - inside).abs() <= 1e-4 * (outside - origin).abs() || self.monitor.stop().is_some() {
                break;
            }
            let (z, p) = match self.z(v, &warm) {
                Ok(found) => found,
                Err(IdentifyError::StartFails(_)) => (f64::INFINITY, warm.clone()),
                Err(why) => return Err(why),
            };
            if (z - level).abs() <= 1e-4 * level {
                return Ok(End::At(v));
            }
            if z < level {
                (inside, z_inside, warm) = (v, z, p);
            } else {
                (outside, z_outside) = (v, z);
            }
        }
        Ok(End::At(0.5 * (inside + outside)))
    }
}

/// Profiles parameter `index` around the answer of a fit. `sigma` is the linear 1-sigma where there is one; it sets the first step.
pub fn profile<P: LeastSquares + ?Sized>(
    problem: &P,
    outcome: &FitOutcome,
    index: usize,
    sigma: Option<f64>,
    options: &FitOptions,
    monitor: &Monitor<'_>,
) -> Result<Profile, IdentifyError> {
    options.validate_form(problem)?;
    let Some(name) = options.names.get(index).cloned() else {
        return Err(IdentifyError::Dimension { what: "parameter to profile".into(), got: index + 1, expected: options.names.len() });
    };
    let value = outcome.p[index];
    let size = value.abs().max(outcome.start[index].abs());
    let size = if size > 0.0 { size } else { 1.0 };
    let usable = sigma.filter(|s| s.is_finite() && *s > 0.0 && *s < 10.0 * size);
    let first = usable.map_or(0.1 * size, |s| 1.96 * s);
    let reach = 1e3 * size.max(first);
    let scale = outcome.p.iter().map(|v| if *v != 0.0 { v.abs() } else { 1.0 }).collect();
    let mut walk = Walk {
        problem,
        outcome,
        index,
        options: options.clone(),
        monitor: monitor.quiet(),
        points: vec![(value, outcome.cost)],
        better: None,
        scale,
    };
    let (lower, upper) = (options.constraints.lower[index], options.constraints.upper[index]);
    let down = walk.end(-first, lower, reach)?;
    let up = walk.end(first, upper, reach)?;
    let place = |end: &End| match end {
        End::At(v) | End::Bound(v) => Some(*v),
        End::Open => None,
    };
    let bound = |end: &End| matches!(end, End::Bound(_));
    let mut points = walk.points;
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Profile { name, value, interval: (place(&down), place(&up)), at_bound: (bound(&down), bound(&up)), points, better: walk.better })
}
