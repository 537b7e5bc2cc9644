//! Undamped modes, where the search for the damped ones starts.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::blocktri::BlockTriError;
use super::lowest::{Entry, NOTHING, Pencil, eigen};
use super::{Problem, RIGID, Range, Start, modes};

/// Part of a frequency at which laws are as they are at rest.
const SLOW: f64 = 1e-4;
/// Degrees of freedom up to which all modes are computed at once, from full matrices (a third of a second at 300, and 27 times as long at three times as many).
const FULL: usize = 300;
/// Modes in one band of a model that is larger than that, at most: each takes a few solutions of the whole model.
const MOST: usize = 500;

/// Number of modes with a frequency between `low` and `high` [Hz]; of a model with more than 300 degrees of freedom the undamped ones, with the storage stiffness
/// at either end, which takes a time that is linear in its parts.
///
/// # Errors
/// As [`modes`].
pub fn count(model: &Model, bound: &Bound, low: f64, high: f64) -> Result<usize, EngineError> {
    if model.dofs.len() <= FULL {
        return modes(model, bound, Range::Band(low, high), false).map(|found| found.len());
    }
    let mut problem = Problem::new(model, bound, false)?;
    let mut below = |f: f64| {
        let omega = TAU * f.max(SLOW * high);
        problem.pencil(omega)?.below(omega * omega)
    };
    let (up_to, before) = (below(high)?, below(low)?);
    Ok(up_to.saturating_sub(before))
}

/// What undamped modes are made of beside mass and geometric stiffness.
pub(super) struct Undamped {
    omega: f64,
    mass: Vec<Entry>,
    /// Mass at the row of each element.
    inertia: Vec<f64>,
    /// Stiffness there: what it stores.
    stores: Vec<f64>,
}

/// Undamped modes that are wanted: circular frequencies from the first to the second, or at least so many of the lowest.
#[derive(Clone, Copy)]
enum Wanted {
    Between(f64, f64),
    Lowest(usize),
}

impl Problem<'_> {
    /// Undamped modes with the storage stiffness at a frequency of the range, those that may end in it, in the order of their frequencies.
    pub(super) fn starts(&mut self, range: Range) -> Result<Vec<Start>, EngineError> {
        let count = match range {
            Range::Band(low, high) => {
                return self.undamped(TAU * 0.5 * (low + high), Wanted::Between(0.5 * TAU * low, 2.0 * TAU * high));
            }
            Range::Lowest(count) => count,
        };
        // The frequency at which the stiffness is taken comes from a first round.
        let inertia: f64 = self.small.mass.iter().filter(|m| m.0 == m.1).map(|m| m.2).sum();
        self.laws(Complex64::I)?;
        let stiffness: f64 = self.z.iter().map(|z| z.norm()).sum();
        let guess = if inertia > 0.0 && stiffness > 0.0 { (stiffness / inertia).sqrt() } else { 1.0 };
        let middle = |all: &[Start]| all.iter().take(count).map(|s| s.omega).sum::<f64>() / all.len().min(count).max(1) as f64;
        let starts = self.undamped(guess, Wanted::Lowest(count + 2))?;
        let first = middle(&starts);
        self.reference = if first > 0.0 { first } else { guess };
        if self.stands()? { Ok(starts) } else { self.lowest(count + 2) }
    }

    /// Whether stiffness and mass at the frequency of reference are those that the undamped modes found last are of, as those of springs and dampers are.
    fn stands(&mut self) -> Result<bool, EngineError> {
        let Some(last) = self.of.take() else { return Ok(false) };
        let now = self.prepared(self.reference)?;
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-14 * a.abs();
        Ok(now.inertia.iter().zip(&last.inertia).all(|(a, b)| same(*a, *b))
            && now.stores.iter().zip(&last.stores).all(|(a, b)| same(*a, *b)))
    }

    /// At least `count` of the lowest undamped modes, or all, with the stiffness at the frequency that was taken first.
    pub(super) fn lowest(&mut self, count: usize) -> Result<Vec<Start>, EngineError> {
        let starts = self.undamped(self.reference, Wanted::Lowest(count))?;
        self.more = self.small.n > FULL && starts.len() >= count;
        Ok(starts)
    }

    fn undamped(&mut self, omega: f64, wanted: Wanted) -> Result<Vec<Start>, EngineError> {
        if self.small.n > FULL {
            return self.some(omega, wanted);
        }
        let mut all = self.all(omega)?;
        if let Wanted::Between(low, high) = wanted {
            all.retain(|s| s.omega >= low && s.omega <= high);
        }
        Ok(all)
    }

    /// Laws at a frequency, and the mass that they are.
    fn prepared(&mut self, omega: f64) -> Result<Undamped, EngineError> {
        self.laws(Complex64::new(0.0, SLOW * omega))?;
        let slow: Vec<f64> = self.z.iter().map(|z| z.re).collect();
        self.laws(Complex64::new(0.0, omega))?;
        // Laws that are inertial count as mass, and so does what an absorber is softer by than at rest: in their dynamic stiffness they would be
        // negative springs.
        let mut inertia: Vec<f64> = self.small.bound.elements.iter().map(|e| e.inertia()).collect();
        for ((m, z), slow) in inertia.iter_mut().zip(&self.z).zip(&slow) {
            *m += ((slow - (z.re + omega * omega * *m)) / (omega * omega)).max(0.0);
        }
        let mut mass = self.small.mass.clone();
        for (row, m) in self.small.rows.iter().zip(&inertia).filter(|(_, m)| **m != 0.0) {
            row.iter().for_each(|(i, bi)| mass.extend(row.iter().map(|(j, bj)| (*i, *j, m * bi * bj))));
        }
        let stores = self.z.iter().zip(&inertia).map(|(z, m)| (z + omega * omega * m).re).collect();
        Ok(Undamped { omega, mass, inertia, stores })
    }

    /// Stiffness with this part of the elements' dynamic stiffness.
    fn stiffness(&self, undamped: &Undamped, of: fn(Complex64) -> f64) -> Vec<Entry> {
        let mut k = self.small.stiffness.clone();
        for ((row, z), m) in self.small.rows.iter().zip(&self.z).zip(&undamped.inertia) {
            let z = of(z + undamped.omega * undamped.omega * m);
            row.iter().for_each(|(i, bi)| k.extend(row.iter().map(|(j, bj)| (*i, *j, bi * bj * z))));
        }
        k
    }

    /// The undamped structure of a large model.
    fn pencil(&mut self, omega: f64) -> Result<Pencil, EngineError> {
        let undamped = self.prepared(omega)?;
        let layout = self.matrix.layout().clone();
        let mut pencil = Pencil::new(self.stiffness(&undamped, |z| z.re), undamped.mass.clone(), layout.clone());
        // Massless degrees of freedom follow the others; where only damping holds one, its modulus does.
        if !pencil.follows()? {
            pencil = Pencil::new(self.stiffness(&undamped, |z| z.norm()), undamped.mass, layout);
            if !pencil.follows()? {
                return Err(BlockTriError::Singular { dof: pencil.light().unwrap_or(0), pivot: 0.0 }.into());
            }
        }
        Ok(pencil)
    }

    /// Those that are wanted, of a large model.
    fn some(&mut self, omega: f64, wanted: Wanted) -> Result<Vec<Start>, EngineError> {
        let pencil = self.pencil(omega)?;
        let all = pencil.heavy();
        let highest = pencil.highest(all)?;
        self.highest = highest.sqrt();
        if let Some(shape) = pencil.unstable(-NOTHING * highest)? {
            let dof = shape.iter().enumerate().fold((0, 0.0), |m, (d, x)| if x.abs() > m.1 { (d, x.abs()) } else { m }).0;
            return Err(EngineError::Unstable { step: 1, steps: 1, dof: self.small.name(dof) });
        }
        match wanted {
            Wanted::Lowest(count) => pencil.lowest(count, all, highest),
            Wanted::Between(low, high) => {
                let (low, high) = (if low > 0.0 { low * low } else { -NOTHING * highest }, (high * high).min(1.1 * highest));
                let there = pencil.below(high)?.saturating_sub(pencil.below(low)?);
                if there > MOST {
                    return Err(EngineError::Request {
                        what: "the number of modes in the band",
                        value: there.to_string(),
                        accepted: format!("at most {MOST} in a model of more than {FULL} degrees of freedom"),
                    });
                }
                pencil.between(low, high)
            }
        }
    }

    /// All of them, of a small model.
    fn all(&mut self, omega: f64) -> Result<Vec<Start>, EngineError> {
        let undamped = self.prepared(omega)?;
        let n = self.small.n;
        let dense = |entries: &[Entry]| {
            let mut m = DMatrix::<f64>::zeros(n, n);
            entries.iter().for_each(|(i, j, x)| m[(*i, *j)] += x);
            m
        };
        let mass = dense(&undamped.mass);
        let heavy: Vec<usize> = (0..n).filter(|d| mass[(*d, *d)] > 0.0).collect();
        let light: Vec<usize> = (0..n).filter(|d| mass[(*d, *d)] <= 0.0).collect();
        // Massless degrees of freedom follow the others; where only damping holds one, its modulus does.
        let mut k = dense(&self.stiffness(&undamped, |z| z.re));
        let mut inner = k.select_rows(&light).select_columns(&light).cholesky();
        let springs = inner.is_some();
        if !springs {
            k = dense(&self.stiffness(&undamped, |z| z.norm()));
            inner = k.select_rows(&light).select_columns(&light).cholesky();
        }
        let Some(inner) = inner else {
            return Err(BlockTriError::Singular { dof: light.first().copied().unwrap_or(0), pivot: 0.0 }.into());
        };
        let coupling = k.select_rows(&light).select_columns(&heavy);
        let follow = if light.is_empty() { DMatrix::zeros(0, heavy.len()) } else { -inner.solve(&coupling) };
        let mut reduced = k.select_rows(&heavy).select_columns(&heavy) + coupling.transpose() * &follow;
        // With the mass as L L', the shapes are L'^-1 times the eigenvectors of L^-1 K L'^-1.
        let Some(root) = mass.select_rows(&heavy).select_columns(&heavy).cholesky() else {
            return Err(BlockTriError::Singular { dof: heavy.first().copied().unwrap_or(0), pivot: 0.0 }.into());
        };
        let root = root.l();
        let solved = |m: &DMatrix<f64>| root.solve_lower_triangular(m).unwrap_or_else(|| m.clone());
        reduced = solved(&solved(&reduced).transpose());
        let (values, vectors) = eigen(reduced)?;
        self.highest = values.last().map_or(0.0, |e| e.max(0.0)).sqrt();
        let least = values.first().copied().unwrap_or(0.0);
        if -least > (RIGID * self.highest).powi(2).max(NOTHING * self.highest * self.highest) {
            let shape = vectors.column(0);
            return Err(EngineError::Unstable { step: 1, steps: 1, dof: self.small.name(heavy[shape.iamax()]) });
        }
        let shapes = root.transpose().solve_upper_triangular(&vectors).unwrap_or(vectors);
        let mut starts: Vec<Start> = (0..heavy.len())
            .map(|c| {
                let y: DVector<f64> = shapes.column(c).into_owned();
                let inside = &follow * &y;
                let mut shape = vec![0.0; n];
                heavy.iter().zip(y.iter()).chain(light.iter().zip(inside.iter())).for_each(|(d, x)| shape[*d] = *x);
                Start { omega: values[c].max(0.0).sqrt(), shape }
            })
            .collect();
        starts.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        // What a damper holds depends on the frequency.
        self.of = springs.then_some(undamped);
        Ok(starts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Axis, Body, System};

    /// A structure of bodies along x by its connectors, with springs of these stiffnesses and dampers of a thousandth of them.
    fn structure(masses: &[f64], links: &[(usize, usize, f64)]) -> System {
        let name = |k: usize| if k == 0 { "ground".to_string() } else { format!("m{k}") };
        let bodies = (0..=masses.len()).map(|k| match k {
            0 => Body::fixed("ground"),
            k => Body::new(&name(k), masses[k - 1], &[Axis::X]),
        });
        let ends: Vec<(String, String, String)> = links.iter().enumerate().map(|(c, l)| (format!("c{c}"), name(l.0), name(l.1))).collect();
        let ends: Vec<(&str, &str, &str)> = ends.iter().map(|(c, a, b)| (c.as_str(), a.as_str(), b.as_str())).collect();
        let model = Model::joined(bodies.collect::<Vec<_>>(), &ends).unwrap();
        links.iter().enumerate().fold(System::new(model), |system, (c, (_, _, k))| {
            let at = format!("c{c}.x");
            let system = system.and("linear_stiffness", &at, &[("k", *k)]).unwrap();
            system.and("viscous", &at, &[("c", 1e-3 * k)]).unwrap()
        })
    }

    fn bound(system: &System) -> Bound {
        Bound::new(system, &[], "t", &Default::default()).unwrap()
    }

    /// Two equal branches of a chain on the ground, a chain that floats, and bodies without mass between others.
    fn structures() -> Vec<System> {
        let chain = |n: usize, ground: bool| -> Vec<(usize, usize, f64)> {
            (if ground { 0 } else { 1 }..n).map(|k| (k, k + 1, 1e4 * (1.0 + 0.3 * (k as f64).sin()))).collect()
        };
        let branch = |from: usize| (0..30).map(move |k| (if k == 0 { 20 } else { from + k - 1 }, from + k, 2e4));
        let twice: Vec<_> = chain(20, true).into_iter().chain(branch(21)).chain(branch(51)).collect();
        let light: Vec<f64> = (0..60).map(|k| if k % 3 == 1 { 0.0 } else { 0.2 }).collect();
        vec![structure(&[0.1; 80], &twice), structure(&[0.3; 50], &chain(50, false)), structure(&light, &chain(60, true))]
    }

    #[test]
    fn what_is_found_of_a_large_model_is_what_all_modes_of_it_hold() {
        for system in structures() {
            let bound = bound(&system);
            let mut problem = Problem::new(&system.model, &bound, false).unwrap();
            let all = problem.all(100.0).unwrap();
            let top = all.last().unwrap().omega;
            let full = problem.highest;
            // Bands with no mode below them, within the others, and with more than are looked for about one shift.
            let bands = [(0.0, 0.3 * top), (0.4 * top, 0.6 * top), (0.0, 2.0 * top)];
            let wanted = bands.map(|(low, high)| Wanted::Between(low, high)).into_iter().chain([Wanted::Lowest(3), Wanted::Lowest(12)]);
            for wanted in wanted {
                let some = problem.some(100.0, wanted).unwrap();
                assert!(problem.highest >= full * (1.0 - 1e-9) && problem.highest < 1.1 * full, "{} {full}", problem.highest);
                let expected: Vec<&Start> = match wanted {
                    Wanted::Between(low, high) => all.iter().filter(|s| s.omega >= low && s.omega <= high).collect(),
                    Wanted::Lowest(count) => {
                        assert!(some.len() >= count);
                        all.iter().take(some.len()).collect()
                    }
                };
                assert_eq!(some.len(), expected.len());
                for (found, exact) in some.iter().zip(expected) {
                    assert!((found.omega - exact.omega).abs() < 1e-6 * top, "{} {}", found.omega, exact.omega);
                }
            }
        }
    }

    /// The damped modes of a chain of 400 bodies, from starts of either kind.
    #[test]
    fn modes_of_a_chain_of_400_bodies_have_their_closed_form() {
        let (n, k, m) = (400, 3e4, 0.2);
        let links: Vec<_> = (0..n).map(|j| (j, j + 1, k)).collect();
        let system = structure(&vec![m; n], &links);
        let bound = bound(&system);
        let exact = |r: usize| 2.0 * f64::sqrt(k / m) * f64::sin((2 * r + 1) as f64 * std::f64::consts::PI / (4 * n + 2) as f64);
        let found = modes(&system.model, &bound, Range::Lowest(10), false).unwrap();
        let mut more = super::super::Modes::new(&system.model, &bound, Range::Lowest(2), false).unwrap();
        let more = (more.lowest(2).unwrap(), more.lowest(10).unwrap()).1;
        assert_eq!((found.len(), more.len()), (10, 10));
        for (r, (mode, again)) in found.iter().zip(&more).enumerate() {
            let (w, of) = (TAU * mode.frequency_hz, TAU * again.frequency_hz);
            assert!((w / exact(r) - 1.0).abs() < 1e-10 && (of / exact(r) - 1.0).abs() < 1e-10, "{r}: {w} {of} {}", exact(r));
            // c = k / 1000 everywhere: half of w / 1000 of critical damping.
            assert!((mode.damping - 0.5e-3 * w).abs() < 1e-9, "{r}: {}", mode.damping);
        }
        let within = |low: f64, high: f64| (0..n).filter(|r| (low..high).contains(&(exact(*r) / TAU))).count();
        for (low, high) in [(0.0, 20.0), (30.0, 31.0), (50.0, 1000.0)] {
            assert_eq!(count(&system.model, &bound, low, high).unwrap(), within(low, high));
        }
        // 400 modes are found one by one; of more than 500 in a band it is said.
        assert_eq!(modes(&system.model, &bound, Range::Band(20.0, 40.0), false).unwrap().len(), within(20.0, 40.0));
    }

    #[test]
    fn a_large_model_that_is_not_stable_is_refused_and_one_out_of_time_stops() {
        let links: Vec<_> = (0..400).map(|j| (j, j + 1, if j == 200 { -1e4 } else { 1e4 })).collect();
        let system = structure(&[0.1; 400], &links);
        let found = modes(&system.model, &bound(&system), Range::Lowest(3), false);
        assert!(matches!(found, Err(EngineError::Unstable { .. })), "{found:?}");
        let links: Vec<_> = (0..400).map(|j| (j, j + 1, 1e4)).collect();
        let system = structure(&[0.1; 400], &links);
        let over = crate::parallel::Watch { cancel: None, deadline: Some(std::time::Instant::now()) };
        let found = crate::parallel::watched(&over, || modes(&system.model, &bound(&system), Range::Lowest(3), false));
        assert!(matches!(found, Err(EngineError::GivenUp)), "{found:?}");
    }
}
