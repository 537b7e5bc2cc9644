//! What tied models disagree on beside the response: a parameter that both have, with two values. Weighing, bending or measuring that one thing decides
//! between them where no test does.

use crate::diagnose::Case;
use crate::diagnose::calibrate::case::Fitted;
use crate::diagnose::calibrate::fit::parameters;
use crate::diagnose::results::ParameterResult;
use crate::diagnose::settings::Settings;

/// The parameter of both models whose two values are farthest apart, z = |a - b| / sqrt(s_a^2 + s_b^2), in words; none where z^2 / 2 does not reach what decides.
pub(super) fn differing(case: &Case, best: &Fitted, rival: (&str, &Fitted), settings: &Settings) -> Option<String> {
    let (here, there) = (parameters(case, best).ok()?.0, parameters(case, rival.1).ok()?.0);
    let (_, here, there) = farthest(&here, &there, settings.decisive)?;
    Some(format!(
        "a measurement of {} itself decides as well: it is {} with what was added and {} with {}",
        here.name, here.printed, there.printed, rival.0
    ))
}

/// z and the parameter in both.
fn farthest<'a>(
    here: &'a [ParameterResult],
    there: &'a [ParameterResult],
    decisive: f64,
) -> Option<(f64, &'a ParameterResult, &'a ParameterResult)> {
    let both = here.iter().filter_map(|a| Some((a, there.iter().find(|b| b.name == a.name)?)));
    let apart = both.filter(|(a, b)| a.identifiable && b.identifiable && !a.at_bound && !b.at_bound);
    let apart = apart.filter_map(|(a, b)| Some(((a.value - b.value).abs() / a.std?.hypot(b.std?), a, b)));
    apart.filter(|(z, ..)| z.is_finite() && 0.5 * z * z > decisive).max_by(|a, b| a.0.total_cmp(&b.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(name: &str, value: f64, std: f64) -> ParameterResult {
        ParameterResult {
            name: name.into(),
            value,
            unit: "N/m".into(),
            std: Some(std),
            interval: (None, None),
            identifiable: true,
            at_bound: false,
            printed: format!("{value} N/m"),
            printed_interval: String::new(),
            note: None,
        }
    }

    /// 10 +- 0.1 and 10.6 +- 0.1 are 4.2 deviations apart, 9 nats; 3 +- 1 and 5 +- 1 are 1.4, one nat; a coefficient of one law alone is no common parameter.
    #[test]
    fn what_both_have_and_disagree_on_is_named() {
        let here =
            [parameter("c1.x.viscous.c", 3.0, 1.0), parameter("c1.x.linear_stiffness.k", 10.0, 0.1), parameter("c1.x.iwan.f", 1.0, 0.1)];
        let mut there = vec![parameter("c1.x.viscous.c", 5.0, 1.0), parameter("c1.x.linear_stiffness.k", 10.6, 0.1)];
        let named = |there: &[ParameterResult]| farthest(&here, there, 8.0).map(|f| f.1.name.clone());
        assert_eq!(named(&there).as_deref(), Some("c1.x.linear_stiffness.k"));
        there[1].identifiable = false;
        assert_eq!(named(&there), None);
        assert_eq!(named(&[parameter("c1.x.linear_stiffness.k", 10.5, 0.1)]), None);
    }
}
