//! Where the energy of a mode is: strain energy by place, kinetic energy by body.

use num_complex::Complex64;

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::small::Small;
use super::Mode;

/// Shares of a mode's energies; each kind adds up to 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shares {
    /// Strain energy by place: `Re (z_e(i w) + m_e w^2) |b_e' phi|^2`, over the sum of these and of the geometric stiffness.
    pub strain: Vec<(usize, f64)>,
    /// What the forces present hold by the geometric stiffness; below 0 where they make the structure softer.
    pub geometric: f64,
    /// Kinetic energy by body.
    pub kinetic: Vec<(usize, f64)>,
    /// Kinetic energy of the masses that are effects of a place, `m_e w^2 |b_e' phi|^2`.
    pub carried: Vec<(usize, f64)>,
}

/// The shares of these modes, which are those of `model` and `bound`.
///
/// # Errors
/// As [`modes`](super::modes).
pub fn shares(model: &Model, bound: &Bound, modes: &[Mode]) -> Result<Vec<Shares>, EngineError> {
    let small = Small::new(model, bound, false)?;
    modes.iter().map(|mode| of(model, &small, mode)).collect()
}

fn of(model: &Model, small: &Small<'_>, mode: &Mode) -> Result<Shares, EngineError> {
    // On the frequency axis: there a damper stores nothing, however strongly it damps the mode.
    let (s, phi) = (Complex64::new(0.0, mode.lambda.norm()), &mode.shape);
    let form = |entries: &[(usize, usize, f64)]| entries.iter().map(|(i, j, x)| (phi[*i].conj() * phi[*j]).re * x).sum::<f64>();
    let mut shares = Shares { geometric: form(&small.stiffness), ..Shares::default() };
    for (e, element) in small.bound.elements.iter().enumerate() {
        let (size, m) = (small.relative(e, phi).norm_sqr(), element.inertia());
        let stored = (small.value(e, s)? - s * s * m).re * size;
        if stored != 0.0 {
            shares.strain.push((element.place, stored));
        }
        if m != 0.0 {
            shares.carried.push((element.place, s.norm_sqr() * m * size));
        }
    }
    let mut bodies = vec![0.0; model.bodies.len()];
    for (i, j, m) in &small.mass {
        bodies[model.dofs[*i].body] += s.norm_sqr() * (phi[*i].conj() * phi[*j]).re * m;
    }
    shares.kinetic = bodies.into_iter().enumerate().filter(|b| b.1 > 0.0).collect();
    let total = |list: &[(usize, f64)]| list.iter().map(|e| e.1).sum::<f64>();
    let (strain, kinetic) = (total(&shares.strain) + shares.geometric, total(&shares.kinetic) + total(&shares.carried));
    let over = |list: &mut Vec<(usize, f64)>, sum: f64| list.iter_mut().for_each(|e| e.1 /= if sum > 0.0 { sum } else { f64::INFINITY });
    over(&mut shares.strain, strain);
    shares.geometric /= if strain > 0.0 { strain } else { f64::INFINITY };
    over(&mut shares.kinetic, kinetic);
    over(&mut shares.carried, kinetic);
    Ok(shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::modal::{Range, modes};
    use crate::model::{Axis, Body, System};

    /// Two masses, three springs: the energies of a mode by hand.
    #[test]
    fn shares_of_two_masses_are_those_by_hand() {
        let bodies = vec![Body::new("m1", 2.0, &[Axis::X]), Body::new("m2", 1.0, &[Axis::X]), Body::fixed("ground")];
        let model = Model::joined(bodies, &[("c1", "ground", "m1"), ("c2", "m1", "m2"), ("c3", "m2", "ground")]).unwrap();
        let k = [("c1.x", 100.0), ("c2.x", 40.0), ("c3.x", 70.0)];
        let system = k.iter().fold(System::new(model), |s, (at, k)| s.and("linear_stiffness", at, &[("k", *k)]).unwrap());
        let system = system.and("added_mass", "c3.x", &[("m", 0.5)]).unwrap();
        let bound = Bound::new(&system, &[], "t", &Default::default()).unwrap();
        let found = modes(&system.model, &bound, Range::Lowest(2), false).unwrap();
        let shares = shares(&system.model, &bound, &found).unwrap();
        // [140 - 2 w2, -40; -40, 110 - 1.5 w2]
        let (b, c) = (140.0 * 1.5 + 110.0 * 2.0, 140.0 * 110.0 - 1600.0);
        for (mode, sign) in [(0, -1.0), (1, 1.0)] {
            let w2 = (b + sign * f64::sqrt(b * b - 12.0 * c)) / 6.0;
            assert!((found[mode].lambda.im.powi(2) / w2 - 1.0).abs() < 1e-10);
            let (u1, u2) = (40.0, 140.0 - 2.0 * w2);
            let strain = [100.0 * u1 * u1, 40.0 * f64::powi(u2 - u1, 2), 70.0 * u2 * u2];
            let mass = [2.0 * u1 * u1, u2 * u2, 0.5 * u2 * u2];
            let share = |list: &[(usize, f64)], k: usize| list.iter().find(|e| e.0 == k).map_or(0.0, |e| e.1);
            let (stored, moving) = (strain.iter().sum::<f64>(), mass.iter().sum::<f64>());
            for (place, energy) in strain.iter().enumerate() {
                assert!((share(&shares[mode].strain, place) - energy / stored).abs() < 1e-9, "{mode} {place}: {:?}", shares[mode]);
            }
            for (body, energy) in mass[..2].iter().enumerate() {
                assert!((share(&shares[mode].kinetic, body) - energy / moving).abs() < 1e-9);
            }
            assert!((share(&shares[mode].carried, 2) - mass[2] / moving).abs() < 1e-9);
            // What is stored is what moves.
            assert!((stored / (w2 * moving) - 1.0).abs() < 1e-9);
        }
    }
}
