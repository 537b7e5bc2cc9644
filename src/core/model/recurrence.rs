//! The update of a law that superposes, at a fixed step: new states and force are fixed linear combinations of the motion and the old
//! states, found once from the law's own tangent.

use crate::effect::dispatch::{INPUTS, Wanted};
use crate::effect::{ForceLaw, Inputs, Tangent};

/// The update at strength 1.
#[derive(Clone, Debug, Default)]
pub struct Recurrence {
    dt: f64,
    /// Parameters it was made with, the strength as 1.
    p: Vec<f64>,
    /// Force per input and per old state.
    pub force: [f64; INPUTS],
    /// Force per old state.
    pub by_state: Vec<f64>,
    /// New states per input.
    pub input: Vec<[f64; INPUTS]>,
    /// New states per old state: row, column, value.
    pub entries: Vec<(usize, usize, f64)>,
    old: Vec<f64>,
}

impl Recurrence {
    /// Whether a law has one.
    pub fn fits(law: &dyn ForceLaw) -> bool {
        law.superposes() && !law.linear() && law.info().states > 0
    }

    /// Whether it is that of these parameters and this step.
    pub fn is_of(&self, p: &[f64], dt: f64) -> bool {
        self.dt == dt && self.p.len() == p.len() && self.p[1..] == p[1..]
    }

    /// Of a law with the given parameters, whatever its strength.
    pub fn new(law: &dyn ForceLaw, p: &[f64], dt: f64) -> Recurrence {
        let n = law.info().states;
        let (mut p, mut t, mut s) = (p.to_vec(), Tangent::default(), vec![0.0; n]);
        p[0] = 1.0;
        law.tangent(&Inputs::default(), dt, &mut s, &p, Wanted::States, &mut t);
        let of = |row: usize| std::array::from_fn(|k| t.inputs(row)[k]);
        let entries = (0..n).flat_map(|r| t.states(1 + r).iter().copied().enumerate().map(move |(c, v)| (r, c, v)).collect::<Vec<_>>());
        Recurrence {
            dt,
            p,
            force: of(0),
            by_state: t.states(0).to_vec(),
            input: (1..=n).map(of).collect(),
            entries: entries.filter(|e| e.2 != 0.0).collect(),
            old: vec![0.0; n],
        }
    }

    /// Advances the states; the force at strength 1.
    pub fn advance(&mut self, u: &Inputs<f64>, s: &mut [f64]) -> f64 {
        let u = [u.x, u.v, u.a, u.dx];
        let along = |row: &[f64; INPUTS]| row.iter().zip(u).map(|(a, b)| a * b).sum::<f64>();
        let force = along(&self.force) + self.by_state.iter().zip(&*s).map(|(a, b)| a * b).sum::<f64>();
        self.old.copy_from_slice(s);
        s.iter_mut().zip(&self.input).for_each(|(s, row)| *s = along(row));
        self.entries.iter().for_each(|(r, c, v)| s[*r] += v * self.old[*c]);
        force
    }
}

/// Those at hand, by place and number of the law there.
#[derive(Default)]
pub struct Recurrences(Vec<Vec<Recurrence>>);

impl Recurrences {
    /// That of law `k` at a place, made anew where it is of other parameters or another step.
    pub fn of(&mut self, (place, k): (usize, usize), law: &dyn ForceLaw, p: &[f64], dt: f64) -> &mut Recurrence {
        if self.0.len() <= place {
            self.0.resize(place + 1, vec![]);
        }
        let here = &mut self.0[place];
        if here.len() <= k {
            here.resize(k + 1, Recurrence::default());
        }
        if !here[k].is_of(p, dt) {
            here[k] = Recurrence::new(law, p, dt);
        }
        &mut here[k]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Effect, Kind, LIBRARY};

    /// Of every law that superposes, over a path of its own.
    #[test]
    fn it_is_the_law() {
        let mut seen = 0;
        for effect in LIBRARY {
            let Effect::Force(law) = effect else { continue };
            if !Recurrence::fits(*law) {
                continue;
            }
            seen += 1;
            let value = |p: &crate::effect::Param| if p.kind == Kind::Setting { p.default } else { 0.5 };
            let p: Vec<f64> = law.info().params.iter().map(value).collect();
            let dt = 0.01;
            let mut r = Recurrence::new(*law, &p, dt);
            let (mut a, mut b) = (vec![0.0; law.info().states], vec![0.0; law.info().states]);
            let mut last = 0.0;
            for k in 1..60 {
                let t = dt * k as f64;
                let x = (7.0 * t).sin() + 0.2 * t;
                let u = Inputs { x, v: 7.0 * (7.0 * t).cos() + 0.2, a: -49.0 * (7.0 * t).sin(), dx: x - last };
                last = x;
                let (exact, fast) = (law.value(&u, dt, &mut a, &p), p[0] * r.advance(&u, &mut b));
                assert!((exact - fast).abs() < 1e-12 * (1.0 + exact.abs()), "{} {k}: {exact} {fast}", law.info().name);
            }
            assert!(r.is_of(&p, dt) && !r.is_of(&p, 2.0 * dt));
        }
        assert!(seen >= 3, "{seen}");
    }
}
