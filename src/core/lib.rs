//! What `misfit` computes: data, effects, the model and its engines, identification, the search, studies, predictions and trials.
//!
//! The package `misfit` exports every module of this one as its own and adds what is done with results: reports, exports, campaigns, the workbench, the command line; a program uses
//! that one. This is a package of its own so that Cargo compiles it for speed and the rest for build time.
//!
//! The modules stand in the order of the flow; a file imports only from modules above its own (`tests` of `misfit` checks it).

pub mod explain;
pub mod limits;
pub mod units;
pub mod parallel;
pub mod data;
pub mod effect;
pub mod model;
pub mod engine;
pub mod response;
pub mod identify;
pub mod residual;
pub mod evidence;
pub mod diagnose;
pub mod tolerance;
pub mod study;
pub mod simulate;
pub mod predict;
pub mod trial;
