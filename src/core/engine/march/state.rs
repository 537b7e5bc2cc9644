//! Where a march stands.

/// State of a march, values and sensitivities. Sensitivity arrays hold a row for every value, in it one entry per column: the derivative of
/// `q[d]` in column `c` is `dq[d * columns + c]`.
#[derive(Debug, Default)]
pub struct State {
    /// Displacements, velocities, accelerations of all degrees of freedom.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Accelerations.
    pub a: Vec<f64>,
    /// States of the elements, one after the other.
    pub s: Vec<f64>,
    /// States of the followers.
    pub fs: Vec<f64>,
    /// Length of the step that led here [s]; 0 at rest.
    pub(in crate::engine) dt: f64,
    /// Auxiliary accelerations of the method.
    pub(in crate::engine) w: Vec<f64>,
    /// Out-of-balance forces: reactions of what is prescribed.
    pub(in crate::engine) g: Vec<f64>,
    /// Sensitivities of the same.
    pub dq: Vec<f64>,
    /// Of the velocities.
    pub dv: Vec<f64>,
    /// Of the accelerations.
    pub da: Vec<f64>,
    /// Of the element states.
    pub ds: Vec<f64>,
    pub(in crate::engine) dw: Vec<f64>,
    pub(in crate::engine) dg: Vec<f64>,
}

impl Clone for State {
    fn clone(&self) -> Self {
        let mut copy = State::default();
        copy.clone_from(self);
        copy
    }

    /// Into the room that is there: it is taken once a step.
    fn clone_from(&mut self, from: &Self) {
        let State { q, v, a, s, fs, dt, w, g, dq, dv, da, ds, dw, dg } = from;
        self.dt = *dt;
        for (to, from) in [
            (&mut self.q, q),
            (&mut self.v, v),
            (&mut self.a, a),
            (&mut self.s, s),
            (&mut self.fs, fs),
            (&mut self.w, w),
            (&mut self.g, g),
            (&mut self.dq, dq),
            (&mut self.dv, dv),
            (&mut self.da, da),
            (&mut self.ds, ds),
            (&mut self.dw, dw),
            (&mut self.dg, dg),
        ] {
            to.clone_from(from);
        }
    }
}

impl State {
    /// What an exact step needs of where it begins; the rest where there is no room for it yet.
    pub(super) fn begin_at(&mut self, from: &Self) {
        if self.dq.len() != from.dq.len() || self.q.len() != from.q.len() {
            return self.clone_from(from);
        }
        let State { q, v, a, s, fs, dt, dq, ds, .. } = from;
        self.dt = *dt;
        let all = [
            (&mut self.q, q),
            (&mut self.v, v),
            (&mut self.a, a),
            (&mut self.s, s),
            (&mut self.fs, fs),
            (&mut self.dq, dq),
            (&mut self.ds, ds),
        ];
        all.into_iter().for_each(|(to, from)| to.clone_from(from));
    }
}
