//! What the verbs of the command line and the workbench do alike: an error on its way to a person, an effect added with its refits, the
//! folder of a run, the library as JSON.

mod add;
mod demonstration;
mod export;
mod failure;
mod keep;
mod library;

pub use add::{Refitted, Wish, refit, wished};
pub use demonstration::{Demonstration, demonstrate};
pub use export::{Stand, export};
pub use failure::Failure;
pub use keep::{ALL, REPORT, as_it_stands, at_values, json, keep, plain, report};
pub use library::{curves_json, effect_json, parameter_kind, parameter_unit};
