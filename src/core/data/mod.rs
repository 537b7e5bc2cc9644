//! Measurements: `dataset.toml` beside its files, read strictly, in SI.
//!
//! [`Dataset::load`] reads a dataset with every file it names; [`TimeRecord::settled`] turns a recorded history into a loop with its
//! scatter, [`History::motion`] into displacement, velocity and acceleration; [`Frf`] carries the noise of each line; [`ModalTable`],
//! [`EnergyTable`] and [`BackboneTable`] are tables. Noise comes from cycles, coherence or stated deviations, never from the misfit of a model.

mod arrays;
mod backbone;
mod bench;
mod channel;
mod condition;
mod dataset;
mod error;
mod fourier;
mod frequency;
mod frf;
mod frf_signs;
pub mod frf_estimate;
mod history;
pub mod inspect;
mod loops;
mod modal_families;
pub mod modal_fit;
mod output_only;
pub mod readers;
mod reading;
mod record;
mod sampling;
pub mod schema;
mod tables;
pub mod toml_strict;
pub mod uff;
pub mod written;

pub use backbone::{BackboneRow, BackboneTable};
pub use bench::{Instruments, Rig};
pub use channel::{ChannelSpec, Role, Sigma};
pub use condition::{Condition, Conditions};
pub use dataset::{Dataset, Record, Test, TestKind, schema};
pub use error::{Content, DataError};
pub use fourier::FourierInput;
pub use frequency::{SineFit, estimate as estimate_frequency};
pub use frf::{Frf, FrfQuantity};
pub use frf_signs::{FrfDoubt, frf_doubts};
pub use history::{Derivatives, History, HistoryError, Motion, derivatives, quietest};
pub use loops::{
    Estimate, HARMONICS, LoopChannel, LoopEnergy, LoopError, Note, RecordedArea, SettledLoop, Unsettled, harmonic_of, harmonics,
    recognised_control,
};
pub use modal_families::{OUT_OF_FAMILY, OutOfFamily, out_of_family};
pub use reading::Reading;
pub use record::{Channel, Control, TimeRecord};
pub use tables::{EnergyRow, EnergyTable, ModalTable, ModeRow, StoredEnergy, TableValue};

#[cfg(test)]
mod tests;
