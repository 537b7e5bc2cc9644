//! The laws that are a series of Maxwell branches, as numbers.

use super::{fractional_zener, springpot, structural_damping};

/// `F = strength (spring x + damper v + sum_j weight_j z_j)`, `dz_j/dt = v - rate_j z_j`.
#[derive(Clone, Debug, PartialEq)]
pub struct Prony {
    /// Share of a spring.
    pub spring: f64,
    /// Share of a damper [s].
    pub damper: f64,
    /// Weight and relaxation rate [1/s] of each branch.
    pub branches: Vec<(f64, f64)>,
}

/// The series of an effect with the parameters `p` [SI] (the strength first, which is not used); `None` for an effect that is none.
pub fn prony(effect: &str, p: &[f64]) -> Option<Prony> {
    match (effect, p.len()) {
        ("maxwell", 2) => Some(Prony { spring: 0.0, damper: 0.0, branches: vec![(1.0, 1.0 / p[1])] }),
        ("structural_damping", 4) => Some(structural_damping::prony(p)),
        ("fractional_zener", 3) => Some(fractional_zener::prony(p)),
        ("springpot", 5) => Some(springpot::prony(p)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::effect::{Effect, find};

    #[test]
    fn a_series_is_the_dynamic_stiffness_of_its_law() {
        for (name, p) in [
            ("maxwell", vec![300.0, 0.02]),
            ("structural_damping", vec![50.0, 0.1, 1e3, 4.0]),
            ("fractional_zener", vec![60.0, 0.02, 0.4]),
            ("springpot", vec![80.0, 0.3, 2.0, 0.1, 1e3]),
        ] {
            let series = prony(name, &p).unwrap();
            let Effect::Force(law) = find(name).unwrap() else { panic!("{name}") };
            for w in [0.3, 20.0, 2000.0] {
                let s = Complex64::new(0.0, w);
                let sum: Complex64 = series.branches.iter().map(|(weight, rate)| s * *weight / (s + *rate)).sum();
                let z = (sum + series.spring + s * series.damper) * p[0];
                let exact = law.stiffness(s, &p).unwrap();
                assert!((z - exact).norm() < 1e-12 * exact.norm(), "{name} {w}: {z} {exact}");
            }
        }
        assert_eq!(prony("viscous", &[1.0]), None);
    }
}
