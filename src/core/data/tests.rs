//! Shared by the tests of the readers.

/// Cases of a damage test: a few, or as many as the environment variable MISFIT_FUZZ says.
pub(super) fn cases(few: u32) -> u32 {
    std::env::var("MISFIT_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}
