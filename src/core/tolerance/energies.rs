//! Energies of the cases as a model has them, held against the table: absolute with one declared scale, and as ratios to one case.

use super::{Cases, ToleranceError};

/// Greatest over least, minus one.
pub fn span(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high / low - 1.0
}

/// What is predicted of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Dissipated energy per cycle [J].
    Dissipated,
    /// Equivalent elastic energy per cycle [J].
    Stored,
    /// W_D over that of the reference case.
    Ratio,
}

impl Quantity {
    /// As contract and tables name it.
    pub fn word(self) -> &'static str {
        match self {
            Quantity::Dissipated => "W_D",
            Quantity::Stored => "W_s",
            Quantity::Ratio => "W_D_ratio",
        }
    }
}

/// One number predicted, beside the table's.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Name of the case.
    pub case: String,
    /// Which number.
    pub quantity: Quantity,
    /// Value [J or -].
    pub value: f64,
    /// Standard deviation: of the parameters and of the model's own error together; none where a parameter that matters is open.
    pub std: Option<f64>,
    /// 95 % interval.
    pub interval: Option<(f64, f64)>,
    /// The table's value.
    pub reference: Option<f64>,
    /// Ratio to the reference case predicted without this case; none where it was not left out of anything.
    pub left_out: Option<f64>,
    /// What lies outside the conditions that were tested, and how far.
    pub outside: Option<String>,
}

impl Prediction {
    /// value / reference - 1.
    pub fn relative_error(&self) -> Option<f64> {
        self.reference.filter(|r| *r != 0.0).map(|r| self.value / r - 1.0)
    }

    /// Whether the table's value lies in the interval.
    pub fn holds(&self) -> Option<bool> {
        let ((low, high), r) = (self.interval?, self.reference?);
        Some((low..=high).contains(&r))
    }
}

/// Root mean square of the relative errors of one quantity over all cases but the reference of a ratio, which is 1 by definition.
pub fn rms(predictions: &[Prediction], quantity: Quantity) -> Option<f64> {
    let errors: Vec<f64> = predictions
        .iter()
        .filter(|p| p.quantity == quantity && !(quantity == Quantity::Ratio && p.reference == Some(1.0) && p.value == 1.0))
        .filter_map(Prediction::relative_error)
        .collect();
    (!errors.is_empty()).then(|| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt())
}

/// The index of a case by its name.
pub fn find(cases: &Cases, name: &str) -> Result<usize, ToleranceError> {
    let known = || cases.cases.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    cases.cases.iter().position(|c| c.name == name).ok_or_else(|| ToleranceError::Row {
        place: String::new(),
        case: name.into(),
        message: "the table has no such case".into(),
        accepted: format!("one of {}", known()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_by_hand_and_the_reference_of_a_ratio_is_no_success() {
        let p = |quantity, value: f64, reference: f64, half: f64| Prediction {
            case: "1".into(),
            quantity,
            value,
            std: Some(half / 2.0),
            interval: Some((value - half, value + half)),
            reference: Some(reference),
            left_out: None,
            outside: None,
        };
        let all = [p(Quantity::Ratio, 1.0, 1.0, 0.0), p(Quantity::Ratio, 1.1, 1.0, 0.05), p(Quantity::Dissipated, 3.0, 2.0, 2.0)];
        assert!(
            (rms(&all, Quantity::Ratio).unwrap() - 0.1).abs() < 1e-12 && (rms(&all, Quantity::Dissipated).unwrap() - 0.5).abs() < 1e-12
        );
        assert_eq!((all[1].holds(), all[2].holds()), (Some(false), Some(true)));
        assert_eq!(rms(&all, Quantity::Stored), None);
        assert_eq!(span(&[2.0, 8.0]), 3.0);
    }
}
