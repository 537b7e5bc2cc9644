//! Bodies, connectors, degrees of freedom and places.

use std::collections::{HashMap, HashSet};

use super::ModelError;
use super::space::Space;

/// An axis of a body or a connector: three translations, three rotations (theta: bending in yz, phi: torsion about y, psi: bending in
/// xy, as in the paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// Translation along x.
    X,
    /// Translation along y.
    Y,
    /// Translation along z.
    Z,
    /// Rotation theta.
    Theta,
    /// Rotation phi.
    Phi,
    /// Rotation psi.
    Psi,
}

impl Axis {
    /// All axes.
    pub const ALL: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Theta, Axis::Phi, Axis::Psi];

    /// Name in study files.
    pub fn name(self) -> &'static str {
        ["x", "y", "z", "theta", "phi", "psi"][self as usize]
    }
    /// The axis of this name.
    pub fn parse(name: &str) -> Result<Axis, ModelError> {
        Axis::ALL
            .into_iter()
            .find(|a| a.name() == name)
            .ok_or_else(|| ModelError::no_such("axis", name, Axis::ALL.iter().map(|a| a.name().into())))
    }
    /// Whether displacements along it are angles.
    pub fn rotational(self) -> bool {
        self >= Axis::Theta
    }
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Mass [kg]; 0 is a massless node.
    pub mass: f64,
    /// Moment of inertia for rotational freedoms [kg m2]; 0 is massless.
    pub inertia: f64,
    /// Free axes; none for a fixed body.
    pub free: Vec<Axis>,
}

impl Body {
    /// A body that is held.
    pub fn fixed(name: &str) -> Body {
        Body { name: name.into(), mass: 0.0, inertia: 0.0, free: vec![] }
    }
    /// A body of this mass [kg], 0 for a massless node, that moves along these axes.
    pub fn new(name: &str, mass: f64, free: &[Axis]) -> Body {
        Body { name: name.into(), mass, inertia: 0.0, free: free.to_vec() }
    }
    /// The same with a moment of inertia [kg m2] about its free rotations.
    pub fn with_inertia(mut self, inertia: f64) -> Body {
        self.inertia = inertia;
        self
    }
}

/// A joint of general forces between two bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Connector {
    /// Name.
    pub name: String,
    /// Index of the body it comes from.
    pub from: usize,
    /// Index of the body it goes to.
    pub to: usize,
}

/// One degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dof {
    /// Index of the body.
    pub body: usize,
    /// Axis.
    pub axis: Axis,
    /// Mass [kg] or moment of inertia [kg m2].
    pub mass: f64,
}

/// One axis of one connector: where effects act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Index of the connector.
    pub connector: usize,
    /// Axis.
    pub axis: Axis,
    /// Degree of freedom at the `from` end; `None` where it is held.
    pub from: Option<usize>,
    /// Degree of freedom at the `to` end; `None` where it is held.
    pub to: Option<usize>,
}

/// A load that stays, on one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// Index of the degree of freedom.
    pub dof: usize,
    /// Values that are passed through, in order, from 0; the last one stays. A name is that of a condition of the test: a test that
    /// does not state it is not loaded.
    pub path: Vec<Level>,
    /// Steps of the loading path from one value to the next.
    pub steps: usize,
}

/// One value of a loading path.
#[derive(Clone, Debug, PartialEq)]
pub enum Level {
    /// Force or moment [N, N m].
    Value(f64),
    /// Condition of the test that states it, and the factor on it (its direction).
    Condition(String, f64),
}

/// The graph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Connectors: those that are declared, and after them one from the ground to every body that can move, named as the body, so that an
    /// effect may act at a body (a sensor's mass at `m3.x`).
    pub connectors: Vec<Connector>,
    /// Number of declared connectors.
    pub declared: usize,
    /// Degrees of freedom, by body, then axis.
    pub dofs: Vec<Dof>,
    /// Places, by connector, then axis.
    pub places: Vec<Place>,
    /// Where everything is, for parts that turn far; then places have no degree of freedom of their own.
    pub space: Option<Space>,
    /// Loads that stay; the operating point of frequency responses, modes and cycles is the equilibrium under them.
    pub loads: Vec<Load>,
    /// Connectors that are not there in some tests: index, and ids of tests (`loop-*` for all that begin so).
    pub absent: Vec<(usize, Vec<String>)>,
    /// Connectors that are attached when the loads that stay have come on, and carry none of them: unstrained in the equilibrium, they
    /// take part in small motion about it, and in no march.
    pub attached: Vec<usize>,
}

impl Model {
    /// Builds degrees of freedom and places; checks names, ends and connection to something that moves.
    pub fn new(bodies: Vec<Body>, connectors: Vec<Connector>) -> Result<Model, ModelError> {
        unique("body", bodies.iter().map(|b| b.name.as_str()))?;
        unique("connector", connectors.iter().map(|c| c.name.as_str()))?;
        let mut dofs = Vec::new();
        let mut index = HashMap::new();
        for (b, body) in bodies.iter().enumerate() {
            for (what, value) in [("mass", body.mass), ("inertia", body.inertia)] {
                if !value.is_finite() || value < 0.0 {
                    return Err(ModelError::invalid(&body.name, format!("the {what} of body `{}` is {value}", body.name), "zero or more"));
                }
            }
            for &axis in &body.free {
                let mass = if axis.rotational() { body.inertia } else { body.mass };
                if index.insert((b, axis), dofs.len()).is_some() {
                    return Err(ModelError::Twice { what: "free axis", name: format!("{}.{}", body.name, axis.name()) });
                }
                dofs.push(Dof { body: b, axis, mass });
            }
        }
        let mut places = Vec::new();
        let declared = connectors.len();
        let mut connectors = connectors;
        connectors.extend(held_to_ground(&bodies, &connectors));
        for (c, connector) in connectors.iter().enumerate() {
            if connector.from == connector.to {
                return Err(ModelError::invalid(
                    &connector.name,
                    format!("connector `{}` joins body `{}` to itself", connector.name, bodies[connector.to].name),
                    "two different bodies",
                ));
            }
            for axis in Axis::ALL {
                let (from, to) = (index.get(&(connector.from, axis)).copied(), index.get(&(connector.to, axis)).copied());
                if from.is_some() || to.is_some() {
                    places.push(Place { connector: c, axis, from, to });
                }
            }
        }
        if dofs.is_empty() {
            return Err(ModelError::invalid("body", "no body has a free axis: nothing can move", "at least one body with free = [\"x\"]"));
        }
        let model = Model { bodies, connectors, declared, dofs, places, space: None, loads: vec![], absent: vec![], attached: vec![] };
        let mut reached = vec![false; model.dofs.len()];
        for place in model.places.iter().filter(|p| p.connector < declared) {
            place.from.iter().chain(&place.to).for_each(|d| reached[*d] = true);
        }
        for (d, dof) in model.dofs.iter().enumerate() {
            if !reached[d] {
                let name = model.dof_name(d);
                return Err(ModelError::invalid(
                    &name,
                    format!("nothing holds `{name}`: no connector reaches body `{}`", model.bodies[dof.body].name),
                    "a connector to every body that can move, or the axis left out of `free`",
                ));
            }
        }
        Ok(model)
    }

    /// As [`Model::new`], with connectors by names: their own, that of the body they come from, that of the body they go to.
    ///
    /// # Errors
    /// As [`Model::new`], and a body that is not there.
    pub fn joined(bodies: Vec<Body>, joints: &[(&str, &str, &str)]) -> Result<Model, ModelError> {
        let body = |name: &str| {
            let found = bodies.iter().position(|b| b.name == name);
            found.ok_or_else(|| ModelError::no_such("body", name, bodies.iter().map(|b| b.name.clone())))
        };
        let one = |(name, from, to): &(&str, &str, &str)| Ok(Connector { name: (*name).into(), from: body(from)?, to: body(to)? });
        let connectors = joints.iter().map(one).collect::<Result<Vec<_>, ModelError>>()?;
        Model::new(bodies, connectors)
    }

    /// Whether a place lies on a declared connector, and not on one that only names a body.
    pub fn on_connector(&self, place: usize) -> bool {
        self.places[place].connector < self.declared
    }

    /// Whether a connector is there in a test.
    pub fn present(&self, connector: usize, test: &str) -> bool {
        let covers = |pattern: &String| match pattern.strip_suffix('*') {
            Some(front) => test.starts_with(front),
            None => test == pattern,
        };
        !self.absent.iter().any(|(c, tests)| *c == connector && tests.iter().any(covers))
    }

    /// Name of a degree of freedom, `body.axis`.
    pub fn dof_name(&self, dof: usize) -> String {
        let d = &self.dofs[dof];
        format!("{}.{}", self.bodies[d.body].name, d.axis.name())
    }

    /// Name of a place, `connector.axis`.
    pub fn place_name(&self, place: usize) -> String {
        let p = &self.places[place];
        format!("{}.{}", self.connectors[p.connector].name, p.axis.name())
    }

    /// The degree of freedom of this name (`m3.x`), if it is one.
    pub fn dof(&self, name: &str) -> Option<usize> {
        let (body, axis) = split(name)?;
        (0..self.dofs.len()).find(|&d| self.dofs[d].axis == axis && self.bodies[self.dofs[d].body].name == body)
    }

    /// The places an `at` names: `c1.x`, or a range `c1-7.x`, whose connectors all exist. For many of them: [`Model::finder`].
    pub fn places_at(&self, at: &str) -> Result<Vec<usize>, ModelError> {
        self.finder().places_at(at)
    }

    /// The place of this name (`c1.x`), if it is one.
    pub fn place(&self, name: &str) -> Option<usize> {
        let (connector, axis) = split(name)?;
        self.places.iter().position(|p| p.axis == axis && self.connectors[p.connector].name == connector)
    }

    /// Connectors and places by name: one pass over the model, however many names are asked for.
    pub fn finder(&self) -> Finder<'_> {
        Finder {
            model: self,
            connectors: self.connectors.iter().enumerate().map(|(k, c)| (c.name.as_str(), k)).collect(),
            places: self.places.iter().enumerate().map(|(k, p)| ((p.connector, p.axis), k)).collect(),
        }
    }
}

/// A connector from the ground to every body that can move, named as the body, where no other has that name.
pub(super) fn held_to_ground(bodies: &[Body], connectors: &[Connector]) -> Vec<Connector> {
    let Some(ground) = bodies.iter().position(|b| b.free.is_empty()) else { return vec![] };
    let taken: HashSet<&str> = connectors.iter().map(|c| c.name.as_str()).collect();
    let moving = bodies.iter().enumerate().filter(|(_, b)| !b.free.is_empty() && !taken.contains(b.name.as_str()));
    moving.map(|(to, b)| Connector { name: b.name.clone(), from: ground, to }).collect()
}

/// Places of a model by name.
pub struct Finder<'a> {
    /// The model.
    pub model: &'a Model,
    connectors: HashMap<&'a str, usize>,
    places: HashMap<(usize, Axis), usize>,
}

impl Finder<'_> {
    /// As [`Model::places_at`].
    pub fn places_at(&self, at: &str) -> Result<Vec<usize>, ModelError> {
        let known = || (0..self.model.places.len()).map(|p| self.model.place_name(p));
        let (connector, axis) = at.rsplit_once('.').ok_or_else(|| {
            ModelError::invalid(
                at,
                format!("`{at}` names no axis"),
                format!("connector and axis, as in `{}`", known().next().unwrap_or_default()),
            )
        })?;
        let along = Axis::parse(axis)?;
        let place = |name: &str| {
            let found = self.connectors.get(name).and_then(|c| self.places.get(&(*c, along))).copied();
            found.ok_or_else(|| ModelError::no_such("place", &format!("{name}.{axis}"), known()))
        };
        let Some((stem, first, last)) = range(connector).filter(|_| !self.connectors.contains_key(connector)) else {
            return Ok(vec![place(connector)?]);
        };
        if last < first {
            return Err(ModelError::invalid(
                at,
                format!("the range `{connector}` runs backwards"),
                format!("`{stem}{last}-{first}.{axis}`"),
            ));
        }
        if last - first >= self.model.connectors.len() {
            return Err(ModelError::no_such("place", &format!("{stem}{last}.{axis}"), known()));
        }
        (first..=last).map(|n| place(&format!("{stem}{n}"))).collect()
    }

    /// The places of several names or ranges that share one set of values; an error comes with the number of the name that is wrong.
    ///
    /// # Errors
    /// A name that is not there, a place that is named twice, translations among rotations.
    pub fn all_places(&self, names: &[&str]) -> Result<Vec<usize>, (usize, ModelError)> {
        let model = self.model;
        let mut places: Vec<usize> = Vec::new();
        let mut seen = HashSet::new();
        for (i, entry) in names.iter().enumerate() {
            for place in self.places_at(entry).map_err(|e| (i, e))? {
                if !seen.insert(place) {
                    let name = model.place_name(place);
                    let e = ModelError::invalid(*entry, format!("`{name}` stands twice among the places of one effect"), "each place once");
                    return Err((i, e));
                }
                places.push(place);
            }
        }
        let turning = |p: &usize| model.places[*p].axis.rotational();
        let Some(odd) = places.iter().find(|p| turning(p) != places.first().is_some_and(turning)) else { return Ok(places) };
        let message = format!("`{}` turns and `{}` does not: no value has both units", model.place_name(*odd), model.place_name(places[0]));
        let e = ModelError::invalid(names.join(","), message, "one [[effect]] for translations, one for rotations");
        Err((names.len().saturating_sub(1), e))
    }
}

/// `c1.x` as name and axis.
fn split(name: &str) -> Option<(&str, Axis)> {
    let (name, axis) = name.rsplit_once('.')?;
    Some((name, Axis::ALL.into_iter().find(|a| a.name() == axis)?))
}

/// `c1-7` as (`c`, 1, 7).
fn range(name: &str) -> Option<(&str, usize, usize)> {
    let (front, last) = name.rsplit_once('-')?;
    let digits = front.len() - front.trim_end_matches(|ch: char| ch.is_ascii_digit()).len();
    let (stem, first) = front.split_at(front.len() - digits);
    Some((stem, first.parse().ok()?, last.parse().ok()?))
}

pub(super) fn unique<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), ModelError> {
    let mut seen = std::collections::HashSet::new();
    for name in names {
        if name.is_empty() || name.contains('.') || name.chars().any(char::is_whitespace) {
            return Err(ModelError::invalid(name, format!("`{name}` cannot name a {what}"), "a word without dots or spaces"));
        }
        if !seen.insert(name) {
            return Err(ModelError::Twice { what, name: name.into() });
        }
    }
    Ok(())
}
