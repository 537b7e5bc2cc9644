//! What the verbs of the command line and the workbench do alike: an error on its way to a person, an effect added with its refits, the
//! folder of a run, profiles and replicates, a new study from files, the library as JSON.

mod add;
mod check;
mod demonstration;
mod export;
mod failure;
mod journal;
mod keep;
mod ladder;
mod library;
pub mod lines;
pub mod new;
mod profiles;
mod replicates;
mod scores;
mod start;
pub mod terminal;

pub use add::{Refitted, Wish, refit, wished};
pub use check::{Checked, check};
pub use demonstration::{Demonstration, demonstrate};
pub use export::{Stand, export};
pub use failure::Failure;
pub use keep::{REPORT, as_it_stands, at_values, json, keep, plain, report, take_over};
pub use ladder::{ladder, model};
pub use library::{curves_json, effect_json, parameter_kind, parameter_unit};
pub use profiles::{Profiled, profiles};
pub use replicates::replicates;
pub use scores::{Scored, ScoredTarget, scored};
pub use start::{started, starts, with_values};
