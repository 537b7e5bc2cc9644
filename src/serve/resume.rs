//! Runs that were stopped or killed, gone on with.

use crate::limits;
use crate::study::run::{RunFolder, is_run};
use crate::work::Failure;

use super::bench::{Loaded, ROOT};
use super::order::{ORDER, ORDER_BYTES, Order};

/// The order with which a run is gone on with: its own where it holds one, else that of its verb on the study.
///
/// # Errors
/// Where there is no such run, it has come to its end, or nothing of it was kept.
pub fn goes_on(loaded: &Loaded, run: &str) -> Result<Order, Failure> {
    let refused = |message: &str| Failure::new("serve", run, message, "a run that was stopped or killed");
    let of = |verb: &str, model: &str| Order { verb: verb.into(), model: model.into(), resume: Some(run.into()), ..Order::default() };
    match loaded.stopped(run) {
        // A ladder is climbed again from where it began.
        Some(verb) if verb == "ladder" => {
            if !RunFolder::at(loaded.runs().join(run)).journal().is_file() {
                return Err(refused("its folder holds no fits to go on with: an earlier version of misfit has written it"));
            }
            let (model, order) = loaded.made_by(run);
            return Ok(Order { resume: Some(run.into()), ..order.unwrap_or_else(|| of(&verb, &model)) });
        }
        Some(verb) => return Ok(of(&verb, run)),
        None => {}
    }
    let Some(open) = loaded.unfinished().into_iter().find(|u| u.id == run && is_run(run)) else {
        return Err(refused("there is no such run, or it has come to its end"));
    };
    let file = loaded.runs().join(run).join(ORDER);
    if let Ok(bytes) = limits::bytes(&file, ORDER_BYTES) {
        let order: Order = serde_json::from_slice(&bytes).map_err(|e| refused(&format!("its order cannot be read: {e}")))?;
        return Ok(Order { resume: Some(run.into()), ..order });
    }
    match open.verb.as_str() {
        "fit" | "ladder" if open.goes_on => Ok(of(&open.verb, ROOT)),
        _ => Err(refused("nothing of it was kept")),
    }
}
