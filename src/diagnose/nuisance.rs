//! What every measuring chain may have: a gain, an offset and a delay within the tolerance of good instruments.
//!
//! These stand in the score test as columns with priors, so that a physical effect is scored by what such errors cannot imitate
//! (design.md section 6). Where a channel is itself the suspect, the candidates of role channel say so.

use crate::effect::{Sign, find};
use crate::model::{ChannelSite, Instance, ParamValue, Site};
use crate::response::{BlockKind, Plan};

/// Standard deviation of a gain about 1: calibration of a load cell or an accelerometer.
const GAIN: f64 = 0.005;
/// Standard deviation of an offset, in parts of half the measured range.
const OFFSET: f64 = 0.005;
/// Standard deviation of a delay, in parts of the period of a cycle or of the shortest period of an FRF: a third of a degree.
const DELAY: f64 = 1e-3;

/// A nuisance: the channel effect at its null value, its only free parameter first, and the prior's standard deviation [SI].
pub struct Nuisance {
    /// The instance.
    pub instance: Instance,
    /// Standard deviation about the null value.
    pub sigma: f64,
}

/// Gain, offset and delay of every channel that the plans hold against the model.
pub fn nuisances(plans: &[&Plan]) -> Vec<Nuisance> {
    let mut list = Vec::new();
    for plan in plans {
        for block in plan.blocks.iter().filter(|b| b.kind != BlockKind::Table) {
            let (low, high) = plan.measured[block.range.clone()].iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            let (shortest, longest) = plan.periods();
            let period = if block.kind == BlockKind::Frf { shortest } else { longest };
            let sizes = [("gain", GAIN), ("offset", OFFSET * 0.5 * (high - low)), ("delay", DELAY * period)];
            for (name, sigma) in sizes {
                // An FRF has no offset; a record's longest period is its length, of which a delay is no part.
                if (name == "offset" && block.kind == BlockKind::Frf) || (name == "delay" && block.kind == BlockKind::Record) {
                    continue;
                }
                let Some(effect) = find(name).ok().filter(|_| sigma.is_finite() && sigma > 0.0) else { continue };
                let site = ChannelSite { test: plan.id.clone(), role: block.role.clone() };
                let params = effect.info().params.iter().enumerate();
                let params = params
                    .map(|(k, p)| if k == 0 { ParamValue::free(p.default, Sign::Any) } else { ParamValue::fixed(p.default) })
                    .collect();
                let at = format!("{}.{}", plan.id, block.role);
                let instance = Instance::new(effect, at, Site::Channel(site), params);
                list.push(Nuisance { instance, sigma });
            }
        }
    }
    list
}
