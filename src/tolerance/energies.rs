//! Energies of the cases as the calibrated model has them under laws in the interference (eqs. 7 and 8), held against the table as ratios
//! to one case and with one scale.

use super::{Cases, ToleranceError};

/// Greatest over least, minus one.
pub fn span(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high / low - 1.0
}

/// The model's energy of one case [J]: at the middle of its interferences, at the least and the greatest, and its standard deviation at
/// the middle from the fit; `slopes` of ln W with respect to the fit's variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicted {
    /// At the mean interference.
    pub middle: f64,
    /// At the ends of the interference.
    pub ends: (f64, f64),
    /// Slopes of ln W at the middle.
    pub slopes: Vec<f64>,
    /// Whether the laws are used beyond the interferences of the tests.
    pub extrapolated: bool,
}

/// One case, predicted and printed.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Name.
    pub case: String,
    /// W_D over that of the reference case.
    pub ratio: f64,
    /// Standard deviation of the ratio from the fit, which is none of the reference's; none where a parameter is open.
    pub std: Option<f64>,
    /// The ratio at the ends of the interference, both cases at the same end: lowest and highest.
    pub interval: (f64, f64),
    /// Printed ratio.
    pub printed: f64,
    /// With the scale [J].
    pub scaled: f64,
    /// Printed energy [J].
    pub energy: f64,
    /// Whether the laws are used beyond the interferences of the tests.
    pub extrapolated: bool,
}

/// All cases.
#[derive(Clone, Debug, PartialEq)]
pub struct Energies {
    /// In the order of the table.
    pub cases: Vec<Prediction>,
    /// The one scale on the model's energies: the geometric mean of printed over computed.
    pub scale: f64,
    /// Root mean square of ln(scaled / printed), as a factor minus one.
    pub error: f64,
    /// Span of the computed energies at the middle, and over all ends.
    pub span: (f64, f64),
    /// Span of the printed energies.
    pub printed_span: f64,
}

impl Energies {
    /// Holds the model's energies against the table. `deviation` gives the standard deviation of a number from its slopes.
    pub fn of(
        cases: &Cases,
        reference: usize,
        predicted: &[Predicted],
        deviation: impl Fn(f64, &[f64]) -> Option<f64>,
    ) -> Result<Energies, ToleranceError> {
        let Some(base) = predicted.get(reference).filter(|_| predicted.len() == cases.cases.len()) else {
            return Err(ToleranceError::TooFew { what: "energies".into(), found: predicted.len(), needed: cases.cases.len() });
        };
        let printed = cases.energies();
        let logs: Vec<f64> = printed.iter().zip(predicted).map(|(w, p)| (w / p.middle).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let scale = mean.exp();
        let error = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt().exp_m1();
        let one = |(k, p): (usize, &Predicted)| {
            let ratio = p.middle / base.middle;
            let slopes: Vec<f64> = p.slopes.iter().zip(&base.slopes).map(|(a, b)| ratio * (a - b)).collect();
            let ends = (p.ends.0 / base.ends.0, p.ends.1 / base.ends.1);
            Prediction {
                case: cases.cases[k].name.clone(),
                ratio,
                std: deviation(ratio, &slopes),
                interval: (ratio.min(ends.0).min(ends.1), ratio.max(ends.0).max(ends.1)),
                printed: printed[k] / printed[reference],
                scaled: scale * p.middle,
                energy: printed[k],
                extrapolated: p.extrapolated,
            }
        };
        let middles: Vec<f64> = predicted.iter().map(|p| p.middle).collect();
        let ends: Vec<f64> = predicted.iter().flat_map(|p| [p.ends.0, p.ends.1]).collect();
        let list = predicted.iter().enumerate().map(one).collect();
        Ok(Energies { cases: list, scale, error, span: (span(&middles), span(&ends)), printed_span: cases.span() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::Case;
    use crate::units::{Dimension, Unit};

    #[test]
    fn ratios_scale_and_error_are_those_by_hand() {
        let case = |name: &str, energy: f64| Case { name: name.into(), values: Default::default(), energy };
        let cases =
            Cases { cases: vec![case("1", 2.0), case("2", 8.0)], units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) };
        let p = |middle: f64| Predicted { middle, ends: (0.9 * middle, 1.2 * middle), slopes: vec![middle], extrapolated: false };
        let e = Energies::of(&cases, 0, &[p(1.0), p(2.0)], |_, s| Some(s[0].abs())).unwrap();
        // Printed over computed: 2 and 4; their geometric mean sqrt 8, ln of each off it by ln(2)/2.
        assert!((e.scale - 8f64.sqrt()).abs() < 1e-14 && (e.error - (0.5 * 2f64.ln()).exp_m1()).abs() < 1e-14);
        assert_eq!((e.cases[1].ratio, e.cases[1].printed, e.printed_span), (2.0, 4.0, 3.0));
        // d ln(W2/W1) = 2 - 1, times the ratio.
        assert_eq!(e.cases[1].std, Some(2.0));
        assert_eq!(e.cases[0].std, Some(0.0));
        assert!(Energies::of(&cases, 0, &[p(1.0)], |_, _| None).is_err());
    }
}
