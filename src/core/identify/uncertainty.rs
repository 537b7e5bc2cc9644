//! How well a fit knows its parameters, and which combinations it does not know at all.
//!
//! The residuals are whitened, the noise is known: the covariance of the free parameters is (J'J)^-1 as it stands, computed by singular
//! values of J, never by forming J'J. Constraints that press (positive multiplier) are held as equalities: with Z an orthonormal basis of
//! the directions they leave, cov = Z (Z'J'J Z)^-1 Z'.
//!
//! **Identifiability** is decided free of units, in two stages.
//! 1. *Structural*: in column-normalised variables x_j = ||J_j|| p_j, directions whose singular value is below 1e-10 of the largest do not
//!    move the residual at all. Every parameter that takes part in one has no standard deviation, and the direction is named.
//! 2. *Practical*: a parameter may move the residual and still be unknown. It is called unidentifiable when its 1-sigma exceeds the width
//!    of its bounds, or `vague` (1000) times its size, the size being the larger of |p| and |start| or a scale given. A parameter that is
//!    fitted as its logarithm is judged by factors: unidentifiable when its 1-sigma is a factor of ten, whatever its unit. A strength whose
//!    95 % interval holds zero is not identified either: its effect may be absent. It keeps its standard deviation.
//!
//! [`Uncertainty::probe`] adds what linearisation cannot see: the parameter is moved far off (a thousandfold, or to its bound; a logarithm
//! to both sides) with the rest held. When the cost stays below the 95 % level there, the interval is open on that side: the stiffness is rigid on this scale. The
//! test cannot err towards "open": refitting the rest would only lower the cost further.

use super::IdentifyError;
use super::constraints::Source;
use super::fit::{FitOptions, FitOutcome};
use super::linalg::{pivoted_qr, svd};
use super::problem::{Augmented, LeastSquares, Losses};
use nalgebra::{DMatrix, DVector};

/// Half the 95 % quantile of chi-square with one degree of freedom: the rise of cost = 1/2 ||r||^2 that bounds a 95 % interval.
pub(crate) const RISE_95: f64 = 1.920_729_410_347_062;
const Z_95: f64 = 1.959_963_984_540_054;
const STRUCTURAL: f64 = 1e-10;
/// Correlation from which on a loosely known parameter is said to be mixed up with another.
const MIXED: f64 = 0.95;

/// What a parameter is measured by when its deviation is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Measure {
    /// By its distance from zero, where its effect is absent.
    #[default]
    Strength,
    /// By its size; zero is a value as any other.
    Position,
    /// By factors: the fit moves its logarithm.
    Logarithm,
}

/// 1-sigma of a logarithm beyond which the parameter is not identifiable: a factor of ten.
const VAGUE_LOGARITHM: f64 = std::f64::consts::LN_10;
/// Distance to which a logarithm is probed to either side: a factor of a thousand.
const FAR_LOGARITHM: f64 = 3.0 * std::f64::consts::LN_10;

/// How the judgement is made.
#[derive(Debug, Clone, PartialEq)]
pub struct UncertaintyOptions {
    /// what each parameter is measured by; empty: all are strengths
    pub measures: Vec<Measure>,
    /// size of each parameter where it is known better than by its value and start
    pub scale: Option<Vec<f64>>,
    /// 1-sigma beyond this many times the size means: not identifiable
    pub vague: f64,
    /// change of the residuals per standard deviation of what else is known to a deviation alone (a condition), a column each; no rows: nothing. With these
    /// columns B the covariance is C + C J'B B'J C, C = (J'J)^-1
    pub spread: DMatrix<f64>,
}

impl Default for UncertaintyOptions {
    fn default() -> Self {
        Self { measures: vec![], scale: None, vague: 1e3, spread: DMatrix::zeros(0, 0) }
    }
}

impl UncertaintyOptions {
    /// These measures, and the rest as by default.
    pub fn measured(measures: Vec<Measure>) -> Self {
        Self { measures, ..Self::default() }
    }

    fn measure(&self, k: usize) -> Measure {
        self.measures.get(k).copied().unwrap_or_default()
    }
}

/// What is known of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterUncertainty {
    pub name: String,
    /// what it is measured by
    pub measure: Measure,
    pub value: f64,
    /// 1-sigma from the stated noise; None at a bound and where not identifiable
    pub std: Option<f64>,
    /// the same times sqrt(chi2 / degrees of freedom), for noise known up to a factor
    pub std_rescaled: Option<f64>,
    pub identifiable: bool,
    /// held at one of its bounds by the data
    pub at_bound: bool,
    /// 95 % interval; an end that is None is infinite
    pub interval: (Option<f64>, Option<f64>),
    /// why there is no standard deviation, or that the interval reaches beyond zero and what the parameter is mixed up with
    pub note: Option<String>,
    /// a value of the fit's variable, far beyond the one found, that agrees with the data as well: the interval is open on that side
    pub open_to: Option<f64>,
}

/// A direction in parameter space that the data do not see.
#[derive(Debug, Clone, PartialEq)]
pub struct NullCombination {
    /// "k1 + 0.98 k2", in relative variables (each parameter over its size), moving along which changes nothing
    pub label: String,
    /// (parameter, coefficient in relative variables), largest 1
    pub coefficients: Vec<(usize, f64)>,
}

/// Uncertainty of a whole fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    pub parameters: Vec<ParameterUncertainty>,
    /// covariance of the identifiable part, n x n; rows of parameters without std are NaN
    pub covariance: DMatrix<f64>,
    pub unidentifiable: Vec<NullCombination>,
    /// ||r||^2 over the problem's residuals and priors
    pub chi2: f64,
    pub degrees_of_freedom: i64,
}

/// Linear uncertainty at the fit's answer. For a robust loss J is weighted as in the last step.
pub fn uncertainty(outcome: &FitOutcome, fit: &FitOptions, options: &UncertaintyOptions) -> Result<Uncertainty, IdentifyError> {
    let n = outcome.p.len();
    let names = &fit.names;
    let measures = if options.measures.is_empty() { n } else { options.measures.len() };
    for (what, got) in [("parameter names", names.len()), ("scales", options.scale.as_ref().map_or(n, Vec::len)), ("measures", measures)] {
        if got != n {
            return Err(IdentifyError::Dimension { what: what.into(), got, expected: n });
        }
    }
    fit.constraints.validate_form(names)?;
    let mut j = outcome.jacobian.clone();
    let mut r = outcome.residuals.clone();
    if let Some(w) = Losses::new(&fit.losses, outcome.n_residuals)?.sqrt_weights(&outcome.residuals) {
        for (i, w) in w.iter().enumerate() {
            j.row_mut(i).scale_mut(*w);
            r[i] *= w;
        }
    }
    let size = |k: usize| {
        let given = options.scale.as_ref().map(|s| s[k].abs()).filter(|s| s.is_finite() && *s > 0.0);
        let seen = outcome.p[k].abs().max(outcome.start[k].abs());
        let range = fit.constraints.upper[k] - fit.constraints.lower[k];
        given.unwrap_or(if options.measure(k) == Measure::Logarithm {
            1.0
        } else if seen > 0.0 {
            seen
        } else if range.is_finite() && range > 0.0 {
            range
        } else {
            1.0
        })
    };
    let sizes: Vec<f64> = (0..n).map(size).collect();
    let reach = |k: usize| if options.measure(k) == Measure::Logarithm { VAGUE_LOGARITHM } else { options.vague * sizes[k] };
    let reaches: Vec<f64> = (0..n).map(reach).collect();
    // D: column norms; a parameter without influence keeps its size's inverse so that its direction can be named
    let norms: Vec<f64> = j.column_iter().map(|c| c.norm()).collect();
    let inert: Vec<bool> = norms.iter().enumerate().map(|(k, v)| *v == 0.0 || outcome.held.contains(&k)).collect();
    let d: Vec<f64> = (0..n).map(|k| if inert[k] { 1.0 / sizes[k] } else { norms[k] }).collect();

    let holds = pressing(outcome, fit, &j, &r);
    let fixed = |k: usize| fit.constraints.is_fixed(k) || holds.iter().any(|s| matches!(s, Source::Lower(b) | Source::Upper(b) if *b == k));
    let z = allowed_directions(&holds, fit, &d, n);
    let x = DMatrix::from_fn(j.nrows(), n, |i, k| if inert[k] { 0.0 } else { j[(i, k)] / d[k] });
    let m = &x * &z;
    let (s, v) = if m.ncols() == 0 {
        (DVector::zeros(0), DMatrix::zeros(0, 0))
    } else {
        svd(&m).ok_or(IdentifyError::Numerical { while_doing: "decomposing the sensitivities" })?
    };
    let top = s.iter().copied().fold(0.0, f64::max);
    let known: Vec<usize> = (0..s.len()).filter(|&k| s[k] > STRUCTURAL * top).collect();
    let unknown: Vec<usize> = (0..s.len()).filter(|&k| s[k] <= STRUCTURAL * top).collect();

    // square root of the covariance in p: one column per known singular direction
    let zv = &z * &v;
    let root = DMatrix::from_fn(n, known.len(), |i, c| zv[(i, known[c])] / (s[known[c]] * d[i]));
    let root = with_spread(root, &j, &options.spread);
    let null = DMatrix::from_fn(n, unknown.len(), |i, c| zv[(i, unknown[c])] / (d[i] * sizes[i])); // in relative variables p / size
    let in_null: Vec<bool> = (0..n).map(|i| unknown.iter().map(|&c| zv[(i, c)].powi(2)).sum::<f64>().sqrt() > 1e-6).collect();

    let degrees = r.len() as i64 - known.len() as i64;
    let chi2 = r.norm_squared();
    let rescale = (degrees > 0).then(|| (chi2 / degrees as f64).sqrt());
    let at_bounds = fit.constraints.at_bound(&outcome.p);
    let mut vague = vec![false; n];
    let parameters = (0..n).map(|k| {
        let at_bound = at_bounds.iter().any(|b| b.0 == k) && fixed(k);
        let sigma = root.row(k).norm();
        let range = fit.constraints.upper[k] - fit.constraints.lower[k];
        vague[k] = sigma > reaches[k] || (range.is_finite() && sigma > range);
        let note = if fixed(k) {
            Some(if inert[k] { "held, and it moves no residual" } else { "held at its bound" }.to_string())
        } else if inert[k] {
            Some("it moves no residual".into())
        } else if in_null[k] {
            Some("only a combination with others is seen".into())
        } else if vague[k] && options.measure(k) == Measure::Logarithm {
            Some(format!("the data leave it free: 1-sigma is a factor of {:.3e}", sigma.exp()))
        } else if vague[k] {
            Some(format!("the data leave it free: 1-sigma {sigma:.3e} against a size of {:.3e}", sizes[k]))
        } else {
            None
        };
        let std = note.is_none().then_some(sigma);
        let value = outcome.p[k];
        let interval = match std {
            Some(s) => (Some(value - Z_95 * s), Some(value + Z_95 * s)),
            None if fixed(k) => (Some(value), Some(value)),
            None => (None, None),
        };
        let interval = (clip(interval.0, fit.constraints.lower[k], f64::max), clip(interval.1, fit.constraints.upper[k], f64::min));
        let identifiable = std.is_some() || (fixed(k) && !inert[k]);
        let std_rescaled = std.zip(rescale).map(|(s, f)| s * f);
        let measure = options.measure(k);
        ParameterUncertainty {
            name: names[k].clone(),
            measure,
            value,
            std,
            std_rescaled,
            identifiable,
            at_bound,
            interval,
            note,
            open_to: None,
        }
    });
    let parameters: Vec<_> = parameters.collect();
    let mut covariance = &root * root.transpose();
    for (k, parameter) in parameters.iter().enumerate().filter(|(_, p)| p.std.is_none()) {
        let fill = if fixed(k) && parameter.identifiable { 0.0 } else { f64::NAN };
        covariance.row_mut(k).fill(fill);
        covariance.column_mut(k).fill(fill);
    }
    let mut unidentifiable = combinations(null, names);
    // practically unknown parameters: their own directions, in relative variables, by the largest axes of the relative covariance
    unidentifiable.extend(vague_combinations(&root, &reaches, &vague, &in_null, names));
    let mut found = Uncertainty { parameters, covariance, unidentifiable, chi2, degrees_of_freedom: degrees };
    found.note_loose();
    Ok(found)
}

/// The root of a covariance with a column more for each cause whose effect on the residuals is known to a deviation: what it moves the parameters by.
fn with_spread(root: DMatrix<f64>, j: &DMatrix<f64>, spread: &DMatrix<f64>) -> DMatrix<f64> {
    let rows = spread.nrows().min(j.nrows());
    if rows == 0 || spread.ncols() == 0 {
        return root;
    }
    let moved = &root * (root.transpose() * j.rows(0, rows).tr_mul(&spread.rows(0, rows)));
    DMatrix::from_columns(&root.column_iter().chain(moved.column_iter()).collect::<Vec<_>>())
}

fn clip(end: Option<f64>, bound: f64, towards: fn(f64, f64) -> f64) -> Option<f64> {
    match end {
        Some(v) => Some(towards(v, bound)),
        None => bound.is_finite().then_some(bound),
    }
}

/// Constraints that hold at the answer and press: releasing them would lower the cost.
fn pressing(outcome: &FitOutcome, fit: &FitOptions, j: &DMatrix<f64>, r: &DVector<f64>) -> Vec<Source> {
    let gradient = j.tr_mul(r);
    let mut holds: Vec<Source> =
        fit.constraints.at_bound(&outcome.p).into_iter().map(|(k, low)| if low { Source::Lower(k) } else { Source::Upper(k) }).collect();
    // a bound on which the parameter merely lies, the data pulling inwards, leaves it free
    holds.retain(|s| match *s {
        Source::Lower(k) => gradient[k] > 0.0,
        Source::Upper(k) => gradient[k] < 0.0,
        _ => true,
    });
    for active in outcome.active.iter().filter(|a| a.multiplier > 0.0) {
        if matches!(active.source, Source::Order(_) | Source::Row(_)) || !holds.contains(&active.source) {
            let still = fit.constraints.inequalities().into_iter().find(|i| i.source == active.source);
            if still.is_some_and(|i| i.slack(&outcome.p).abs() <= 1e-9 * i.magnitude(&outcome.p)) && !holds.contains(&active.source) {
                holds.push(active.source);
            }
        }
    }
    holds
}

/// Orthonormal basis, in x = D p, of the directions that held constraints and fixed parameters leave; n x free.
fn allowed_directions(holds: &[Source], fit: &FitOptions, d: &[f64], n: usize) -> DMatrix<f64> {
    let all = fit.constraints.inequalities();
    let mut normals: Vec<DVector<f64>> = Vec::new();
    for source in holds {
        let mut g = DVector::zeros(n);
        all.iter().filter(|i| i.source == *source).flat_map(|i| &i.a).for_each(|&(k, a)| g[k] += a / d[k]);
        if g.norm() > 0.0 {
            normals.push(g.normalize());
        }
    }
    for k in (0..n).filter(|&k| fit.constraints.is_fixed(k)) {
        normals.push(DVector::from_fn(n, |i, _| if i == k { 1.0 } else { 0.0 }));
    }
    if normals.is_empty() {
        return DMatrix::identity(n, n);
    }
    let factor = pivoted_qr(&DMatrix::from_columns(&normals), 1e-10);
    factor.q.columns(factor.rank, n - factor.rank).into_owned()
}

/// Reduces a basis of null directions to few parameters each (Gauss-Jordan with full pivoting) and names them.
fn combinations(mut null: DMatrix<f64>, names: &[String]) -> Vec<NullCombination> {
    let (n, count) = null.shape();
    let mut done: Vec<usize> = Vec::new();
    let mut used = vec![false; n];
    for _ in 0..count {
        let open = (0..count).filter(|c| !done.contains(c)).flat_map(|c| (0..n).map(move |i| (i, c))).filter(|&(i, _)| !used[i]);
        let Some((i, c)) = open.max_by(|a, b| null[*a].abs().total_cmp(&null[*b].abs())) else { break };
        let pivot = null[(i, c)];
        if pivot == 0.0 {
            break;
        }
        null.column_mut(c).unscale_mut(pivot);
        let column = null.column(c).into_owned();
        (0..count).filter(|&o| o != c).for_each(|o| {
            let factor = null[(i, o)];
            null.column_mut(o).axpy(-factor, &column, 1.0);
        });
        used[i] = true;
        done.push(c);
    }
    done.into_iter().map(|c| named(&null.column(c).into_owned(), names)).collect()
}

/// `reaches`: deviation of each parameter beyond which it is not identifiable.
fn vague_combinations(root: &DMatrix<f64>, reaches: &[f64], vague: &[bool], in_null: &[bool], names: &[String]) -> Vec<NullCombination> {
    if root.ncols() == 0 || !vague.iter().zip(in_null).any(|(v, n)| *v && !*n) {
        return vec![];
    }
    let relative = DMatrix::from_fn(root.ncols(), reaches.len(), |c, i| if in_null[i] { 0.0 } else { root[(i, c)] / reaches[i] });
    let Some((s, v)) = svd(&relative) else { return vec![] };
    let wide: Vec<_> = (0..s.len()).filter(|&k| s[k] > 1.0).map(|k| named(&v.column(k).into_owned(), names)).collect();
    if !wide.is_empty() {
        return wide;
    }
    // wider than its bounds though not than its size: the parameter by itself
    let alone = (0..vague.len()).filter(|&k| vague[k] && !in_null[k]);
    alone.map(|k| NullCombination { label: names[k].clone(), coefficients: vec![(k, 1.0)] }).collect()
}

/// Largest coefficient 1, what is below 1 % of it left out.
fn named(direction: &DVector<f64>, names: &[String]) -> NullCombination {
    let largest = direction.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|v| *v != 0.0).unwrap_or(1.0);
    let mut coefficients: Vec<(usize, f64)> = direction.iter().map(|v| v / largest).enumerate().filter(|(_, v)| v.abs() >= 0.01).collect();
    // equal sizes keep the order of the parameters
    coefficients.sort_by(|a, b| (b.1.abs() * 1e3).round().total_cmp(&(a.1.abs() * 1e3).round()).then(a.0.cmp(&b.0)));
    if let Some(&(_, first)) = coefficients.first() {
        coefficients.iter_mut().for_each(|c| c.1 /= first);
    }
    let mut label = String::new();
    for (place, &(k, c)) in coefficients.iter().enumerate() {
        let sign = if c < 0.0 { "-" } else { "+" };
        let size = format!("{:.2}", c.abs());
        let factor = if size == "1.00" { String::new() } else { format!("{size} ") };
        label += &if place == 0 { format!("{factor}{}", names[k]) } else { format!(" {sign} {factor}{}", names[k]) };
    }
    NullCombination { label, coefficients }
}

/// Ends at which the data agree with a value far beyond the one found.
struct Open {
    down: Option<f64>,
    up: Option<f64>,
}

impl Open {
    fn of([down, up]: [Option<f64>; 2]) -> Option<Self> {
        (down.is_some() || up.is_some()).then_some(Self { down, up })
    }
}

/// Values far below and far above that a parameter is probed at; none where it is well known or the bound on that side is near.
fn far_ends(parameter: &ParameterUncertainty, lower: f64, upper: f64) -> [Option<f64>; 2] {
    let value = parameter.value;
    if parameter.measure == Measure::Logarithm {
        let wide = parameter.std.is_none_or(|s| s > 0.25);
        let end = |far: f64| (wide && (far - value).abs() >= std::f64::consts::LN_2).then_some(far);
        return [end((value - FAR_LOGARITHM).max(lower)), end((value + FAR_LOGARITHM).min(upper))];
    }
    let far = (value * 1e3).max(lower).min(upper);
    let wide = value != 0.0 && parameter.std.is_none_or(|s| s > 0.25 * value.abs());
    let end = (wide && (far / value).abs() >= 2.0).then_some(far);
    if value > 0.0 { [None, end] } else { [end, None] }
}

impl Uncertainty {
    /// Looks for intervals without an end. Parameters whose 1-sigma exceeds a quarter of their value (of a logarithm: 0.25), and those
    /// already unidentifiable, are moved a thousandfold away from zero (or to the bound on that side), logarithms a thousandfold up and
    /// down, the others held; where the cost rises by less than the 95 % level, that end is open and the parameter is not identifiable. A
    /// model that fails there proves nothing and changes nothing.
    pub fn probe<P: LeastSquares + ?Sized>(&mut self, problem: &P, outcome: &FitOutcome, fit: &FitOptions) -> Result<(), IdentifyError> {
        fit.validate_form(problem)?;
        let augmented = Augmented { problem, priors: &fit.priors };
        let losses = Losses::new(&fit.losses, problem.n_residuals())?;
        let agrees = |k: usize, far: f64| {
            let mut p = outcome.p.clone();
            p[k] = far;
            augmented.residuals(&p).is_ok_and(|r| losses.cost(&r) - outcome.cost <= RISE_95)
        };
        for k in 0..self.parameters.len() {
            let parameter = &self.parameters[k];
            if parameter.at_bound || fit.constraints.is_fixed(k) {
                continue;
            }
            let (lower, upper) = (fit.constraints.lower[k], fit.constraints.upper[k]);
            let ends = far_ends(parameter, lower, upper);
            if let Some(open) = Open::of(ends.map(|end| end.filter(|far| agrees(k, *far)))) {
                self.open(k, open, (lower, upper));
            }
        }
        Ok(())
    }

    /// Opens the interval of parameter `k` at the ends found.
    fn open(&mut self, k: usize, open: Open, (lower, upper): (f64, f64)) {
        let parameter = &mut self.parameters[k];
        let sigma = parameter.std.take();
        (parameter.std_rescaled, parameter.identifiable) = (None, false);
        let value = parameter.value;
        // The near end: where 1/p, which such a parameter acts through, leaves its own 95 % interval.
        let near = |side: f64| match parameter.measure {
            Measure::Logarithm => sigma.map(|s| value - side * (1.0 + Z_95 * s).ln()),
            _ => sigma.map(|s| value / (1.0 + Z_95 * s / value.abs())),
        };
        let (low, high) = (lower.is_finite().then_some(lower), upper.is_finite().then_some(upper));
        parameter.interval = match (open.down, open.up) {
            (Some(_), Some(_)) => (low, high),
            (None, _) => (near(1.0).or(parameter.interval.0), high),
            (_, None) => (low, near(-1.0).or(parameter.interval.1)),
        };
        parameter.open_to = open.up.or(open.down);
        self.covariance.row_mut(k).fill(f64::NAN);
        self.covariance.column_mut(k).fill(f64::NAN);
        if !self.unidentifiable.iter().any(|c| c.coefficients.iter().any(|&(i, _)| i == k)) {
            self.unidentifiable.push(NullCombination { label: self.parameters[k].name.clone(), coefficients: vec![(k, 1.0)] });
        }
    }

    /// Strengths whose interval reaches beyond zero are not identified: nothing, as far as these data tell, or known with another only.
    fn note_loose(&mut self) {
        let loose = |p: &ParameterUncertainty| p.measure == Measure::Strength && p.std.is_some_and(|s| Z_95 * s > p.value.abs());
        for k in (0..self.parameters.len()).filter(|&k| loose(&self.parameters[k])).collect::<Vec<_>>() {
            let others = (0..self.parameters.len()).filter(|&o| o != k).filter_map(|o| Some((o, self.correlation(k, o)?)));
            let closest = others.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).filter(|(_, c)| c.abs() >= MIXED);
            self.parameters[k].identifiable = false;
            self.parameters[k].note = Some(match closest {
                Some((o, c)) => format!("zero is in its interval: mixed up with {} (correlation {c:.3})", self.parameters[o].name),
                None => "zero is in its interval".into(),
            });
        }
    }

    /// Correlation of two parameters, None where either has no standard deviation.
    pub fn correlation(&self, a: usize, b: usize) -> Option<f64> {
        let (sa, sb) = (self.parameters.get(a)?.std?, self.parameters.get(b)?.std?);
        let covariance = self.covariance.get((a, b))?;
        (sa > 0.0 && sb > 0.0).then(|| covariance / (sa * sb))
    }
}
