//! `[[arc]]`, `[[part]]`, `[[joint]]`, `[[point]]`: parts that turn far, as declared, and the spatial [`Model`] they make.

use std::collections::HashMap;

use crate::data::toml_strict::{TableView, TomlError, ValueView};
use crate::explain::Explain;
use crate::limits;
use crate::model::space::rotation::{UNIT, sub};
use crate::model::space::{Arc, Curve, Frame, Part, Section, Space, Stem};
use crate::model::{Axis, Body, Connector, Model};
use crate::units::Dimension;

use super::graph::{GROUND, Names, name, unknown_body};

/// The tables of a spatial model.
pub(super) const TABLES: [&str; 4] = ["arc", "part", "joint", "point"];

/// What is read so far.
#[derive(Default)]
struct Made {
    bodies: Vec<Body>,
    parts: Vec<Part>,
    connectors: Vec<Connector>,
    frames: Vec<Frame>,
    /// Line of declaration, for what the model finds wrong.
    tables: HashMap<String, usize>,
    /// First body and count of the parts of a stem along the arcs, with their interfaces.
    chains: HashMap<String, (usize, Vec<Frame>)>,
    stems: Vec<(Stem, Option<Section>)>,
    absent: Vec<(usize, Vec<String>)>,
    attached: Vec<usize>,
}

/// Reads a spatial model.
pub(super) fn read(root: &TableView<'_>) -> Result<Model, TomlError> {
    if let Some(value) = root.get("body") {
        return Err(
            value.refuse("[[body]] does not go with [[part]]", "every body as a [[part]], with `at` where it is not along the arcs")
        );
    }
    let curve = curve(root)?;
    let (mut made, mut names) = (Made::default(), Names::default());
    root.require("part", "[[part]] with name, and count and section along the arcs, or at")?.list()?;
    for table in root.tables("part")? {
        part(&table, curve.as_ref(), &mut made, &mut names)?;
    }
    for table in root.tables("joint")? {
        joint(&table, curve.as_ref(), &mut made)?;
    }
    for table in root.tables("point")? {
        point(&table, curve.as_ref(), &mut made, &mut names)?;
    }
    root.require("connector", "[[connector]] with name and chain, or name, from and to")?.list()?;
    for table in root.tables("connector")? {
        connector(&table, curve.as_ref(), &mut made, &mut names)?;
    }
    let tables = made.tables;
    let model = Model::spatial(
        made.bodies,
        made.connectors,
        Space { parts: made.parts, frames: made.frames, stems: made.stems.into_iter().map(|s| s.0).collect() },
    );
    let mut model = model.map_err(|e| {
        let place = e.place();
        let line = tables.get(place.split('.').next().unwrap_or_default()).copied();
        let all = ["part", "joint", "connector"].iter().flat_map(|t| root.tables(t).unwrap_or_default());
        let table = all.into_iter().find(|t| Some(t.line()) == line).unwrap_or_else(|| root.clone());
        table.refuse(e.to_string(), e.accepted())
    })?;
    (model.absent, model.attached) = (made.absent, made.attached);
    Ok(model)
}

/// Lengths of a point; the third is 0 where it is left out.
fn place(value: &ValueView<'_>) -> Result<[f64; 3], TomlError> {
    let list = value.list()?;
    if !(2..=3).contains(&list.len()) {
        return Err(value.refuse(format!("a point with {} numbers", list.len()), "[\"x\", \"y\"] or [\"x\", \"y\", \"z\"]"));
    }
    let mut at = [0.0; 3];
    for (x, v) in at.iter_mut().zip(&list) {
        *x = v.quantity(Dimension::LENGTH)?.value;
    }
    Ok(at)
}

/// A point, or `start` and `end` of the arcs.
fn place_on(value: &ValueView<'_>, curve: Option<&Curve>) -> Result<[f64; 3], TomlError> {
    if !value.is_string() {
        return place(value);
    }
    let ends = curve.map_or(vec![], |c| vec![("start", 0.0), ("end", c.length())]);
    let s = value.word("place", &ends)?;
    Ok(curve.map_or([0.0; 3], |c| c.at(s).0))
}

fn curve(root: &TableView<'_>) -> Result<Option<Curve>, TomlError> {
    let tables = root.tables("arc")?;
    let mut curve: Option<Curve> = None;
    for (k, table) in tables.iter().enumerate() {
        table.only(&["radius", "angle", "length", "start", "heading"])?;
        let positive = |key: &str| {
            table.optional(key, |v| {
                let q = v.quantity(Dimension::LENGTH)?;
                if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("the {key} of an arc is {q}"), "a length above 0")) }
            })
        };
        let (radius, length) = (positive("radius")?, positive("length")?);
        let angle = table.optional("angle", |v| {
            let q = v.quantity(Dimension::ANGLE)?;
            if q.value != 0.0 {
                Ok(q.value)
            } else {
                Err(v.refuse("an arc without angle", "an angle that is not 0, or length for a straight piece"))
            }
        })?;
        let arc = match (radius, angle, length) {
            (Some(radius), Some(angle), None) => Arc::Turn { radius, angle },
            (None, None, Some(length)) => Arc::Straight(length),
            _ => return Err(table.refuse("the arc is not complete, or given twice", "radius and angle, or length")),
        };
        let start = table.optional("start", |v| place(&v))?;
        let heading = table.optional("heading", |v| v.quantity(Dimension::ANGLE).map(|q| q.value))?;
        match &mut curve {
            None => {
                curve = Some(Curve {
                    start: start.unwrap_or_default(),
                    heading: heading.unwrap_or(std::f64::consts::FRAC_PI_2),
                    arcs: vec![arc],
                })
            }
            Some(c) => {
                let (end, direction) = c.at(c.length());
                let gap = start.map_or(0.0, |s| sub(s, end).iter().map(|x| x * x).sum::<f64>().sqrt());
                let kink = heading.map_or(0.0, |h| {
                    let d = (h - direction).rem_euclid(std::f64::consts::TAU);
                    d.min(std::f64::consts::TAU - d)
                });
                if gap > MEET * c.length() || kink > MEET {
                    let message = format!("arcs {k} and {} do not meet: {:.4} mm and {:.4} deg apart", k + 1, gap * 1e3, kink.to_degrees());
                    let accepted = format!(
                        "start = [\"{:.6} mm\", \"{:.6} mm\"] and heading = \"{:.6} deg\", or neither: an arc begins where the one before ends",
                        end[0] * 1e3,
                        end[1] * 1e3,
                        direction.to_degrees()
                    );
                    return Err(table.refuse(message, accepted));
                }
                c.arcs.push(arc);
            }
        }
    }
    let swept = curve.as_ref().map_or(0.0, Curve::swept);
    if let Some(table) = tables.last().filter(|_| swept >= std::f64::consts::TAU) {
        let message = format!("the arcs turn by {:.1} deg in all: a chain along them meets itself", swept.to_degrees());
        return Err(table.refuse(message, "less than 360 deg"));
    }
    Ok(curve)
}

/// Gap of two arcs against the length before them, and kink [rad], that count as none.
const MEET: f64 = 1e-4;

fn part(table: &TableView<'_>, curve: Option<&Curve>, made: &mut Made, names: &mut Names) -> Result<(), TomlError> {
    table.only(&["name", "count", "section", "modulus", "highest", "at", "free", "fixed", "mass", "inertia"])?;
    let name = name(table)?;
    let value = table.require("name", "a name")?;
    let fixed = table.optional("fixed", |v| v.bool())?.unwrap_or(false);
    let free = match table.get("free") {
        Some(v) if fixed => return Err(v.refuse(format!("part `{name}` is fixed and has free axes"), "one of fixed = true and free")),
        Some(v) => axes(&v)?,
        None if fixed => vec![],
        None => Axis::ALL.to_vec(),
    };
    let positive = |key: &str, dimension| {
        table.optional(key, |v| {
            let q = v.quantity(dimension)?;
            if q.value > 0.0 {
                Ok(q.value)
            } else {
                Err(v.refuse(format!("the {key} of part `{name}` is {q}"), "a value above 0, or no key"))
            }
        })
    };
    let mass = positive("mass", Dimension::MASS)?;
    let inertia = table.optional("inertia", |v| principal(&v))?;
    let density = Dimension::MASS.over(Dimension::LENGTH.power(3));
    let section = table.optional("section", |v| {
        let t = v.table()?;
        t.only(&["width", "thickness", "density"])?;
        let of = |key: &str, dimension| {
            let v = t.require(key, "section = { width = \"20 mm\", thickness = \"9 mm\", density = \"3200 kg/m3\" }")?;
            let q = v.quantity(dimension)?;
            if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("the {key} is {q}"), "a value above 0")) }
        };
        Ok(Section {
            width: of("width", Dimension::LENGTH)?,
            thickness: of("thickness", Dimension::LENGTH)?,
            density: of("density", density)?,
        })
    })?;
    if let (Some(_), Some(v)) = (&section, table.get("mass").or(table.get("inertia"))) {
        return Err(v.refuse("a section gives mass and inertia already", "section, or mass and inertia"));
    }
    let Some(count) = table.get("count") else {
        if let Some(v) = table.get("section") {
            return Err(v.refuse(format!("part `{name}` has a section and no count"), "count along the arcs, or mass and inertia"));
        }
        let at = table.optional("at", |v| place_on(&v, curve))?.unwrap_or_default();
        names.add("part", name.clone(), &value)?;
        made.tables.insert(name.clone(), table.line());
        let inertia = inertia.unwrap_or_default();
        made.bodies.push(Body { name, mass: mass.unwrap_or(0.0), inertia: 0.0, free });
        made.parts.push(Part { origin: at, centre: [0.0; 3], mass: mass.unwrap_or(0.0), inertia: diagonal(inertia), dofs: [None; 6] });
        return Ok(());
    };
    let Some(curve) = curve else {
        return Err(count.refuse("parts are counted along arcs, and there is no [[arc]]", "at least one [[arc]], or no count"));
    };
    if let Some(v) = table.get("at") {
        return Err(v.refuse(format!("part `{name}` is counted along the arcs and has a place"), "one of count and at"));
    }
    let n = number(table, &count, curve, section.as_ref())?;
    let (mut parts, frames) = curve.parts(n, section.as_ref());
    for (k, p) in parts.iter_mut().enumerate() {
        if section.is_none() {
            p.mass = mass.unwrap_or(0.0);
            let a = curve.frame((k as f64 + 0.5) * curve.length() / n as f64).axes;
            let own = inertia.unwrap_or_default();
            p.inertia = std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * own[k] * a[j][k]).sum()));
        }
        let name = format!("{name}{}", k + 1);
        names.add("part", name.clone(), &value)?;
        made.tables.insert(name.clone(), table.line());
        made.bodies.push(Body { name, mass: p.mass, inertia: 0.0, free: free.clone() });
    }
    made.stems.push((Stem { name: name.clone(), first: made.parts.len(), count: n, curve: curve.clone() }, section));
    made.chains.insert(name, (made.parts.len(), frames));
    made.parts.extend(parts);
    Ok(())
}

/// `count = 22`, or `count = "modal basis"` with the modulus of the section and the highest frequency of interest.
fn number(table: &TableView<'_>, count: &ValueView<'_>, curve: &Curve, section: Option<&Section>) -> Result<usize, TomlError> {
    if !count.is_string() {
        return Ok(count.integer(2, limits::COUNT)? as usize);
    }
    count.word("count", &[("modal basis", ())])?;
    let Some(section) = section else {
        return Err(count.refuse("the modal-basis rule needs the section of the parts", "section, modulus and highest, or a number"));
    };
    let of = |key: &str, dimension: Dimension, example: &str| {
        let v = table.require(key, example)?;
        let q = v.quantity(dimension)?;
        if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("the {key} is {q}"), example)) }
    };
    let modulus = of("modulus", Dimension::PRESSURE, "modulus = \"28000 N/mm2\"")?;
    let highest = of("highest", Dimension::FREQUENCY, "highest = \"2500 Hz\", the highest frequency of interest")?;
    let n = section.parts_below(curve.length(), modulus, highest);
    if n as i64 > limits::COUNT {
        return Err(count.refuse(format!("the modal-basis rule asks for {n} parts"), "a lower highest frequency, or a number"));
    }
    Ok(n)
}

fn axes(value: &ValueView<'_>) -> Result<Vec<Axis>, TomlError> {
    let words: Vec<(&str, Axis)> = Axis::ALL.into_iter().map(|a| (a.name(), a)).collect();
    let mut free = Vec::new();
    for v in value.list()? {
        let axis = v.word("axis", &words)?;
        if free.contains(&axis) {
            return Err(v.refuse(format!("the axis `{}` stands twice", axis.name()), "each axis once"));
        }
        free.push(axis);
    }
    free.sort();
    Ok(free)
}

fn principal(value: &ValueView<'_>) -> Result<[f64; 3], TomlError> {
    let list = value.list()?;
    let mut own = [0.0; 3];
    if list.len() != 3 {
        return Err(value.refuse(format!("{} moments of inertia", list.len()), "three, about x, y and z"));
    }
    for (x, v) in own.iter_mut().zip(&list) {
        *x = v.quantity(Dimension::INERTIA)?.value;
        if *x < 0.0 {
            return Err(v.refuse("a moment of inertia below 0", "zero or more"));
        }
    }
    Ok(own)
}

fn diagonal(own: [f64; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { own[i] } else { 0.0 }))
}

/// Moves the origin of a part, the point its translations belong to.
fn move_origin(part: &mut Part, at: [f64; 3]) {
    let centre: [f64; 3] = std::array::from_fn(|i| part.origin[i] + part.centre[i]);
    (part.origin, part.centre) = (at, sub(centre, at));
}

/// Whether a hinge line lies within a part of a chain: no farther along it than one length from its middle, no farther across it than one thickness and
/// length. What lies farther is a wrong unit, or another part. Returns how far it is off.
fn within(made: &Made, part: usize, at: [f64; 3]) -> Result<(), String> {
    let Some((stem, section)) = made.stems.iter().find(|(s, _)| (s.first..s.first + s.count).contains(&part)) else { return Ok(()) };
    let length = stem.curve.length() / stem.count as f64;
    let middle = stem.curve.frame(((part - stem.first) as f64 + 0.5) * length);
    let d = sub(at, middle.point);
    let along = |axis: usize| (0..3).map(|i| d[i] * middle.axes[i][axis]).sum::<f64>().abs();
    let (x, y) = (along(0), along(1));
    if y <= length && x <= length + section.map_or(0.0, |s| s.thickness) {
        return Ok(());
    }
    let name = &made.bodies[part].name;
    Err(format!("the hinge line lies {:.3} mm along and {:.3} mm across from the middle of part `{name}`: outside of it", 1e3 * y, 1e3 * x))
}

fn body(made: &Made, value: &ValueView<'_>) -> Result<usize, TomlError> {
    let name = value.name()?;
    made.bodies
        .iter()
        .position(|b| b.name == name)
        .ok_or_else(|| value.error(unknown_body("part", name, made.bodies.iter().map(|b| b.name.clone()).collect())))
}

fn joint(table: &TableView<'_>, curve: Option<&Curve>, made: &mut Made) -> Result<(), TomlError> {
    table.only(&["part", "free", "at"])?;
    let b = body(made, &table.require("part", "the name of a part")?)?;
    let free = axes(&table.require("free", "the axes that stay free, such as [\"psi\"] for a pin")?)?;
    if let Some(held) = free.iter().find(|a| !made.bodies[b].free.contains(a)) {
        let message = format!("`{}` of part `{}` is held already", held.name(), made.bodies[b].name);
        return Err(table.refuse(message, "axes that the part and its other joints leave free"));
    }
    if let Some(value) = table.get("at") {
        let at = place_on(&value, curve)?;
        within(made, b, at)
            .map_err(|far| value.refuse(far, "a point of the part: within its length along the chain, and its thickness beside it"))?;
        move_origin(&mut made.parts[b], at);
    }
    made.bodies[b].free = free;
    Ok(())
}

/// A point whose displacements are measured and loaded: its part takes it as origin and its name.
fn point(table: &TableView<'_>, curve: Option<&Curve>, made: &mut Made, names: &mut Names) -> Result<(), TomlError> {
    table.only(&["name", "part", "at"])?;
    let name = name(table)?;
    let value = table.require("at", "at = [\"x\", \"y\"], the point in the reference position")?;
    let at = place_on(&value, curve)?;
    let distance = |p: &Part| sub(p.origin, at).iter().map(|x| x * x).sum::<f64>();
    let b = match table.get("part") {
        Some(v) => body(made, &v)?,
        None => {
            let nearest = (0..made.parts.len()).min_by(|a, b| distance(&made.parts[*a]).total_cmp(&distance(&made.parts[*b])));
            nearest.ok_or_else(|| table.refuse("there is no part", "at least one [[part]]"))?
        }
    };
    let there = distance(&made.parts[b]).sqrt() < 1e-9;
    if made.parts[b].centre != [0.0; 3] && !there {
        let message = format!("part `{}` has a joint or a point already: its translations are those of that point", made.bodies[b].name);
        return Err(table.refuse(message, "another part"));
    }
    names.add("part", name.clone(), &table.require("name", "a name")?)?;
    made.tables.insert(name.clone(), table.line());
    if !there {
        move_origin(&mut made.parts[b], at);
    }
    made.bodies[b].name = name;
    Ok(())
}

fn connector(table: &TableView<'_>, curve: Option<&Curve>, made: &mut Made, names: &mut Names) -> Result<(), TomlError> {
    table.only(&["name", "from", "to", "chain", "at", "heading", "absent", "attached"])?;
    let name = name(table)?;
    let value = table.require("name", "a name")?;
    if let Some(chain) = table.get("chain") {
        if let Some(v) = ["from", "to", "at", "heading", "absent", "attached"].iter().find_map(|k| table.get(k)) {
            return Err(
                v.refuse(format!("connector `{name}` is a chain, whose connectors lie at the interfaces"), "chain alone, or from and to")
            );
        }
        let stem = chain.name()?;
        let Some((first, frames)) = made.chains.get(stem).cloned() else {
            return Err(chain.error(unknown_body("part with a count", stem, made.chains.keys().cloned().collect())));
        };
        for (k, frame) in frames.into_iter().enumerate() {
            let name = format!("{name}{}", k + 1);
            names.add("connector", name.clone(), &value)?;
            made.tables.insert(name.clone(), table.line());
            made.connectors.push(Connector { name, from: first + k, to: first + k + 1 });
            made.frames.push(frame);
        }
        return Ok(());
    }
    let mut ends = [0; 2];
    for (end, key) in ends.iter_mut().zip(["from", "to"]) {
        let v = table.require(key, "the name of a part (or chain = \"...\")")?;
        if v.name()? == GROUND && !made.bodies.iter().any(|b| b.name == GROUND) {
            made.bodies.push(Body { name: GROUND.into(), mass: 0.0, inertia: 0.0, free: vec![] });
            made.parts.push(Part { origin: [0.0; 3], centre: [0.0; 3], mass: 0.0, inertia: [[0.0; 3]; 3], dofs: [None; 6] });
        }
        *end = body(made, &v)?;
    }
    let point = match table.get("at") {
        Some(v) => place_on(&v, curve)?,
        // Where nothing is said, at the origin of the end that moves.
        None => made.parts[if made.bodies[ends[1]].free.is_empty() { ends[0] } else { ends[1] }].origin,
    };
    let heading = table.optional("heading", |v| v.quantity(Dimension::ANGLE).map(|q| q.value))?;
    let axes = heading.map_or(UNIT, |h| {
        let (s, c) = h.sin_cos();
        [[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]]
    });
    names.add("connector", name.clone(), &value)?;
    made.tables.insert(name.clone(), table.line());
    if let Some(tests) = table.optional("absent", |v| v.strings())? {
        made.absent.push((made.connectors.len(), tests.into_iter().map(str::to_string).collect()));
    }
    if table.optional("attached", |v| v.word("time of attachment", &[("loaded", true), ("unloaded", false)]))? == Some(true) {
        made.attached.push(made.connectors.len());
    }
    made.connectors.push(Connector { name, from: ends[0], to: ends[1] });
    made.frames.push(Frame { point, axes });
    Ok(())
}
