//! A case fitted and held against its tests: the fit, from afar where it must be, what of it deviates, how likely it is, and where it fails.

pub(in crate::diagnose) mod absurd;
pub(in crate::diagnose) mod approach;
pub(in crate::diagnose) mod case;
pub(in crate::diagnose) mod compare;
pub(in crate::diagnose) mod damping;
pub(in crate::diagnose) mod factors;
pub(in crate::diagnose) mod findings;
pub(in crate::diagnose) mod fit;
pub(in crate::diagnose) mod mode_energy;
pub(in crate::diagnose) mod nearby;
pub(in crate::diagnose) mod own_case;
pub(in crate::diagnose) mod slack;
pub(in crate::diagnose) mod spread;
pub(in crate::diagnose) mod units;
pub(in crate::diagnose) mod weigh;
