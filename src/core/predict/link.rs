//! The model's energy over one factor on the strengths that carry its loss.

use crate::parallel;
use crate::study::{Predicted, ToleranceSpec};
use crate::tolerance::Link;

use super::cases::{conditions, energies};
use super::{Calibrated, PredictError};

/// Factors at which the model is computed, over that of the calibrated strengths. Below the first the energy goes with the strengths; the last lies beyond
/// the one at which what slides begins to stick in every model that was tried.
const FACTORS: [f64; 10] = [0.1, 0.2, 0.35, 0.6, 1.0, 1.4, 1.9, 2.5, 3.2, 4.0];

/// The link at the conditions of the reference case, and the energy [J] at unchanged strengths there.
pub fn link(spec: &ToleranceSpec, model: &Calibrated) -> Result<(Link, f64), PredictError> {
    let table = spec.tables.first().ok_or_else(|| none("no table"))?;
    let Predicted::Cycle { frequency, .. } = &table.cycle.quantity else { return Err(none("no cycle")) };
    let reference = crate::tolerance::energies::find(&table.cases, &spec.reference)?;
    let at = conditions(spec, table, reference, *frequency);
    let reading = table.stored.unwrap_or(crate::data::StoredEnergy::Slope);
    let scaled: Vec<(usize, usize)> =
        model.free.iter().filter(|f| spec.strengths.contains(&f.name)).map(|f| (f.instance, f.param)).collect();
    let one = |k: usize| -> Result<f64, PredictError> {
        let mut system = model.system.clone();
        for (instance, param) in &scaled {
            system.instances[*instance].params[*param].value *= FACTORS[k];
        }
        let answer = energies(&table.cycle.quantity, reading, vec![(spec.reference.clone(), at.clone())], &system, &[])?;
        answer.first().map(|a| a.dissipated.value).ok_or_else(|| none("no energy"))
    };
    let energies = parallel::over(FACTORS.len(), one).into_iter().collect::<Result<Vec<f64>, _>>()?;
    let unchanged = FACTORS.iter().position(|f| *f == 1.0).map_or(f64::NAN, |k| energies[k]);
    Ok((Link::new(&FACTORS, &energies)?, unchanged))
}

fn none(message: &str) -> PredictError {
    PredictError::Case {
        case: "-".into(),
        message: message.into(),
        accepted: "[tolerance] with a test of cases".into(),
        place: "study.toml".into(),
    }
}
