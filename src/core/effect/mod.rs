//! The library of physical effects: one law per file, one list of all.
//!
//! # Sign
//! `x = q_to - q_from`; `F` is the general force on `to` that holds it there, so a spring has `F = +k x` and a damper `F = +c v`.
//! A law written as the force *by* the connector on `to` (`F = -k x`) would be wrong here: it would give back energy.
//!
//! # Strength and null
//! Every force law is `strength * phi(motion; shape)` with states that do not depend on the strength; strength 0 is its absence.
//! Series effects are absent at opening 0, coefficients at exponent 0, a gain at 1.
//!
//! # Adding an effect
//! Write `src/core/effect/<name>.rs` with one of the traits below and add one line to [`LIBRARY`].

pub mod channel;
pub mod coefficient;
pub mod dispatch;
pub mod error;
pub mod formula;
pub mod geometry;
pub mod info;
pub mod num;
pub mod own;
pub mod series;

mod absorber;
mod accelerometer_mass;
mod added_mass;
mod asymmetric_damping;
mod backlash;
mod bilinear_stiffness;
mod bouc_wen;
mod contact;
mod coulomb;
mod cubic_stiffness;
mod curvature;
mod damping_deviation;
mod delay;
mod digressive_damping;
mod drift;
mod elastic_slip;
mod film;
mod fractional_zener;
mod gain;
mod hunt_crossley;
mod inertia_deviation;
mod interference_law;
mod iwan;
mod linear_law;
mod linear_stiffness;
mod load_stiffness;
mod lugre;
mod mass_deviation;
mod maxwell;
mod moving_mass;
mod node_deviation;
mod offset;
mod pinched_bouc_wen;
mod point_offset;
mod power_damping;
mod preload;
mod prony;
mod quadratic_damping;
mod quadratic_stiffness;
mod saturating_stiffness;
mod section_mass;
mod smooth_coulomb;
mod spline;
mod springpot;
mod stiffness_deviation;
mod stribeck;
mod structural_damping;
mod support_compliance;
mod viscous;
mod wedge_friction;

use num_complex::Complex;

pub use channel::{Channel, Moment};
pub use coefficient::{Coefficient, Over};
pub use dispatch::{ForceLaw, Tangent};
pub use error::EffectError;
pub use formula::{Formula, FormulaError};
pub use geometry::{Geometry, Moves};
pub use inertia_deviation::own_motion;
pub use info::{Dim, Grid, Info, Kind, Param, Ports, Role, Scales, Sign};
pub use iwan::limits as iwan_limits;
pub use num::Num;
pub use own::{register, register_force};
pub use prony::{Prony, prony};
pub use series::Series;
pub use spline::FAMILY as SPLINE;

use dispatch::Dispatch;

#[cfg(test)]
mod tests;

/// Motion across a connector's axis at the end of a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs<T> {
    /// Relative displacement `q_to - q_from` [m or rad].
    pub x: T,
    /// Relative velocity [m/s or rad/s].
    pub v: T,
    /// Relative acceleration [m/s2 or rad/s2].
    pub a: T,
    /// Increment of `x` over the step [m or rad].
    pub dx: T,
}

/// A force law: the constitutive update of finite-element practice, generic over the number type.
pub trait Force: Send + Sync + 'static {
    /// What the law says of itself.
    const INFO: Info;
    /// Whether the force is a fixed linear combination of displacement, velocity and acceleration, without states.
    const LINEAR: bool = false;
    /// Whether responses superpose: linear in the motion and its history, so that [`Force::stiffness`] says all at every amplitude.
    const SUPERPOSES: bool = Self::LINEAR;
    /// Whether every state goes on by itself, whatever the others are and never falling with its old value, and the force is one and the
    /// same multiple of the sum of the new ones, `F = w(p) sum_j s_j`: the derivatives with respect to all old states then need one column
    /// in place of one each, `dF/ds_j = w ds_j'/ds_j`.
    const PARALLEL: bool = false;
    /// Number of pairs at the head of the states that hold a quantity at the end of the last step and one step before it, for a rate by the
    /// backward formula; see [`Element::uniform_history`](crate::model::Element::uniform_history).
    const LOOKS_BACK: usize = 0;
    /// Index of a frequency [Hz] that, below 0, is that of the drive in a settled cycle.
    const AT_DRIVE: Option<usize> = None;
    /// Whether it acts where nothing moves and nothing loads the structure: such a force is balanced before small motion is looked at.
    const PRESSES: bool = false;

    /// General force at the end of a step of length `dt` [s]; `s` enters with the states at its start and leaves with those at its
    /// end; `p` stands in the order of `INFO.params`.
    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T;

    /// Dynamic stiffness `F/x` of small motion about rest at the complex frequency `s` [1/s] (`s = i w` on the frequency axis);
    /// friction is stuck. `Err` holds the remedy for a law that has no such limit.
    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str>;
}

/// One entry of the library.
pub enum Effect {
    /// A general force.
    Force(&'static dyn ForceLaw),
    /// An opening in series.
    Series(&'static dyn Series),
    /// A law of a parameter.
    Coefficient(&'static dyn Coefficient),
    /// A law of a measuring channel.
    Channel(&'static dyn Channel),
    /// A law of the geometry.
    Geometry(&'static dyn Geometry),
    /// A general force whose law the study file holds; [`formula::compile`] makes a [`Effect::Force`] of it.
    Formula(&'static Info),
}

impl Effect {
    /// What the effect says of itself.
    pub fn info(&self) -> &'static Info {
        match self {
            Effect::Force(e) => e.info(),
            Effect::Series(e) => e.info(),
            Effect::Coefficient(e) => e.info(),
            Effect::Channel(e) => e.info(),
            Effect::Geometry(e) => e.info(),
            Effect::Formula(info) => info,
        }
    }
}

impl std::fmt::Debug for Effect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.info().name)
    }
}

/// Every effect there is: the parser, the help, the tables, the search for candidates and the tests that hold for all read this list.
pub static LIBRARY: &[Effect] = &[
    Effect::Force(&Dispatch::<linear_stiffness::LinearStiffness>::NEW),
    Effect::Force(&Dispatch::<viscous::Viscous>::NEW),
    Effect::Force(&Dispatch::<maxwell::Maxwell>::NEW),
    Effect::Force(&Dispatch::<structural_damping::StructuralDamping>::NEW),
    Effect::Force(&Dispatch::<springpot::Springpot>::NEW),
    Effect::Force(&Dispatch::<fractional_zener::FractionalZener>::NEW),
    Effect::Force(&Dispatch::<coulomb::Coulomb>::NEW),
    Effect::Force(&Dispatch::<elastic_slip::ElasticSlip>::NEW),
    Effect::Force(&Dispatch::<film::Film>::NEW),
    Effect::Force(&Dispatch::<cubic_stiffness::CubicStiffness>::NEW),
    Effect::Force(&Dispatch::<quadratic_stiffness::QuadraticStiffness>::NEW),
    Effect::Force(&Dispatch::<saturating_stiffness::SaturatingStiffness>::NEW),
    Effect::Force(&Dispatch::<bilinear_stiffness::BilinearStiffness>::NEW),
    Effect::Force(&Dispatch::<contact::Contact>::NEW),
    Effect::Force(&Dispatch::<hunt_crossley::HuntCrossley>::NEW),
    Effect::Force(&Dispatch::<preload::Preload>::NEW),
    Effect::Force(&Dispatch::<quadratic_damping::QuadraticDamping>::NEW),
    Effect::Force(&Dispatch::<power_damping::PowerDamping>::NEW),
    Effect::Force(&Dispatch::<asymmetric_damping::AsymmetricDamping>::NEW),
    Effect::Force(&Dispatch::<digressive_damping::DigressiveDamping>::NEW),
    Effect::Force(&Dispatch::<spline::DisplacementSpline>::NEW),
    Effect::Force(&Dispatch::<spline::VelocitySpline>::NEW),
    Effect::Force(&Dispatch::<smooth_coulomb::SmoothCoulomb>::NEW),
    Effect::Force(&Dispatch::<wedge_friction::WedgeFriction>::NEW),
    Effect::Force(&Dispatch::<stribeck::Stribeck>::NEW),
    Effect::Force(&Dispatch::<lugre::LuGre>::NEW),
    Effect::Force(&Dispatch::<bouc_wen::BoucWen>::NEW),
    Effect::Force(&Dispatch::<pinched_bouc_wen::PinchedBoucWen>::NEW),
    Effect::Force(&Dispatch::<iwan::Iwan>::NEW),
    Effect::Force(&Dispatch::<added_mass::AddedMass>::NEW),
    Effect::Force(&Dispatch::<absorber::Absorber>::NEW),
    Effect::Force(&Dispatch::<stiffness_deviation::StiffnessDeviation>::NEW),
    Effect::Force(&Dispatch::<damping_deviation::DampingDeviation>::NEW),
    Effect::Force(&Dispatch::<mass_deviation::MassDeviation>::NEW),
    Effect::Force(&Dispatch::<inertia_deviation::InertiaDeviation>::NEW),
    Effect::Force(&Dispatch::<node_deviation::NodeDeviation>::NEW),
    Effect::Series(&backlash::Backlash),
    Effect::Series(&support_compliance::SupportCompliance),
    Effect::Coefficient(&interference_law::InterferenceLaw),
    Effect::Coefficient(&linear_law::LinearLaw),
    Effect::Coefficient(&load_stiffness::LoadStiffness),
    Effect::Geometry(&curvature::Curvature),
    Effect::Geometry(&point_offset::PointOffset),
    Effect::Geometry(&section_mass::SectionMass),
    Effect::Channel(&delay::Delay),
    Effect::Channel(&gain::Gain),
    Effect::Channel(&offset::Offset),
    Effect::Channel(&drift::Drift),
    Effect::Channel(&moving_mass::MovingMass),
    Effect::Channel(&accelerometer_mass::AccelerometerMass),
    Effect::Formula(&formula::FORMULA),
];

/// The effect of this name, of the library or registered, or an error with the nearest name.
pub fn find(name: &str) -> Result<&'static Effect, EffectError> {
    let own = own::all();
    LIBRARY.iter().chain(own.iter().map(|o| o.effect)).find(|e| e.info().name == name).ok_or_else(|| {
        let nearest = LIBRARY
            .iter()
            .chain(own.iter().map(|o| o.effect))
            .map(|e| e.info().name)
            .max_by(|a, b| strsim::jaro_winkler(a, name).total_cmp(&strsim::jaro_winkler(b, name)))
            .unwrap_or("");
        EffectError::Unknown { name: name.into(), nearest: nearest.into() }
    })
}
