//! Pictures of mode shapes: the undeformed chain in grey, the deformed one over it, one picture a mode (the paper's Fig. 13).

use num_complex::Complex64;

use crate::model::space::Space;
use crate::model::space::rotation::{V3, add, cross, dot, sub};
use crate::model::{Axis, Model};

use super::chart::{self, Attributes, Chart};

/// Largest displacement drawn, against the length of the chain.
const SWING: f64 = 0.12;
/// Half the width drawn for a part, against the length of the chain.
const HALF: f64 = 0.05;

/// A mode on the chain; the shape's components turn together to where they are largest.
pub fn picture(model: &Model, shape: &[Complex64]) -> Chart {
    let largest = shape.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    let turn = if largest.norm() > 0.0 { largest.conj() / largest.norm() } else { Complex64::from(1.0) };
    let real: Vec<f64> = shape.iter().map(|x| (x * turn).re).collect();
    match &model.space {
        Some(space) => spatial(model, space, &real),
        None => line(model, &real),
    }
}

fn trace((x, y): (Vec<f64>, Vec<f64>), name: &str, colour: &str, width: f64, mode: &str) -> Attributes {
    chart::scatter(x, y, name, mode).set("line", chart::stroke(colour, width)).set("hoverinfo", "skip")
}

/// Bodies along a line at equal distance, displacements across it, one trace an axis.
fn line(model: &Model, shape: &[f64]) -> Chart {
    let mut plot = Chart::new(&chart::linear("body"), &chart::linear("displacement, scaled"));
    let moving: Vec<usize> = (0..model.bodies.len()).filter(|b| !model.bodies[*b].free.is_empty()).collect();
    let number = |b: usize| moving.iter().position(|m| *m == b).map_or(0.0, |k| k as f64 + 1.0);
    plot.add(trace((vec![1.0, moving.len().max(2) as f64], vec![0.0; 2]), "undeformed", chart::GREY, 1.5, "lines"));
    let colours = [chart::LAST, chart::FIRST, chart::OTHERS[0], chart::OTHERS[1], chart::OTHERS[2], chart::OTHERS[3]];
    for axis in Axis::ALL {
        let here: Vec<(usize, f64)> = model.dofs.iter().zip(shape).filter(|(d, _)| d.axis == axis).map(|(d, x)| (d.body, *x)).collect();
        // Translations and rotations have a size each.
        let like = model.dofs.iter().zip(shape).filter(|(d, _)| d.axis.rotational() == axis.rotational());
        let size = like.fold(0.0f64, |m, (_, x)| m.max(x.abs()));
        if here.is_empty() || size <= 0.0 {
            continue;
        }
        let points = here.iter().map(|(b, x)| (number(*b), x / size)).unzip();
        plot.add(trace(points, axis.name(), colours[axis as usize], 2.0, "lines+markers"));
    }
    plot
}

/// Where the picture looks from: the chain lies along the page, z goes up it aslant.
struct View {
    along: V3<f64>,
    across: V3<f64>,
    from: V3<f64>,
}

impl View {
    fn show(&self, p: V3<f64>) -> (f64, f64) {
        let d = sub(p, self.from);
        (1e3 * (dot(d, self.along) + 0.35 * d[2]), 1e3 * (dot(d, self.across) + 0.55 * d[2]))
    }
}

/// A part as it is drawn: its two ends on the chain.
struct Bar {
    part: usize,
    ends: [V3<f64>; 2],
}

/// Parts between their connectors, in the order of the chain; the first and the last reach on to their origins or as far as before.
fn bars(model: &Model, space: &Space) -> Vec<Bar> {
    let chain = |c: usize| {
        let c = &model.connectors[c];
        !model.bodies[c.from].free.is_empty() && !model.bodies[c.to].free.is_empty()
    };
    let links: Vec<usize> = (0..model.connectors.len()).filter(|c| chain(*c)).collect();
    let of = |part: usize| {
        let points: Vec<V3<f64>> = links
            .iter()
            .filter(|c| model.connectors[**c].from == part || model.connectors[**c].to == part)
            .map(|c| space.frames[*c].point)
            .collect();
        let p = &space.parts[part];
        let centre = add(p.origin, p.centre);
        // An end without a connector lies as far from the centre of mass as the other.
        let beyond = |a: V3<f64>| std::array::from_fn(|i| 2.0 * centre[i] - a[i]);
        match points[..] {
            [] => None,
            [a] if links.len() > 1 || p.mass > 0.0 => {
                let first = model.connectors.iter().enumerate().any(|(k, c)| links.contains(&k) && c.from == part);
                Some(if first { [beyond(a), a] } else { [a, beyond(a)] })
            }
            [a] => Some([a, a]),
            [a, b, ..] => Some([a, b]),
        }
    };
    (0..space.parts.len()).filter_map(|part| Some(Bar { part, ends: of(part)? })).collect()
}

/// A spatial model as it lies on a page.
struct Sketch {
    bars: Vec<Bar>,
    view: View,
    /// Length of the chain [m].
    length: f64,
}

impl Sketch {
    /// None of other models.
    fn of(model: &Model) -> Option<Sketch> {
        let bars = bars(model, model.space.as_ref()?);
        let (start, end) = (bars.first()?.ends[0], bars.last()?.ends[1]);
        let reach = sub(end, start);
        let length = dot(reach, reach).sqrt().max(1e-9);
        let along = [reach[0] / length, reach[1] / length, 0.0];
        let view = View { along, across: [-along[1], along[0], 0.0], from: start };
        Some(Sketch { bars, view, length })
    }

    /// Upper and lower side of the parts, from the chain.
    fn sides(&self) -> [V3<f64>; 2] {
        [[0.0, 0.0, -HALF * self.length], [0.0, 0.0, HALF * self.length]]
    }

    /// Factor with which the largest displacement of a corner is drawn as [`SWING`]; `size` is that of one corner.
    fn scale(&self, size: impl Fn(usize, V3<f64>) -> f64) -> f64 {
        let sides = self.sides();
        let corners = self.bars.iter().flat_map(|b| b.ends.iter().flat_map(move |e| sides.map(|s| (b.part, add(*e, s)))));
        let largest = corners.fold(0.0f64, |m, (part, p)| m.max(size(part, p)));
        if largest > 0.0 { SWING * self.length / largest } else { 0.0 }
    }
}

/// Displacement of a point that is fixed to a part.
fn moved(space: &Space, shape: &[f64], part: usize, p: V3<f64>) -> V3<f64> {
    let q = space.coordinates(part, shape);
    let turn = cross([q[3], q[4], q[5]], sub(p, space.parts[part].origin));
    std::array::from_fn(|i| q[i] + turn[i])
}

/// Where the parts of a spatial model lie on a page [mm]: the index of each with its two ends on the chain; empty for other models.
pub fn outline(model: &Model) -> Vec<(usize, [(f64, f64); 2])> {
    let Some(sketch) = Sketch::of(model) else { return vec![] };
    sketch.bars.iter().map(|b| (b.part, b.ends.map(|e| sketch.view.show(e)))).collect()
}

/// A displacement on a page [mm]; the motion is the real part of it times `exp(i phase)`.
pub type Swing = [Complex64; 2];

/// How far the ends of the parts of [`outline`] move in a mode; empty for models that are not spatial.
pub fn swings(model: &Model, shape: &[Complex64]) -> Vec<(usize, [Swing; 2])> {
    let (Some(sketch), Some(space)) = (Sketch::of(model), &model.space) else { return vec![] };
    let parts = [shape.iter().map(|x| x.re).collect::<Vec<f64>>(), shape.iter().map(|x| x.im).collect()];
    let norm = |u: V3<f64>| dot(u, u);
    let scale = sketch.scale(|part, p| parts.iter().map(|s| norm(moved(space, s, part, p))).sum::<f64>().sqrt());
    let swing = |part: usize, p: V3<f64>| -> Swing {
        let rest = sketch.view.show(p);
        let [a, b] = [0, 1].map(|k| sketch.view.show(add(p, moved(space, &parts[k], part, p).map(|u| u * scale))));
        [Complex64::new(a.0 - rest.0, b.0 - rest.0), Complex64::new(a.1 - rest.1, b.1 - rest.1)]
    };
    sketch.bars.iter().map(|b| (b.part, b.ends.map(|e| swing(b.part, e)))).collect()
}

fn spatial(model: &Model, space: &Space, shape: &[f64]) -> Chart {
    let across = chart::linear("across [mm]");
    // One scale in both directions.
    let scaled = chart::axis(&across).set("scaleanchor", "x");
    let mut plot = Chart::new(&chart::linear("along the chain [mm]"), &across).with("yaxis", scaled);
    let Some(sketch) = Sketch::of(model) else { return plot };
    let sides = sketch.sides();
    let scale = sketch.scale(|part, p| {
        let u = moved(space, shape, part, p);
        dot(u, u).sqrt()
    });
    let outline = |scale: f64| -> (Vec<f64>, Vec<f64>) {
        let at = |part: usize, p: V3<f64>| sketch.view.show(add(p, moved(space, shape, part, p).map(|u| u * scale)));
        let mut points = vec![];
        for b in &sketch.bars {
            let [a, c] = b.ends;
            let corner = |e: V3<f64>, s: usize| at(b.part, add(e, sides[s]));
            points.extend([corner(a, 0), corner(a, 1), corner(c, 1), corner(c, 0), corner(a, 0), (f64::NAN, f64::NAN)]);
        }
        points.into_iter().unzip()
    };
    plot.add(trace(outline(0.0), "undeformed", "#b5b5b5", 1.0, "lines"));
    plot.add(trace(outline(scale), "deformed", chart::LAST, 1.6, "lines"));
    plot
}
