//! The test that would separate tied candidates.

use crate::model::System;
use crate::response::Plan;

use super::candidates::Name;
use super::results::NextTest;

/// Factors on frequency and amplitude of the existing cycle tests that are tried.
const FREQUENCIES: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
const AMPLITUDES: [f64; 5] = [0.1, 0.3, 1.0, 2.0, 3.0];

/// Tries every cycle test at other frequencies and amplitudes and names the one at which the least different rival differs most.
pub fn separating(plans: &[&Plan], best: &System, rivals: &[(Name, System)]) -> Option<NextTest> {
    let mut found: Option<NextTest> = None;
    for plan in plans {
        for f in FREQUENCIES {
            for a in AMPLITUDES {
                let Some((varied, frequency, amplitude)) = plan.varied(f, a) else { continue };
                let Ok(own) = varied.evaluate(best, &[], false) else { continue };
                let mut least = f64::INFINITY;
                for (_, rival) in rivals {
                    let Ok(other) = varied.evaluate(rival, &[], false) else { continue };
                    let chi2: f64 = own.values.iter().zip(&other.values).zip(&varied.sigma).map(|((x, y), s)| ((x - y) / s).powi(2)).sum();
                    least = least.min(chi2.sqrt());
                }
                if least.is_finite() && found.as_ref().is_none_or(|n| least > n.separation) {
                    let printed = plan.drive_unit().map_or_else(|| format!("{amplitude:.4e} (SI)"), |u| u.print_difference(amplitude));
                    let describe = format!(
                        "the drive of test {} at {frequency:.4} Hz with an amplitude of {printed} would separate them by {least:.1} sigma",
                        plan.id
                    );
                    let unit = plan.drive_unit().map(|u| u.dimension.si_unit()).unwrap_or_default();
                    found = Some(NextTest { describe, frequency, amplitude, unit, separation: least });
                }
            }
        }
    }
    found
}
