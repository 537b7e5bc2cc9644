//! Nonlinear modes: natural frequency and damping ratio of a structure at an amplitude of its own motion, by the extended periodic motion concept (Krack,
//! "Nonlinear modal analysis of nonconservative systems: extension of the periodic motion concept", Comput. Struct. 154, 2015, 59-71).
//!
//! The decaying motion of a mode is replaced by a periodic one, whose inertia feeds what the laws dissipate:
//!
//! `M q'' - 2 zeta w M q' + f(q, q') = 0`
//!
//! with the first harmonic of the displacement at one place equal to the amplitude `X` and in phase with the cosine. Unknown are the motion, `w` and `zeta`. Of a linear structure with
//! modal damping `w` and `zeta` are the undamped natural frequency and the damping ratio; of others `zeta` is the dissipated energy per
//! cycle over `4 pi` times the kinetic energy's largest value, to the first harmonic. Inertia is that of bodies and of linear inertial laws; an absorber counts as the frequency-dependent stiffness that it is.
//!
//! At given `w` and `zeta` the balance of [`super`] gives the motion at the amplitude, and the force `F` that the place needs for it. Newton's method finds where
//! `F(w, zeta) = 0`. A held place has one motion where a resonance under a force has three, so no branch is lost at folds. By the implicit
//! function theorem `d(w, zeta)/dp = -(dF/d(w, zeta))^-1 dF/dp`: `dF/dp` is exact for the sampled law, and the derivatives with respect to `w` and `zeta` are central
//! differences of two balances each.

mod start;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix2, Vector2};
use num_complex::Complex64;

use crate::model::{Bound, Model};
use crate::parallel;

use super::super::EngineError;
use super::Settings;
use super::balance::Balance;
use super::structure::Drive;
use super::structure::kept::Kept;

pub use start::Which;

/// A nonlinear mode at one amplitude.
#[derive(Clone, Debug)]
pub struct NonlinearMode {
    /// Natural frequency `w / 2 pi` [Hz], that of the undamped motion.
    pub frequency_hz: f64,
    /// Damping ratio zeta.
    pub damping: f64,
    /// Derivatives of frequency [Hz] and damping ratio with respect to each free parameter; empty unless asked for.
    pub slopes: Vec<[f64; 2]>,
}

/// The nonlinear modes of one model along rising amplitudes.
pub struct Backbone<'a> {
    balance: Balance<'a>,
    model: &'a Model,
    which: Which,
    /// The mode found last, first the linear one at amplitude 0, and the one before.
    last: Point,
    before: Option<Point>,
    /// Stiffness that forces are measured by [N/m or N m/rad].
    scale: f64,
    /// Whether the way to the last amplitude led to damping beyond the critical one.
    creeps: bool,
}

#[derive(Clone, Copy, Debug)]
struct Point {
    amplitude: f64,
    at: Vector2<f64>,
}

/// Amplitude at which the first mode is a linear one, as a fraction of the first amplitude asked for.
const SMALL: f64 = 1e-3;
/// Iterations of Newton's method for frequency and damping.
const ITERATIONS: usize = 25;
/// Step of `ln w` and of zeta at which a mode is found.
const FOUND: f64 = 1e-9;
/// Largest step of `ln w` and of zeta in one iteration.
const LARGEST: f64 = 0.2;
/// Largest change of `ln w` from one amplitude to the next: beyond it the way is taken in smaller steps, so that no other mode is reached by a leap.
const APART: f64 = 0.1;
/// The same from a linear mode, where no smaller step is left: a law may have no small-signal limit (friction without presliding, a spring on one side).
const LEAP: f64 = 0.5;
/// Damping ratio from which a motion does not swing.
const CRITICAL: f64 = 1.0;
/// Smallest step of `ln X` between two amplitudes.
const SMALLEST: f64 = 1e-2;
/// Factor by which an iteration must bring the force down for its derivatives to serve once more.
const FAST: f64 = 0.3;
/// Steps of the differences with respect to `ln w` and zeta: one-sided for an iteration, central for slopes.
const DIFFERENCE: [f64; 2] = [1e-5, 1e-4];

impl<'a> Backbone<'a> {
    /// Modes whose amplitude is that of the displacement `row` (degrees of freedom with factors), from the linear mode `which`. `bound`: taken apart
    /// ([`Bound::apart`]).
    ///
    /// # Errors
    /// [`EngineError::Request`] for parts that turn far, and for loads that stay; [`EngineError::NoNonlinearMode`] where the model has no such mode.
    pub fn new(model: &'a Model, bound: &'a Bound, row: &[(usize, f64)], which: Which, settings: Settings) -> Result<Self, EngineError> {
        if model.space.is_some() || !bound.loads.is_empty() {
            return Err(EngineError::Request {
                what: "a backbone test of parts that turn far, or under loads that stay,",
                value: "not computed".into(),
                accepted: "a model along axes without loads; modal, cycle or transient tests of this one".into(),
            });
        }
        let linear = start::linear(model, bound, row, which)?;
        super::check(model, &[linear[0].exp()], 0, &[], &[], settings)?;
        let kept = Kept { row: row.to_vec(), amplitude: 1.0, damping: linear[1] };
        let drive = Drive { kept: Some(kept), ..Drive::default() };
        let balance = Balance::new(model, bound, drive, &[], settings)?;
        let last = Point { amplitude: 0.0, at: linear };
        Ok(Backbone { balance, model, which, last, before: None, scale: 1.0, creeps: false })
    }

    /// The mode at an amplitude [m or rad], not below the one before. It begins where the last two amplitudes lead; where that fails, or leads far off, smaller steps
    /// of the amplitude are taken, for the first one from the linear mode.
    ///
    /// # Errors
    /// [`EngineError::NoNonlinearMode`] where there is no such motion, or none that oscillates.
    pub fn at(&mut self, amplitude: f64, sensitivities: bool) -> Result<NonlinearMode, EngineError> {
        let refuse = |why: &str| EngineError::NoNonlinearMode { why: why.into() };
        self.creeps = false;
        let mut point = self.step(self.last, amplitude, APART)?;
        if point.is_none() {
            point = self.in_steps(amplitude)?;
        }
        if point.is_none() && self.last.amplitude == 0.0 {
            point = self.without_friction(amplitude)?;
        }
        let Some(at) = point.filter(|at| at[1].abs() < CRITICAL) else {
            return Err(refuse(match self.creeps || point.is_some() {
                true => "its motion is overdamped: it does not swing",
                false => "no periodic motion of it was found from the amplitude before",
            }));
        };
        if self.last.amplitude > 0.0 && amplitude > self.last.amplitude {
            self.before = Some(self.last);
        }
        self.last = Point { amplitude, at };
        let omega = at[0].exp();
        let slopes =
            if sensitivities { self.slopes(at, amplitude).ok_or_else(|| refuse("its derivatives are not finite"))? } else { vec![] };
        Ok(NonlinearMode { frequency_hz: omega / std::f64::consts::TAU, damping: at[1], slopes })
    }

    /// The motion of the mode found last: its circular frequency [rad/s], and the displacements of all degrees of freedom as complex amplitudes [m or rad],
    /// harmonic by harmonic from the mean.
    ///
    /// # Errors
    /// Those of the balance.
    pub fn motion(&mut self) -> Result<(f64, Vec<Vec<Complex64>>), EngineError> {
        let Point { at, amplitude } = self.last;
        self.force(at, amplitude)?;
        let n = self.balance.structure.n;
        let moving = self.balance.moving();
        let of = |k: usize| if moving.contains(&k) { self.balance.motion(k) } else { vec![Complex64::ZERO; n] };
        Ok((at[0].exp(), (0..=self.balance.harmonics).map(of).collect()))
    }

    /// The way to an amplitude in steps of `ln X`, halved where one fails or leads far off.
    fn in_steps(&mut self, amplitude: f64) -> Result<Option<Vector2<f64>>, EngineError> {
        let mut here = self.last;
        if here.amplitude == 0.0 {
            let small = SMALL * amplitude;
            let Some(at) = self.step(here, small, LEAP)? else { return Ok(None) };
            here = Point { amplitude: small, at };
        }
        let mut length = 0.5 * (amplitude / here.amplitude).ln();
        while here.amplitude < amplitude {
            let next = f64::min(here.amplitude * length.exp(), amplitude);
            match self.step(here, next, APART)? {
                Some(at) => {
                    here = Point { amplitude: next, at };
                    length *= 1.5;
                }
                None if length < SMALLEST => return Ok(None),
                None => length *= 0.5,
            }
        }
        Ok(Some(here.at))
    }

    /// The mode at an amplitude from that of the structure without its friction: what slips there may damp beyond the critical damping where it begins to slip, so
    /// that no way leads there from small amplitudes.
    fn without_friction(&mut self, amplitude: f64) -> Result<Option<Vector2<f64>>, EngineError> {
        let Some(kept) = &self.balance.drive.kept else { return Ok(None) };
        let Ok(at) = start::without_friction(self.model, self.balance.structure.bound, &kept.row, self.which) else { return Ok(None) };
        self.step(Point { amplitude: 0.0, at }, amplitude, LEAP)
    }

    /// The mode at an amplitude from another one; `None` where there is none, or where its `ln w` is farther off than `apart`.
    fn step(&mut self, from: Point, amplitude: f64, apart: f64) -> Result<Option<Vector2<f64>>, EngineError> {
        let mut start = from.at;
        if let Some(before) = self.before.filter(|b| b.amplitude < from.amplitude && from.amplitude == self.last.amplitude) {
            let ahead = (amplitude / from.amplitude).ln() / (from.amplitude / before.amplitude).ln();
            if ahead <= 2.0 {
                start += (from.at - before.at) * ahead;
            }
        }
        let found = match self.mode(start, amplitude) {
            Err(EngineError::GivenUp) => return Err(EngineError::GivenUp),
            found => found.ok().flatten(),
        };
        Ok(found.filter(|at| (at[0] - from.at[0]).abs() <= apart))
    }

    /// Newton's method for `F(ln w, zeta) = 0` at an amplitude; `None` where it does not converge.
    fn mode(&mut self, start: Vector2<f64>, amplitude: f64) -> Result<Option<Vector2<f64>>, EngineError> {
        let mut at = start;
        let mut force = self.force(at, amplitude)?;
        let mut slopes: Option<Matrix2<f64>> = None;
        for _ in 0..ITERATIONS {
            let (fresh, matrix) = match slopes {
                Some(matrix) => (false, matrix),
                None => (true, self.by_mode(at, force, amplitude)?),
            };
            let Some(mut step) = matrix.try_inverse().map(|inverse| -(inverse * force)).filter(|s| s.iter().all(|x| x.is_finite())) else {
                return Ok(None);
            };
            let size = step.amax();
            if size > LARGEST {
                step *= LARGEST / size;
            }
            if size <= FOUND {
                return Ok(Some(at + step));
            }
            let mut length = 1.0;
            let next = loop {
                let next = at + step * length;
                match self.force(next, amplitude) {
                    Ok(f) if f.norm() < force.norm() => break Some((next, f)),
                    Err(EngineError::GivenUp) => return Err(EngineError::GivenUp),
                    _ if length < 0.1 || !fresh => break None,
                    _ => length *= 0.5,
                }
            };
            match next {
                // No mode that is looked for lies beyond.
                Some((next, _)) if next[1].abs() > CRITICAL + LARGEST => {
                    self.creeps = true;
                    return Ok(None);
                }
                Some((next, f)) => {
                    // Broyden's step: the derivatives follow what the force did.
                    let moved = next - at;
                    let better = matrix + (f - force - matrix * moved) * moved.transpose() / moved.norm_squared();
                    slopes = (f.norm() <= FAST * force.norm()).then_some(better);
                    (at, force) = (next, f);
                }
                // Rounding ends the descent.
                None if fresh => return Ok((size <= 1e3 * FOUND).then_some(at)),
                None => slopes = None,
            }
        }
        Ok(None)
    }

    /// Force that the place needs, real and imaginary part, in parts of a spring force at the amplitude.
    fn force(&mut self, at: Vector2<f64>, amplitude: f64) -> Result<Vector2<f64>, EngineError> {
        if parallel::given_up() {
            return Err(EngineError::GivenUp);
        }
        let omega = at[0].exp();
        let balance = &mut self.balance;
        if let Some(kept) = &mut balance.drive.kept {
            // The motion grows with the amplitude: it is where the balance begins.
            if kept.amplitude != amplitude {
                balance.x *= amplitude / kept.amplitude;
            }
            (kept.amplitude, kept.damping) = (amplitude, at[1]);
        }
        balance.hold(omega)?;
        let missing = balance.missing_force();
        if self.scale == 1.0 {
            self.scale = balance.structure.spring_stiffness().max(f64::MIN_POSITIVE);
        }
        let f = missing / (self.scale * amplitude);
        Ok(Vector2::new(f.re, f.im))
    }

    /// Derivatives of the force with respect to `ln w` and zeta, one-sided.
    fn by_mode(&mut self, at: Vector2<f64>, force: Vector2<f64>, amplitude: f64) -> Result<Matrix2<f64>, EngineError> {
        let h = DIFFERENCE[0];
        let mut column = |by: Vector2<f64>| self.force(at + by, amplitude).map(|f| (f - force) / h);
        let columns = [column(Vector2::new(h, 0.0))?, column(Vector2::new(0.0, h))?];
        Ok(Matrix2::from_columns(&columns))
    }

    /// Derivatives of frequency and damping with respect to the free parameters; `None` where they are not finite.
    fn slopes(&mut self, at: Vector2<f64>, amplitude: f64) -> Option<Vec<[f64; 2]>> {
        let h = DIFFERENCE[1];
        let mut column = |by: Vector2<f64>| Some((self.force(at + by, amplitude).ok()? - self.force(at - by, amplitude).ok()?) / (2.0 * h));
        let matrix = Matrix2::from_columns(&[column(Vector2::new(h, 0.0))?, column(Vector2::new(0.0, h))?]);
        let inverse = matrix.try_inverse()?;
        self.force(at, amplitude).ok()?;
        let by_parameters = self.balance.missing_force_slopes().ok()?;
        let unit = self.scale * amplitude;
        let frequency = at[0].exp() / std::f64::consts::TAU;
        let slope = |f: Complex64| {
            let d = -(inverse * Vector2::new(f.re / unit, f.im / unit));
            [frequency * d[0], d[1]]
        };
        let slopes: Vec<[f64; 2]> = by_parameters.into_iter().map(slope).collect();
        slopes.iter().flatten().all(|s| s.is_finite()).then_some(slopes)
    }
}

impl Balance<'_> {
    /// Solves the balance of a motion that is kept at a place, from the displacements at hand, else from those of the linear structure.
    fn hold(&mut self, omega: f64) -> Result<(), EngineError> {
        self.nearest = None;
        self.condense(omega)?;
        if self.m() == 0 {
            return Ok(());
        }
        let mut residual = f64::INFINITY;
        if self.x.amax() > 0.0 && self.newton(1.0, &mut residual) {
            return Ok(());
        }
        self.linear_start();
        if self.newton(1.0, &mut residual) || self.on_a_kink() || self.raise_force(&mut residual) {
            return Ok(());
        }
        Err(if parallel::given_up() { EngineError::GivenUp } else { self.failed(residual) })
    }

    /// Force that the place needs for its first harmonic at the motion found last.
    fn missing_force(&self) -> Complex64 {
        let Some(kept) = &self.drive.kept else { return Complex64::ZERO };
        let forces = (0..self.m()).map(|a| (self.structure.nonlinear[a], self.out_of_line(a, 1)));
        self.structure.missing(kept, &self.flex[1], forces)
    }

    /// Derivatives of [`Balance::missing_force`] with respect to the free parameters at held frequency and damping.
    fn missing_force_slopes(&mut self) -> Result<Vec<Complex64>, EngineError> {
        let sources = self.sources()?;
        let answers = self.answers(&sources);
        let Some(kept) = &self.drive.kept else { return Ok(vec![]) };
        let by = |theta: usize| {
            let own = sources.iter().filter(|s| s.harmonic == 1 && s.parameter == theta).map(|s| (s.element, s.force));
            let answered = (0..self.m()).map(|a| (self.structure.nonlinear[a], self.answered(a, 1, &answers, theta)));
            self.structure.held_force(kept, &self.flex[1], 0.0, own.chain(answered))
        };
        Ok((0..self.structure.bound.n_free).map(by).collect())
    }
}
