//! What drives a march, what is observed, and the state it carries.

/// What drives the structure, sampled at the ends of the steps (index 0: the start).
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// Step length [s].
    pub dt: f64,
    /// Degrees of freedom with given displacement, velocity and acceleration.
    pub prescribed: Vec<(usize, Vec<[f64; 3]>)>,
    /// External general forces [N or N m].
    pub forces: Vec<(usize, Vec<f64>)>,
}

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// Displacement of a degree of freedom.
    Dof(usize),
    /// Relative displacement of a place.
    Relative(usize),
    /// Force of a place's element.
    Force(usize),
    /// Force that holds a prescribed degree of freedom, inertia included.
    Reaction(usize),
}

/// State of a march, values and sensitivities. Sensitivity arrays hold one column after the other.
#[derive(Clone, Debug, Default)]
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
    pub(super) g: Vec<f64>,
    /// Sensitivities of the same.
    pub dq: Vec<f64>,
    /// Of the velocities.
    pub dv: Vec<f64>,
    /// Of the accelerations.
    pub da: Vec<f64>,
    /// Of the element states.
    pub ds: Vec<f64>,
    pub(super) dg: Vec<f64>,
}
