//! Natural modes as the page animates them over the picture of the structure.

use num_complex::Complex64;
use serde_json::{Value, json};

use crate::engine::modal::{Mode, Range, modes};
use crate::model::{Bound, Model};
use crate::report::swings;
use crate::response::Family;
use crate::study::Study;
use crate::work::{Failure, Stand};

/// Modes that are computed, the lowest.
const MOST: usize = 12;

/// The lowest modes of a system at the conditions and loads of a test; without one, of the first test under a load, else of the first.
///
/// # Errors
/// Laws without a small motion, and massless bodies that nothing holds.
pub fn lowest(study: &Study, system: &crate::model::System, test: Option<&str>) -> Result<Value, Failure> {
    let at = Stand::of(study, test)?;
    let system = &*system.shaped();
    let bound = Bound::new(system, &[], &at.test, &at.conditions)?;
    let mut all = modes(&system.model, &bound, Range::Lowest(MOST), false)?;
    all.retain(|m| m.frequency_hz > 0.0 && m.shape.iter().all(|x| x.re.is_finite() && x.im.is_finite()));
    let one = |m: &Mode| {
        json!({
            "frequency": m.frequency_hz, "damping": m.damping, "family": system.model.space.is_some().then(|| Family::of(&system.model, &m.shape).word()),
            "parts": if system.model.space.is_some() { in_space(&system.model, &m.shape) } else { along_axes(&system.model, &m.shape) },
        })
    };
    Ok(json!({ "test": at.test, "conditions": at.described, "modes": all.iter().map(one).collect::<Vec<_>>() }))
}

fn pair(x: Complex64) -> [f64; 2] {
    [x.re, x.im]
}

/// Displacements of the two ends of every part on the page [mm].
fn in_space(model: &Model, shape: &[Complex64]) -> Value {
    let part = |(body, ends): (usize, [[Complex64; 2]; 2])| json!({ "body": body, "ends": ends.map(|e| e.map(pair)) });
    swings(model, shape).into_iter().map(part).collect()
}

/// Displacement of every degree of freedom by its axis, the largest translation and the largest rotation 1.
fn along_axes(model: &Model, shape: &[Complex64]) -> Value {
    let largest = |turning: bool| {
        let like = model.dofs.iter().zip(shape).filter(|(d, _)| d.axis.rotational() == turning);
        like.fold(0.0f64, |m, (_, x)| m.max(x.norm()))
    };
    let sizes = [largest(false), largest(true)];
    let dof = |(d, x): (&crate::model::Dof, &Complex64)| {
        let size = sizes[usize::from(d.axis.rotational())];
        json!({ "body": d.body, "axis": d.axis.name(), "by": pair(if size > 0.0 { x / size } else { Complex64::default() }) })
    };
    model.dofs.iter().zip(shape).map(dof).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Axis, Body, Connector};

    #[test]
    fn the_largest_translation_and_rotation_are_one() {
        let body = |name: &str, free: Vec<Axis>| Body { name: name.into(), mass: 1.0, inertia: 1.0, free };
        let bodies = vec![body("ground", vec![]), body("a", vec![Axis::X, Axis::Psi])];
        let model = Model::new(bodies, vec![Connector { name: "1".into(), from: 0, to: 1 }]).unwrap();
        let parts = along_axes(&model, &[Complex64::new(0.0, 4.0), Complex64::new(-0.5, 0.0)]);
        assert_eq!(parts[0]["by"], json!([0.0, 1.0]));
        assert_eq!(parts[1]["by"], json!([-1.0, 0.0]));
        assert_eq!((parts[1]["axis"].as_str(), parts[1]["body"].as_u64()), (Some("psi"), Some(1)));
    }
}
