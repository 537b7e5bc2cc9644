//! What a march takes upon itself where steps are hard: large rotations, or kinks of several laws at once. Here and there a step is, such as
//! where a contact opens; a model that needs it throughout is far from one that stands, and would take a hundred times as long to say so.

use super::super::EngineError;
use super::{March, State};
use crate::parallel;

/// A step is taken in parts down to twice this.
const LEAST_PART: f64 = 0.02;
/// Newton iterations and shortened steps together in one time step, at most, and of a march that has had its share.
const ITERATIONS: usize = 120;
const FEW: usize = 30;
/// What a march may use at any time, and for every step that it has taken. A chain of the paper's size takes 4 to 10 iterations a step.
const HALVINGS: Share = Share { first: 30.0, per_step: 0.05 };
const PATIENCE: Share = Share { first: 1000.0, per_step: 25.0 };

struct Share {
    first: f64,
    per_step: f64,
}

/// What a march has used.
#[derive(Default)]
pub(super) struct Effort {
    steps: usize,
    halvings: usize,
    iterations: usize,
}

impl Effort {
    fn within(&self, used: usize, share: &Share) -> bool {
        used as f64 <= share.first + share.per_step * self.steps as f64
    }

    /// Whether a step that has made so many iterations may make another, which is counted.
    pub fn goes_on(&mut self, iteration: usize) -> bool {
        let most = if self.within(self.iterations, &PATIENCE) { ITERATIONS } else { FEW };
        self.iterations += usize::from(iteration < most);
        iteration < most
    }

    fn may_halve(&self) -> bool {
        self.within(self.halvings, &HALVINGS) && self.within(self.iterations, &PATIENCE)
    }
}

impl March<'_> {
    /// Iterations of Newton's method so far, shortened steps included.
    pub(in crate::engine) fn iterations(&self) -> usize {
        self.effort.iterations
    }

    /// One step, to the loads at index `k`. Where no equilibrium is found at its end, it is taken in halves.
    pub fn step(&mut self, k: usize, state: &mut State, columns: usize) -> Result<(), EngineError> {
        if parallel::given_up() {
            return Err(EngineError::GivenUp);
        }
        self.effort.steps += 1;
        let mut force = std::mem::take(&mut self.force);
        let done = self.parts(k, (0.0, 1.0), state, columns, &mut force);
        self.force = force;
        done
    }

    /// Backward formulas over unlike steps: see [`Element::uniform_history`](crate::model::Element::uniform_history).
    pub(super) fn uniform_history(&self, state: &mut State, columns: usize) {
        let before = std::mem::replace(&mut state.dt, self.dt);
        if before == 0.0 || before == self.dt {
            return;
        }
        for (link, element) in self.links.iter().zip(&self.bound.elements) {
            let own = link.s0..link.s0 + element.n_states();
            let fs = &mut state.fs[link.fs0..link.fs0 + element.n_follower_states()];
            element.uniform_history(self.dt / before, 1, &mut state.s[own.clone()], fs);
            if columns > 0 {
                element.uniform_history(self.dt / before, columns, &mut state.ds[own.start * columns..own.end * columns], &mut []);
            }
        }
    }

    /// From one part of the step to another.
    fn parts(&mut self, k: usize, (from, to): (f64, f64), state: &mut State, columns: usize, force: &mut [f64]) -> Result<(), EngineError> {
        self.dt = (to - from) * self.loads.dt;
        let done = match self.exact.take() {
            Some(exact) => self.advance_exactly(exact, k, (from, to), state, columns),
            None => self.advance(k, to, state, columns, force),
        };
        match done {
            Err(EngineError::NoEquilibrium { .. } | EngineError::NotFinite { .. }) if to - from > LEAST_PART && self.effort.may_halve() => {
                self.effort.halvings += 1;
                state.clone_from(&self.old);
                self.keep = false;
                let middle = 0.5 * (from + to);
                self.parts(k, (from, middle), state, columns, force)?;
                self.parts(k, (middle, to), state, columns, force)
            }
            done => done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_here_and_there_is_admitted_and_throughout_is_not() {
        let of = |steps, halvings| Effort { steps, halvings, iterations: 0 }.may_halve();
        assert!(of(1, 30) && !of(1, 31) && of(4000, 230) && !of(4000, 231));
    }

    #[test]
    fn a_march_that_has_had_its_share_of_iterations_neither_halves_nor_searches_long() {
        let of = |iterations| Effort { steps: 100, halvings: 0, iterations };
        assert!(of(3500).may_halve() && !of(3501).may_halve());
        assert!(of(3500).goes_on(119) && !of(3500).goes_on(120));
        assert!(of(3501).goes_on(29) && !of(3501).goes_on(30));
        let mut effort = of(10);
        assert!(effort.goes_on(5) && effort.iterations == 11);
    }

    /// A ramp behind a compliance beside a damper: the opening grows at a constant rate, and the damper feels the rate that is left. A step
    /// taken in halves, and the one after it, give the same force and the same slopes as whole steps.
    #[test]
    fn a_step_in_halves_leaves_the_rate_of_a_ramp_what_it_is() {
        use crate::effect::find;
        use crate::engine::march::Loads;
        use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};
        let body = |name: &str, free: Vec<Axis>| Body { name: name.into(), mass: 0.0, inertia: 0.0, free };
        let bodies = vec![body("ground", vec![]), body("end", vec![Axis::X])];
        let model = Model::new(bodies, vec![Connector { name: "c1".into(), from: 0, to: 1 }]).unwrap();
        let at = |name: &str, values: &[f64]| {
            let effect = find(name).unwrap();
            let params = effect.info().params.iter().zip(values).map(|(p, v)| ParamValue::free(*v, p.sign)).collect();
            Instance::new(effect, "c1.x", Site::Places(vec![0]), params)
        };
        let (k, c, s, v, dt) = (50.0, 3.0, 0.02, 0.4, 0.05);
        let instances =
            vec![at("linear_stiffness", &[k]), at("viscous", &[c]), at("support_compliance", &[s]), at("film", &[0.3, 0.1, 0.02])];
        let system = System { model, instances };
        let bound = Bound::new(&system, &system.free(), "t", &Default::default()).unwrap();
        let path = (0..=40).map(|k| [v * dt * f64::from(k), v, 0.0]).collect();
        let loads = Loads { dt, prescribed: vec![(0, path)], forces: vec![] };
        let run = |halved: bool| {
            let mut march = March::new(&system.model, &bound, &loads, 1.0).unwrap();
            let columns = bound.n_free;
            let mut state = march.rest(columns);
            let mut all = vec![];
            for step in 1..=40 {
                if halved && step == 38 {
                    let mut force = vec![0.0; 1];
                    march.parts(step, (0.0, 0.5), &mut state, columns, &mut force).unwrap();
                    all.push(march.element_forces(columns));
                    march.parts(step, (0.5, 1.0), &mut state, columns, &mut force).unwrap();
                } else {
                    march.step(step, &mut state, columns).unwrap();
                }
                all.push(march.element_forces(columns));
            }
            all
        };
        let (whole, halved) = (run(false), run(true));
        let between = 0.5 * (whole[36].0[0] + whole[37].0[0]);
        let size = whole[37].0[0];
        assert!((halved[37].0[0] - between).abs() < 1e-4 * size, "{} {between}", halved[37].0[0]);
        for (w, h) in [(37, 38), (38, 39), (39, 40)] {
            assert!((halved[h].0[0] - whole[w].0[0]).abs() < 1e-4 * size, "{w}: {} {}", halved[h].0[0], whole[w].0[0]);
            for (a, b) in halved[h].1.iter().zip(&whole[w].1) {
                assert!((a - b).abs() < 1e-3 * whole[w].1.iter().fold(0.0f64, |m, x| m.max(x.abs())), "{w}: {a} {b}");
            }
        }
    }
}
