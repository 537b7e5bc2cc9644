//! Responses of a system whose geometry is a parameter: the moved model, and its derivatives by central differences.

use crate::effect::Effect;
use crate::model::{FreeParam, System};

use super::{Computed, ResponseError};

/// What `run` computes of the system with its parts where its laws of the geometry put them. `run` gives the derivatives with respect to every other
/// parameter; those of the geometry are differences of two responses each, half a step of the law ([`Geometry::step`](crate::effect::Geometry::step)) to
/// either side.
///
/// # Errors
/// Those of `run`.
pub(super) fn through(
    system: &System,
    free: &[FreeParam],
    sensitivities: bool,
    run: impl Fn(&System, &[FreeParam], bool) -> Result<Computed, ResponseError>,
) -> Result<Computed, ResponseError> {
    let mut computed = run(&system.shaped(), free, sensitivities)?;
    if !sensitivities {
        return Ok(computed);
    }
    for (k, f) in free.iter().enumerate() {
        let Effect::Geometry(law) = system.instances[f.instance].effect else { continue };
        let at = |by: f64| -> Result<Vec<f64>, ResponseError> {
            let mut moved = system.clone();
            moved.instances[f.instance].params[f.param].value += by;
            // Candidates follow the motion and do not act on it; they stand behind the effects of the model.
            moved.instances.retain(|i| !i.follower);
            Ok(run(&moved.shaped(), &[], false)?.values)
        };
        let h = law.step();
        let (up, down) = (at(h)?, at(-h)?);
        for (i, (up, down)) in up.iter().zip(&down).enumerate() {
            computed.slopes[i * free.len() + k] = (up - down) / (2.0 * h);
        }
    }
    Ok(computed)
}
