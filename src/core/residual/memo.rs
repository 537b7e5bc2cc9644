//! What was computed of a model a moment ago: one that is fitted, weighed and fitted on is asked for at the same values again and again.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use crate::model::{FreeParam, Instance, System};
use crate::response::Computed;

/// Systems that are kept, the last ones: a fit asks for its last few steps.
const KEPT: usize = 6;
/// Relative difference of values that are the same: a logarithm and its exponential come back within a few last bits.
const SAME: f64 = 1e-14;

/// What belongs to the systems of one model's graph that were asked for last.
pub struct Recent<V> {
    kept: Mutex<VecDeque<(Vec<Instance>, V)>>,
}

impl<V> Default for Recent<V> {
    fn default() -> Self {
        Recent { kept: Mutex::default() }
    }
}

impl<V: Clone> Recent<V> {
    /// What is kept of this system and is what is asked for.
    pub fn find(&self, system: &System, is: impl Fn(&V) -> bool) -> Option<V> {
        let kept = self.kept.lock().ok()?;
        kept.iter().find(|(instances, v)| is(v) && alike(instances, &system.instances)).map(|(_, v)| v.clone())
    }

    /// Takes note of what belongs to this system.
    pub fn keep(&self, system: &System, value: V) {
        if let Ok(mut kept) = self.kept.lock() {
            kept.truncate(KEPT - 1);
            kept.push_front((system.instances.clone(), value));
        }
    }
}

/// Responses with sensitivities of one set of tests under one model's graph.
#[derive(Default)]
pub struct Memo {
    kept: Recent<(Vec<FreeParam>, Arc<Vec<Computed>>)>,
}

impl std::fmt::Debug for Memo {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Memo")
    }
}

impl Memo {
    /// The responses of this system with sensitivities to these parameters, if they are known.
    pub fn find(&self, system: &System, free: &[FreeParam]) -> Option<Arc<Vec<Computed>>> {
        self.kept.find(system, |(of, _)| of == free).map(|(_, computed)| computed)
    }

    /// Takes note of them.
    pub fn keep(&self, system: &System, free: &[FreeParam], computed: Arc<Vec<Computed>>) {
        self.kept.keep(system, (free.to_vec(), computed));
    }
}

/// Whether these are the same effects at the same places with the same values.
fn alike(a: &[Instance], b: &[Instance]) -> bool {
    let value = |x: f64, y: f64| x == y || (x - y).abs() <= SAME * x.abs();
    let one = |a: &Instance, b: &Instance| {
        std::ptr::eq(a.effect, b.effect)
            && a.site == b.site
            && a.target == b.target
            && a.only == b.only
            && a.follower == b.follower
            && a.params.len() == b.params.len()
            && a.params.iter().zip(&b.params).all(|(x, y)| value(x.value, y.value))
    };
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| one(a, b))
}
