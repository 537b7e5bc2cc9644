//! The geometry of a spatial model as parameters: arcs that are bent otherwise, points of parts that lie elsewhere.

use std::borrow::Cow;

use super::rotation::{M3, UNIT, V3, add, product, sub, times, transposed};
use super::{Curve, Frame, Space};
use crate::effect::{Effect, Moves};
use crate::model::graph::{Axis, Connector, Model};
use crate::model::{ModelError, Site, System};

/// Parts that are counted along a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Stem {
    /// Their name without the number.
    pub name: String,
    /// The first of them.
    pub first: usize,
    /// How many there are.
    pub count: usize,
    /// The curve as it is drawn.
    pub curve: Curve,
}

/// What a law of the geometry moves, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// The curve of a stem, by index.
    Stem(usize),
    /// The origin of a part along a fixed axis.
    Point {
        /// The part.
        part: usize,
        /// The axis, x, y or z.
        axis: Axis,
    },
}

/// A motion of a rigid body from one reference position to another.
struct Motion {
    from: V3<f64>,
    to: V3<f64>,
    turn: M3<f64>,
}

impl Motion {
    fn between(old: &Frame, new: &Frame) -> Motion {
        Motion { from: old.point, to: new.point, turn: product(&new.axes, &transposed(&old.axes)) }
    }

    fn point(&self, at: V3<f64>) -> V3<f64> {
        add(self.to, times(&self.turn, sub(at, self.from)))
    }
}

/// Steps to the foot of a perpendicular; each leaves the part of the rest that its distance is of the radius.
const FOOT: usize = 12;

impl Stem {
    /// How far along the curve the point of its `k`-th part lies [m], within that part: the foot of the perpendicular.
    fn beside(&self, k: usize, point: V3<f64>) -> f64 {
        let step = self.curve.length() / self.count as f64;
        let mut s = (k as f64 + 0.5) * step;
        for _ in 0..FOOT {
            let frame = self.curve.frame(s);
            let d = sub(point, frame.point);
            let along = (0..3).map(|i| d[i] * frame.axes[i][1]).sum::<f64>();
            s = (s + along).clamp(k as f64 * step, (k + 1) as f64 * step);
        }
        s
    }

    fn holds(&self, part: usize) -> Option<usize> {
        (self.first..self.first + self.count).contains(&part).then(|| part - self.first)
    }
}

impl Space {
    /// Bends the curve of a stem to `1 + c` times its curvature. Parts move with the middle of their piece of the curve; a point of a part, and a connector
    /// there, with the place of the curve that it lies beside. Axes of connectors to other bodies stay as they are in space.
    fn bend(&mut self, connectors: &[Connector], stem: usize, c: f64) {
        let stem = self.stems[stem].clone();
        let bent = stem.curve.bent(1.0 + c);
        let at = |s: f64| Motion::between(&stem.curve.frame(s), &bent.frame(s));
        let step = stem.curve.length() / stem.count as f64;
        let beside = |k: usize, point: V3<f64>| at(stem.beside(k, point));
        for (connector, frame) in connectors.iter().zip(&mut self.frames) {
            match (stem.holds(connector.from), stem.holds(connector.to)) {
                (Some(a), Some(b)) => {
                    let motion = if a.abs_diff(b) == 1 { at(a.max(b) as f64 * step) } else { beside(a, frame.point) };
                    *frame = Frame { point: motion.point(frame.point), axes: product(&motion.turn, &frame.axes) };
                }
                (Some(k), None) | (None, Some(k)) => frame.point = beside(k, frame.point).point(frame.point),
                (None, None) => {}
            }
        }
        for (k, part) in self.parts[stem.first..stem.first + stem.count].iter_mut().enumerate() {
            let middle = at((k as f64 + 0.5) * step);
            let centre = middle.point(add(part.origin, part.centre));
            part.origin = if part.centre == [0.0; 3] { centre } else { beside(k, part.origin).point(part.origin) };
            part.centre = sub(centre, part.origin);
            part.inertia = product(&product(&middle.turn, &part.inertia), &transposed(&middle.turn));
        }
    }

    /// Makes the parts of a stem heavier by the part `by`.
    fn weigh(&mut self, stem: usize, by: f64) {
        let (first, count) = (self.stems[stem].first, self.stems[stem].count);
        for part in &mut self.parts[first..first + count] {
            part.mass *= 1.0 + by;
            part.inertia.iter_mut().flatten().for_each(|j| *j *= 1.0 + by);
        }
    }

    /// Moves the origin of a part, with every connector that is attached there, by `d` [m] along an axis. The part itself stays where it is.
    fn offset(&mut self, connectors: &[Connector], part: usize, axis: Axis, d: f64) {
        let old = self.parts[part].origin;
        let by = UNIT[axis as usize].map(|e| d * e);
        for (connector, frame) in connectors.iter().zip(&mut self.frames) {
            if (connector.from == part || connector.to == part) && frame.point == old {
                frame.point = add(frame.point, by);
            }
        }
        let part = &mut self.parts[part];
        (part.origin, part.centre) = (add(old, by), sub(part.centre, by));
    }
}

impl Model {
    /// What a law of the geometry moves at `at`.
    ///
    /// # Errors
    /// Names that are not there, and models without arcs or points.
    pub fn outline(&self, moves: Moves, at: &str) -> Result<Outline, ModelError> {
        let Some(space) = &self.space else {
            let message = format!("the geometry at `{at}` cannot be moved: the model has no [[part]], its bodies have no place");
            return Err(ModelError::invalid(at, message, "a model of [[arc]] and [[part]]"));
        };
        match moves {
            Moves::Curvature | Moves::Mass => {
                let named = space.stems.iter().position(|s| s.name == at);
                named
                    .map(Outline::Stem)
                    .ok_or_else(|| ModelError::no_such("chain of parts", at, space.stems.iter().map(|s| s.name.clone())))
            }
            Moves::Point => {
                let (name, axis) = at.rsplit_once('.').ok_or_else(|| {
                    ModelError::invalid(at, format!("`{at}` names no axis"), "a part or a point and an axis, such as `P.y`")
                })?;
                let axis = Axis::parse(axis)?;
                if axis.rotational() {
                    return Err(ModelError::invalid(at, format!("a point does not lie along `{}`", axis.name()), "x, y or z"));
                }
                let part = self.bodies.iter().position(|b| b.name == name);
                let part = part.ok_or_else(|| ModelError::no_such("part", name, self.bodies.iter().map(|b| b.name.clone())))?;
                Ok(Outline::Point { part, axis })
            }
        }
    }
}

impl System {
    /// The system with its parts where its laws of the geometry put them; itself where it has none, or these are at 0.
    pub fn shaped(&self) -> Cow<'_, System> {
        let mut shaped = Cow::Borrowed(self);
        // Points are offset from where the bent arcs carry them.
        for order in [Moves::Curvature, Moves::Point, Moves::Mass] {
            for (k, instance) in self.instances.iter().enumerate() {
                let (Effect::Geometry(law), Site::Outline(outline)) = (instance.effect, &instance.site) else { continue };
                let value = instance.params[0].value;
                if law.moves() != order || value == 0.0 {
                    continue;
                }
                let moved = shaped.to_mut();
                // The moved system has it in its parts, and is not moved again.
                moved.instances[k].params[0].value = 0.0;
                let model = &mut moved.model;
                let Some(space) = &mut model.space else { continue };
                match outline {
                    Outline::Stem(stem) if order == Moves::Mass => space.weigh(*stem, value),
                    Outline::Stem(stem) => space.bend(&model.connectors, *stem, value),
                    Outline::Point { part, axis } => space.offset(&model.connectors, *part, *axis, value),
                }
                for dof in &mut model.dofs {
                    dof.mass = space.parts[dof.body].mass_along(dof.axis as usize);
                }
            }
        }
        shaped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::find;
    use crate::model::space::{Arc, Part, Section};
    use crate::model::{Body, Instance};

    /// A chain of parts on a curve between a hinge and a support, as a study draws it.
    fn drawn(curve: Curve, n: usize) -> System {
        let (mut parts, mut frames) = curve.parts(n, Some(&Section { width: 0.018, thickness: 0.006, density: 3200.0 }));
        let mut bodies: Vec<Body> = (1..=n).map(|k| Body { free: Axis::ALL.to_vec(), ..Body::fixed(&format!("b{k}")) }).collect();
        let mut connectors: Vec<Connector> = (1..n).map(|k| Connector { name: format!("GF{k}"), from: k - 1, to: k }).collect();
        bodies.push(Body::fixed("ground"));
        parts.push(Part { origin: [0.0; 3], centre: [0.0; 3], mass: 0.0, inertia: [[0.0; 3]; 3], dofs: [None; 6] });
        for (name, k, s) in [("pin", 0, 0.0), ("shelf", n - 1, curve.length())] {
            let at = curve.at(s).0;
            let centre = parts[k].origin;
            (parts[k].origin, parts[k].centre) = (at, sub(centre, at));
            connectors.push(Connector { name: name.into(), from: n, to: k });
            frames.push(Frame { point: at, axes: UNIT });
        }
        let stems = vec![Stem { name: "b".into(), first: 0, count: n, curve }];
        System::new(Model::spatial(bodies, connectors, Space { parts, frames, stems }).unwrap())
    }

    fn curve(factor: f64, heading: f64) -> Curve {
        let turn = |radius: f64, angle: f64| Arc::Turn { radius: radius / factor.abs(), angle: angle * factor };
        Curve { start: [0.01, -0.02, 0.0], heading, arcs: vec![turn(0.09, -0.3), turn(0.15, -0.3), turn(0.09, -0.2)] }
    }

    fn with(mut system: System, effect: &str, at: &str, value: f64) -> System {
        let law = find(effect).unwrap();
        let Effect::Geometry(geometry) = law else { panic!("{effect} is no law of the geometry") };
        let site = Site::Outline(system.model.outline(geometry.moves(), at).unwrap());
        let name = law.info().params[0].name;
        system.instances.push(Instance::with_values(law, at, site, &[(name, value)]).unwrap());
        system
    }

    #[test]
    fn a_chain_that_is_bent_is_the_chain_that_is_drawn_so() {
        for c in [-1.4, -1.175, 0.3] {
            let bent = with(drawn(curve(1.0, 2.0), 7), "curvature", "b", c);
            let bent = bent.shaped();
            let (space, old) = (bent.model.space.as_ref().unwrap(), curve(1.0, 2.0).bent(1.0 + c));
            // Drawn anew, in the direction that keeps the line from end to end.
            let anew = drawn(curve(1.0 + c, old.heading), 7);
            let drawn = anew.model.space.as_ref().unwrap();
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
            for (a, b) in space.parts.iter().zip(&drawn.parts) {
                assert!(near(&a.origin, &b.origin) && near(&a.centre, &b.centre), "{c}: {a:?} {b:?}");
                assert!((0..3).all(|i| near(&a.inertia[i], &b.inertia[i])), "{c}: {:?} {:?}", a.inertia, b.inertia);
            }
            for (a, b) in space.frames.iter().zip(&drawn.frames) {
                assert!(near(&a.point, &b.point) && (0..3).all(|i| near(&a.axes[i], &b.axes[i])), "{c}: {a:?} {b:?}");
            }
            let direction = |curve: &Curve| {
                let d = sub(curve.at(curve.length()).0, curve.start);
                d[1].atan2(d[0])
            };
            assert!((direction(&old) - direction(&curve(1.0, 2.0))).abs() < 1e-13);
            // What is moved is not moved again.
            assert_eq!(bent.shaped().model.space, bent.model.space);
        }
        let straight = curve(1.0, 2.0).bent(0.0);
        assert!(
            straight.arcs.iter().all(|a| matches!(a, Arc::Straight(_)))
                && (straight.length() / curve(1.0, 2.0).length() - 1.0).abs() < 1e-14
        );
    }

    #[test]
    fn a_point_moves_with_what_is_attached_to_it_and_the_part_does_not() {
        let plain = drawn(curve(1.0, 2.0), 7);
        let moved = with(plain.clone(), "point_offset", "b1.y", 0.003);
        let moved = moved.shaped();
        let (a, b) = (plain.model.space.as_ref().unwrap(), moved.model.space.as_ref().unwrap());
        let centre = |p: &Part| add(p.origin, p.centre);
        assert!((b.parts[0].origin[1] - a.parts[0].origin[1] - 0.003).abs() < 1e-15);
        assert!(sub(centre(&a.parts[0]), centre(&b.parts[0])).iter().all(|d| d.abs() < 1e-15));
        // The hinge goes with it, the interfaces do not.
        assert!((b.frames[6].point[1] - a.frames[6].point[1] - 0.003).abs() < 1e-15);
        assert_eq!(a.frames[..6], b.frames[..6]);
        let psi = moved.model.dof("b1.psi").unwrap();
        assert!(moved.model.dofs[psi].mass != plain.model.dofs[psi].mass);
    }

    #[test]
    fn what_is_not_there_cannot_be_moved() {
        let system = drawn(curve(1.0, 2.0), 5);
        for (moves, at) in [(Moves::Curvature, "c"), (Moves::Point, "b1"), (Moves::Point, "b1.psi"), (Moves::Point, "b9.x")] {
            assert!(system.model.outline(moves, at).is_err(), "{at}");
        }
        let flat = Model::joined(vec![Body::new("m", 1.0, &[Axis::X]), Body::fixed("ground")], &[("c", "ground", "m")]).unwrap();
        assert!(flat.outline(Moves::Point, "m.x").is_err());
    }
}
