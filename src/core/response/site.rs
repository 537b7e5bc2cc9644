//! Where a channel sits on the model.

use crate::data::Control;
use crate::engine::march::{Loads, Probe};
use crate::model::{Model, ModelError};

use super::ResponseError;

/// A resolved `at`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seat {
    /// A body's degree of freedom.
    Dof(usize),
    /// A connector's axis.
    Place(usize),
}

/// Resolves `m8.x` or `c1.x`.
pub fn seat(model: &Model, at: &str) -> Result<Seat, ModelError> {
    if let Some(dof) = model.dof(at) {
        return Ok(Seat::Dof(dof));
    }
    match model.places_at(at) {
        Ok(places) if places.len() == 1 => Ok(Seat::Place(places[0])),
        _ => {
            let dofs = (0..model.dofs.len()).map(|d| model.dof_name(d));
            let places = (0..model.places.len()).map(|p| model.place_name(p));
            Err(ModelError::no_such("place or degree of freedom", at, dofs.chain(places)))
        }
    }
}

/// The driven degree of freedom and the sign of the drive along it.
pub fn driven(model: &Model, at: &str, test: &str) -> Result<(usize, f64), ResponseError> {
    match seat(model, at)? {
        Seat::Dof(dof) => Ok((dof, 1.0)),
        Seat::Place(p) => match (model.places[p].from, model.places[p].to) {
            (None, Some(to)) => Ok((to, 1.0)),
            (Some(from), None) => Ok((from, -1.0)),
            _ => Err(ResponseError::invalid(
                test,
                format!("the drive at `{at}` lies between two bodies that both move"),
                "a drive at a body (`body.axis`), or across a connector one end of which is fixed",
            )),
        },
    }
}

/// Loads over samples of the controlled channel, `(value, velocity, acceleration)` each.
pub fn loads(control: Control, dof: usize, sign: f64, dt: f64, samples: &[[f64; 3]]) -> Loads {
    match control {
        Control::Displacement => {
            let path = samples.iter().map(|s| s.map(|u| sign * u)).collect();
            Loads { dt, prescribed: vec![(dof, path)], forces: vec![] }
        }
        Control::Force => Loads { dt, prescribed: vec![], forces: vec![(dof, samples.iter().map(|s| sign * s[0]).collect())] },
    }
}

/// The probe of an output channel and the sign of its reading.
pub fn probe(
    model: &Model,
    role: crate::data::Role,
    at: &str,
    control: Control,
    driven: (usize, f64),
    test: &str,
) -> Result<(Probe, f64), ResponseError> {
    use crate::data::Role;
    match (role, seat(model, at)?) {
        (Role::Displacement, Seat::Dof(d)) => Ok((Probe::Dof(d), 1.0)),
        (Role::Displacement, Seat::Place(p)) => Ok((Probe::Relative(p), 1.0)),
        (Role::Force, Seat::Place(p)) => Ok((Probe::Force(p), 1.0)),
        (Role::Force, Seat::Dof(d)) if control == Control::Displacement && d == driven.0 => Ok((Probe::Reaction(d), 1.0)),
        (Role::Force, Seat::Dof(_)) => Err(ResponseError::invalid(
            test,
            format!("no force is measured at `{at}`: it is neither driven nor a connector"),
            "the driven body, or a connector's axis",
        )),
        (Role::Velocity, Seat::Dof(d)) => Ok((Probe::Velocity(d), 1.0)),
        (Role::Acceleration, Seat::Dof(d)) => Ok((Probe::Acceleration(d), 1.0)),
        (Role::Velocity | Role::Acceleration, Seat::Place(_)) if model.space.is_some() => Err(ResponseError::invalid(
            test,
            format!("the {} at `{at}` is one between parts that turn", role.word()),
            "a velocity or acceleration of a part (`part.axis`)",
        )),
        (Role::Velocity, Seat::Place(p)) => Ok((Probe::RelativeVelocity(p), 1.0)),
        (Role::Acceleration, Seat::Place(p)) => Ok((Probe::RelativeAcceleration(p), 1.0)),
        _ => Err(ResponseError::invalid(
            test,
            format!("a {} channel is not compared with the model", role.word()),
            "displacement, velocity, acceleration or force",
        )),
    }
}
