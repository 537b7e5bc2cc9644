//! `misfit` calibrates models of assembled flexible mechanical systems against measured hysteresis loops and frequency response
//! functions, and finds out what physics the model is missing.
//!
//! The modules stand in the order of the flow; a file imports only from modules above its own (`tests` checks it).

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
pub mod predict;
pub mod trial;
pub mod report;
pub mod export;
pub mod campaign;
pub mod work;
pub mod serve;
pub mod cli;
