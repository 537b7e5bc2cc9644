//! The score test: how much of the misfit each candidate would explain, from one evaluation of the model with all candidates at their
//! null strength (design.md section 6).
//!
//! With `J` the columns of the free parameters that are not held at a bound and the priors' rows, `Q` an orthonormal basis of them, `r`
//! the residual and `g` a candidate's column, both whitened with the covariance that noise and instruments within tolerance have
//! (`response::Correlated`): `r~ = (I - QQ')r`, `g~ = (I - QQ')g`, `z = -g~'r~/||g~||`, one-sided where the strength has a sign; expected
//! fall of the cost `z^2/2`.

use crate::parallel;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::effect::{Role, Sign};
use crate::identify::LeastSquares;
use crate::model::System;
use crate::residual::Problem;
use crate::response::Plan;

use super::candidates::Trial;
use super::chance::{Drawn, chance};
use super::selection::{Column, select};
use crate::diagnose::DiagnoseError;
use crate::diagnose::settings::Scoring;

/// Score of one trial.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Index of the trial.
    pub trial: usize,
    /// Standardised score, positive where the strength would grow in its admissible direction.
    pub z: f64,
    /// Fraction of the present cost that the linear model expects to fall.
    pub drop: f64,
    /// Strength at which it falls, as an increment on the null value [SI].
    pub strength: f64,
    /// Probability that the best of all trials scores as high where nothing is missing.
    pub p_value: f64,
    /// Strength that would have been seen at that level [SI].
    pub visible: f64,
}

/// What the score test says.
pub struct Scores {
    /// Every trial that can be seen, the largest expected drop first.
    pub list: Vec<Score>,
    /// The second opinion: candidates that a sparse combination of all columns needs, with their part of what it explains.
    pub selected: Vec<(usize, f64)>,
    /// What each free parameter of the model does of a unit of a trial's strength, `-J^+ g`, in the fit's variables.
    pub own: Vec<DVector<f64>>,
    /// Independent candidates among all of them...
    pub independent: f64,
    /// ...and among those of the model's physics.
    pub independent_physics: f64,
}

/// The residual and the trials' columns, without what the model's own parameters can do.
pub struct Projected {
    /// Residual `r~`.
    pub r: DVector<f64>,
    /// Column `g~` of each trial; none where the data cannot tell it from what the model has.
    pub columns: Vec<Option<DVector<f64>>>,
    /// See [`Scores::own`].
    pub own: Vec<DVector<f64>>,
    /// Half the sum of squares before.
    pub cost: f64,
}

/// Slopes with respect to the model's own parameters and residuals, a row below for every prior (index, mean, sigma).
fn with_priors(
    slopes: &DMatrix<f64>,
    r: &DVector<f64>,
    priors: &[(usize, f64, f64)],
    p: &[f64],
) -> Result<(DMatrix<f64>, DVector<f64>), DiagnoseError> {
    let rows = r.len() + priors.len();
    let (mut base, mut extended) = (DMatrix::zeros(rows, slopes.ncols()), DVector::zeros(rows));
    base.view_mut((0, 0), slopes.shape()).copy_from(slopes);
    extended.rows_mut(0, r.len()).copy_from(r);
    for (k, (index, mean, sigma)) in priors.iter().enumerate() {
        base[(r.len() + k, *index)] = 1.0 / sigma;
        extended[r.len() + k] = (p[*index] - mean) / sigma;
    }
    if base.iter().chain(extended.iter()).any(|v| !v.is_finite()) {
        let reason = "a derivative of the response with respect to the model's own parameters is not finite";
        return Err(DiagnoseError::start_fails(reason));
    }
    Ok((base, extended))
}

/// Scores are those of all candidates or none: what the time was over for is not told from what says nothing.
pub(super) fn in_time() -> Result<(), DiagnoseError> {
    if parallel::given_up() { Err(DiagnoseError::start_fails("the scoring was stopped before its end")) } else { Ok(()) }
}

/// Evaluates the model once with all trials at their null strength. `kept`: the free parameters of `system` that no bound holds.
pub fn projected(
    plans: &[&Plan],
    system: &System,
    trials: &[Trial],
    kept: &[usize],
    priors: &[(usize, f64, f64)],
    s: &Scoring,
) -> Result<Projected, DiagnoseError> {
    in_time()?;
    let mut augmented = system.clone();
    augmented.instances.extend(trials.iter().map(|t| t.instance.clone()));
    let own = system.free().len();
    let failed = crate::identify::IdentifyError::StartFails;
    let at = |plans: Vec<&Plan>, system: System| {
        let problem = Problem::new(plans, system);
        let p = problem.variables();
        problem.jacobian(&p).map(|(r, j)| (p, r, j)).map_err(failed)
    };
    // What a candidate does need not be known as closely as what the model says: a slope off by a hundredth changes no order.
    let coarser: Vec<Option<Plan>> = plans.iter().map(|p| p.coarser()).collect();
    let of_trials: Vec<&Plan> = plans.iter().zip(&coarser).map(|(p, c)| c.as_ref().unwrap_or(p)).collect();
    let (mut spared, mut first) = (coarser.iter().any(Option::is_some), at(of_trials, augmented.clone()));
    // A model that stands in its own steps need not stand in coarser ones.
    if spared && first.is_err() {
        (spared, first) = (false, at(plans.to_vec(), augmented));
    }
    let (p, mut r, j) = first?;
    in_time()?;
    let mut of_own = j.columns(0, own).into_owned();
    if spared {
        (_, r, of_own) = at(plans.to_vec(), system.clone())?;
    }
    let rows = r.len() + priors.len();
    let cost: f64 = 0.5 * r.norm_squared();
    let (base, extended) = with_priors(&of_own, &r, priors, &p)?;
    let (q, back) = decomposed(&base.select_columns(kept), s);
    let column = |t: usize| {
        if parallel::given_up() {
            return (None, DVector::zeros(0));
        }
        let mut g = DVector::zeros(rows);
        g.rows_mut(0, j.nrows()).copy_from(&j.column(own + t));
        let (size, mut moved) = (g.norm(), DVector::zeros(own));
        if !(size.is_finite() && size > 0.0) {
            return (None, moved);
        }
        let gives = -(&back * q.tr_mul(&g));
        kept.iter().zip(gives.iter()).for_each(|(k, v)| moved[*k] = *v);
        let left = project(&q, g);
        ((left.norm() >= s.visible * size).then_some(left), moved)
    };
    let (columns, of_own) = parallel::over(trials.len(), column).into_iter().unzip();
    in_time()?;
    Ok(Projected { columns, own: of_own, r: project(&q, extended), cost })
}

/// Scores every trial; the largest expected drop first.
pub fn score(
    plans: &[&Plan],
    system: &System,
    trials: &[Trial],
    kept: &[usize],
    priors: &[(usize, f64, f64)],
    seed: u64,
    settings: &Scoring,
) -> Result<Scores, DiagnoseError> {
    let Projected { r, columns: all, own, cost } = projected(plans, system, trials, kept, priors, settings)?;
    let mut scores = Vec::new();
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for (t, (trial, left)) in trials.iter().zip(all).enumerate() {
        let Some(left) = left else { continue };
        let norm = left.norm();
        let z = -left.dot(&r) / norm;
        let sign = trial.instance.effect.info().params[0].sign;
        // A gain or an exponent may go either way from its null; a strength with a sign only up.
        let two_sided = sign == Sign::Any || trial.instance.effect.info().params[0].default != 0.0;
        let gain = |z: f64| if two_sided { z.abs() } else { z.max(0.0) };
        scores.push((
            Score {
                trial: t,
                z: gain(z),
                drop: 0.5 * gain(z).powi(2) / cost.max(f64::MIN_POSITIVE),
                strength: z / norm,
                p_value: 1.0,
                visible: norm,
            },
            two_sided,
        ));
        columns.push(left / norm);
    }
    let physics = |t: usize| trials[t].instance.effect.info().role != Role::Channel;
    let drawn = |(s, both): &(Score, bool)| Drawn { two_sided: *both, candidate: trials[s.trial].candidate, physics: physics(s.trial) };
    let chance = chance(&columns, &scores.iter().map(drawn).collect::<Vec<_>>(), seed, settings);
    let null = &chance.best;
    let level = null.get((null.len() as f64 * settings.beyond_chance) as usize).copied().unwrap_or(0.0);
    let weighed = scores.iter().zip(&columns);
    let weighed: Vec<Column> = weighed.map(|((s, both), g)| Column { g, two_sided: *both, candidate: trials[s.trial].candidate }).collect();
    let selected = select(&r, &weighed, level, settings);
    let power = Normal::standard().inverse_cdf(settings.power);
    let mut scores: Vec<Score> = scores
        .into_iter()
        .map(|(mut s, _)| {
            let above = null.len() - null.partition_point(|n| *n < s.z);
            s.p_value = (above + 1) as f64 / (null.len() + 1) as f64;
            s.visible = (level + power) / s.visible;
            s
        })
        .collect();
    scores.sort_by(|a, b| b.drop.total_cmp(&a.drop));
    Ok(Scores { list: scores, selected, own, independent: chance.independent, independent_physics: chance.independent_physics })
}

/// Orthonormal basis of the columns, leaving out what is numerically dependent.
pub fn basis(j: &DMatrix<f64>, s: &Scoring) -> DMatrix<f64> {
    decomposed(j, s).0
}

/// An orthonormal basis `Q` of the columns, leaving out what is numerically dependent, and the matrix that turns coordinates in it into those
/// of the columns: `J^+ = back Q'`, without the combinations that hardly show.
pub(in crate::diagnose) fn decomposed(j: &DMatrix<f64>, scoring: &Scoring) -> (DMatrix<f64>, DMatrix<f64>) {
    let size: Vec<f64> = j.column_iter().map(|c| c.norm()).map(|n| if n > 0.0 { n } else { 1.0 }).collect();
    let scaled = DMatrix::from_fn(j.nrows(), j.ncols(), |i, k| j[(i, k)] / size[k]);
    if scaled.ncols() == 0 {
        return (scaled, DMatrix::zeros(0, 0));
    }
    let svd = scaled.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return (DMatrix::zeros(j.nrows(), 0), DMatrix::zeros(j.ncols(), 0)) };
    let s = svd.singular_values;
    let keep: Vec<usize> = (0..s.len()).filter(|k| s[*k] > scoring.dependent).collect();
    let back = |k: usize, m: usize| if s[keep[m]] > scoring.shows { v[(keep[m], k)] / (s[keep[m]] * size[k]) } else { 0.0 };
    (u.select_columns(&keep), DMatrix::from_fn(j.ncols(), keep.len(), back))
}

pub(in crate::diagnose) fn project(q: &DMatrix<f64>, v: DVector<f64>) -> DVector<f64> {
    if q.ncols() == 0 {
        return v;
    }
    let once = &v - q * q.tr_mul(&v);
    // A second pass removes what rounding left of the first.
    &once - q * q.tr_mul(&once)
}
