//! Shifts of natural frequencies between tests over what "no shift" would be off.

use crate::study::Predicted;

use super::Prediction;

/// One shift that was measured as well.
#[derive(Clone, Debug)]
pub struct Shift {
    /// Test whose modes have shifted.
    pub test: String,
    /// Mode of the table.
    pub mode: u32,
    /// Measured [1].
    pub measured: f64,
    /// Computed [1].
    pub computed: f64,
}

impl Shift {
    /// The shift that a prediction is of; none of another quantity or without a measured one.
    pub fn of(prediction: &Prediction) -> Option<Shift> {
        let (Predicted::Shift { test, mode, .. }, Some(measured)) = (&prediction.spec.quantity, &prediction.spec.reference) else {
            return None;
        };
        Some(Shift { test: test.clone(), mode: *mode, measured: measured.value, computed: prediction.found.value })
    }
}

/// Root mean square error over that of no shift; none where nothing shifts.
pub fn over_none<'a>(shifts: impl Iterator<Item = &'a Shift>) -> Option<f64> {
    let (off, sum) = shifts.fold((0.0, 0.0), |(off, sum), s| (off + (s.computed - s.measured).powi(2), sum + s.measured * s.measured));
    (sum > 0.0).then(|| f64::sqrt(off / sum))
}
