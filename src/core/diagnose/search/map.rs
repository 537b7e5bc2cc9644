//! The score map: every candidate at every place with what the score test expects of it, without a refit.

use crate::identify::Monitor;
use crate::model::Instance;

use super::refit::best_per_candidate;
use super::step::{Against, Price, survey};
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::case::{Case, Fitted};
use crate::diagnose::calibrate::weigh::Scale;

/// One candidate of the map.
#[derive(Clone, Debug)]
pub struct Mark {
    /// The effect at its null strength, in the shape that scores best.
    pub instance: Instance,
    /// Of a coefficient, the parameter it acts on and the condition.
    pub of: Option<String>,
    /// Fraction of the cost that is expected to fall.
    pub drop: f64,
    /// Probability that the best of all candidates scores as high where nothing is missing.
    pub p_value: f64,
    /// Strength at which the cost is expected to fall so far, as an increment on the null value [SI].
    pub strength: f64,
    /// Nats that it may gain at most, by its score.
    pub bound: f64,
    /// Nats that its parameters and the search cost.
    pub price: f64,
    /// Marks that the score cannot tell from it: their bounds differ by less than a tie. Indices into the map.
    pub tied_with: Vec<usize>,
}

/// Scores all effects at all places on the fit and select tests, the largest expected drop first. The variances are those of `fitted` as it
/// stands: the map is a first look, and the search weighs what it picks from there.
///
/// # Errors
/// As the score test.
pub fn map(case: &Case, fitted: &Fitted, monitor: &Monitor, watch: &(dyn Fn(&str) + Sync)) -> Result<Vec<Mark>, DiagnoseError> {
    let settings = &case.search.settings;
    let mut scale = Scale::new(case, &fitted.system, settings);
    let Some(base) = scale.as_it_stands(fitted) else {
        let reason = "the response of the model is not finite";
        return Err(DiagnoseError::start_fails(reason));
    };
    scale.counts = scale.evidence.counts(&base.seen, &base.v);
    let against = Against {
        scale: &scale,
        base: &base,
        need: None,
        beyond: 0.0,
        stands: None,
        rival: None,
        elsewhere: &[],
        added: vec![],
        monitor,
        watch,
    };
    let found = survey(&against)?;
    let price = Price::new(&against, &found.names, found.squares, &found.scores);
    let mark = |score: &super::score::Score| {
        let trial = &found.trials[score.trial];
        Mark {
            instance: trial.instance.clone(),
            of: found.names[trial.candidate].of.clone(),
            drop: score.drop,
            p_value: score.p_value,
            strength: score.strength,
            bound: price.bound(trial.candidate, score.drop),
            price: price.price(trial.candidate),
            tied_with: vec![],
        }
    };
    let mut marks: Vec<Mark> = best_per_candidate(&found.scores.list, &found.trials).iter().map(mark).collect();
    let bounds: Vec<f64> = marks.iter().map(|m| m.bound).collect();
    for (k, m) in marks.iter_mut().enumerate().filter(|(_, m)| m.bound >= m.price) {
        let close = (0..bounds.len()).filter(|j| *j != k && (bounds[*j] - bounds[k]).abs() < settings.tie);
        m.tied_with = close.take(settings.weighed).collect();
    }
    Ok(marks)
}
