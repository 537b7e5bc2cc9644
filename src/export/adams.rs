//! A command file of Adams View: parts, markers, joints, GFORCE statements with the identified coefficients, loads.
//!
//! Units are set at its top: mm, kg, N, s, deg. Every coefficient is a design variable in those units; AX, AY, AZ and WX, WY, WZ are
//! radians in Adams' functions whatever the units, so each is written `RTOD*AZ(...)`, and rotational coefficients count per degree.
//!
//! A GFORCE acts on the second part (its I marker) with its reaction on the first (J), along the axes of the first part's marker
//! (REF): the six components of [`crate::model::space`].

use std::collections::HashMap;
use std::fmt::Write;

use crate::effect::{Dim, Param};
use crate::model::Axis;
use crate::model::space::rotation::{M3, V3};

use super::law;
use super::mechanism::{Joint, Law, Load, Mechanism, Part};
use super::{ExportError, Exported, Exporter, Source, clean};

pub(super) struct Adams;

const MM: f64 = 1e-3;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

impl Exporter for Adams {
    fn name(&self) -> &'static str {
        "adams"
    }
    fn files(&self, of: &Source) -> Result<Exported, ExportError> {
        let mechanism = Mechanism::new(of.system, of.test, of.conditions, "adams")?;
        let mut file = File { text: String::new(), left_out: vec![], variables: HashMap::new(), names: HashMap::new(), ids: 0 };
        file.whole(&mechanism, of);
        Ok(Exported { files: vec![("mechanism.cmd".into(), file.text.into_bytes())], notes: file.left_out })
    }
}

struct File {
    text: String,
    left_out: Vec<String>,
    /// Design variable of a value that has been written, by effect, place and parameter.
    variables: HashMap<String, Vec<(u64, String)>>,
    names: HashMap<String, usize>,
    ids: usize,
}

/// A number with a decimal point, as Adams writes reals.
fn real(x: f64) -> String {
    let text = format!("{:?}", if x == 0.0 { 0.0 } else { x });
    if text.contains('.') { text } else { text.replacen('e', ".0e", 1) }
}

fn reals(x: &[f64]) -> String {
    x.iter().map(|x| real(*x)).collect::<Vec<_>>().join(", ")
}

/// A function as strings of a line each, which Adams joins.
fn function(text: &str) -> String {
    let (mut lines, mut line): (Vec<String>, String) = (vec![], String::new());
    for piece in text.split_inclusive(['+', ',']) {
        if !line.is_empty() && line.len() + piece.len() > LINE {
            lines.push(std::mem::take(&mut line));
        }
        line += piece;
    }
    lines.push(line);
    lines.iter().map(|l| format!("\"{l}\"")).collect::<Vec<_>>().join(", &\n      ")
}

/// Characters of a function in a line.
const LINE: usize = 100;

/// A word of letters, digits and underscores.
fn word(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Value of a parameter in mm, N (N mm), s, deg.
fn converted(value: f64, param: &Param, axis: Axis) -> f64 {
    let (force, length) = if axis.rotational() { (MM, DEGREE) } else { (1.0, MM) };
    match param.dim {
        Dim::Place { f, x, .. } => value / (force.powi(i32::from(f)) * length.powi(i32::from(x))),
        _ => value,
    }
}

/// Unit of a parameter as it stands in the file.
fn unit(param: &Param, axis: Axis) -> String {
    let text = param.dim.si(axis.rotational());
    if axis.rotational() { text.replace("N m", "N mm").replace("rad", "deg") } else { text.replace('m', "mm") }
}

/// Body-fixed 3-1-3 angles [deg] of axes given as columns.
pub(super) fn angles(a: &M3<f64>) -> V3<f64> {
    let theta = a[2][2].clamp(-1.0, 1.0).acos();
    let (psi, phi) =
        if theta.sin().abs() < 1e-9 { (a[1][0].atan2(a[0][0]), 0.0) } else { (a[0][2].atan2(-a[1][2]), a[2][0].atan2(a[2][1])) };
    [psi, theta, phi].map(|x| x / DEGREE)
}

const LETTERS: [&str; 3] = ["X", "Y", "Z"];
const HEADER: &str = include_str!("adams_header.txt");

impl File {
    fn line(&mut self, text: &str) {
        self.text += text;
        self.text.push('\n');
    }

    /// `command &` with its arguments, one a line.
    fn command(&mut self, command: &str, arguments: &[(&str, String)]) {
        let _ = write!(self.text, "{command}");
        for (key, value) in arguments {
            let _ = write!(self.text, " &\n   {key} = {value}");
        }
        self.text += "\n";
    }

    fn title(&mut self, text: &str) {
        let _ = writeln!(self.text, "!\n!--------------------------- {text} ---------------------------\n!");
    }

    /// A name not given before.
    fn name(&mut self, wanted: &str) -> String {
        let wanted = word(wanted);
        let count = self.names.entry(wanted.clone()).or_insert(0);
        *count += 1;
        if *count > 1 { format!("{wanted}_{count}") } else { wanted }
    }

    fn id(&mut self) -> String {
        self.ids += 1;
        self.ids.to_string()
    }

    fn leave_out(&mut self, what: String) {
        if !self.left_out.contains(&what) {
            self.left_out.push(what);
        }
    }

    fn whole(&mut self, m: &Mechanism, of: &Source) {
        let model = ".misfit";
        let header = HEADER
            .replace("@STUDY@", &clean(&of.set.study))
            .replace("@HASH@", &of.set.study_hash)
            .replace("@FIT@", &of.set.termination)
            .replace("@TEST@", of.test)
            .replace("@CONDITIONS@", &if of.described.is_empty() { "none stated".into() } else { clean(of.described) });
        // What is left out is known at the end and stands at the top.
        const LEFT_OUT: &str = "@LEFT_OUT@\n";
        self.text += &header;
        self.text += LEFT_OUT;
        self.command(
            "defaults units",
            &[("length", "mm".into()), ("angle", "deg".into()), ("force", "newton".into()), ("mass", "kg".into()), ("time", "sec".into())],
        );
        self.command("model create", &[("model_name", model.into())]);
        for law in m.instruments.iter() {
            self.leave_out(format!("{law}: acts on the instrument, not on the mechanism"));
        }
        for law in m.series.iter() {
            self.leave_out(format!(
                "{law}: acts in series, which no explicit function expresses; its place is stiffer than it was identified"
            ));
        }
        let parts = self.parts(m, model);
        self.joints_to_ground(m, model, &parts);
        self.title("Design variables: identified and declared coefficients (mm, N, s, deg)");
        let at = self.text.len();
        self.title("General forces");
        let mut variables = String::new();
        for joint in &m.joints {
            self.general_force(m, model, &parts, joint, &mut variables);
        }
        self.text.insert_str(at, &variables);
        self.title("Loads");
        for load in &m.loads {
            self.load(model, &parts, &m.parts[load.part], load);
        }
        self.expected(m);
        let list = if self.left_out.is_empty() {
            "! Everything the model holds is in this file.\n".to_string()
        } else {
            let lines: String = self.left_out.iter().map(|l| format!("!   - {l}\n")).collect();
            format!("! NOT IN THIS FILE, or changed:\n{lines}")
        };
        self.text = self.text.replacen(LEFT_OUT, &format!("{list}!\n"), 1);
    }

    /// Parts with their centres of mass; name of the part of each body. The ground stands for every body that cannot move.
    fn parts(&mut self, m: &Mechanism, model: &str) -> Vec<String> {
        self.title("Parts (all part frames lie at the global origin, so that every location is global)");
        let mut names = vec![];
        for part in &m.parts {
            if part.ground() {
                names.push(format!("{model}.ground"));
                continue;
            }
            let name = format!("{model}.{}", self.name(&part.name));
            let zero = "0.0, 0.0, 0.0".to_string();
            let id = self.id();
            self.command(
                "part create rigid_body name_and_position",
                &[("part_name", name.clone()), ("adams_id", id), ("location", zero.clone()), ("orientation", zero.clone())],
            );
            let centre: V3<f64> = std::array::from_fn(|i| (part.origin[i] + part.centre[i]) / MM);
            self.marker(&format!("{name}.cm"), &centre, &[0.0; 3]);
            self.marker(&format!("{name}.origin"), &part.origin.map(|x| x / MM), &[0.0; 3]);
            // kg m2 to kg mm2; Adams' products of inertia have the sign of the integrals, the tensor's the opposite.
            let j = |r: usize, c: usize| real(part.inertia[r][c] / (MM * MM) * if r == c { 1.0 } else { -1.0 });
            self.command(
                "part create rigid_body mass_properties",
                &[
                    ("part_name", name.clone()),
                    ("mass", real(part.mass)),
                    ("center_of_mass_marker", format!("{name}.cm")),
                    ("ixx", j(0, 0)),
                    ("iyy", j(1, 1)),
                    ("izz", j(2, 2)),
                    ("ixy", j(0, 1)),
                    ("izx", j(2, 0)),
                    ("iyz", j(1, 2)),
                ],
            );
            let turns = part.free[3..].iter().any(|f| *f) && (0..3).any(|k| part.free[3 + k] && part.inertia[k][k] <= 0.0);
            if part.mass <= 0.0 || turns {
                self.leave_out(format!(
                    "part {}: without mass or inertia along a free axis, which Adams refuses in a dynamic run",
                    part.name
                ));
            }
            names.push(name);
        }
        names
    }

    fn marker(&mut self, name: &str, at: &V3<f64>, turned: &V3<f64>) {
        let id = self.id();
        let turned: Vec<String> = turned.iter().map(|a| format!("{}d", real(*a))).collect();
        self.command(
            "marker create",
            &[("marker_name", name.into()), ("adams_id", id), ("location", reals(at)), ("orientation", turned.join(", "))],
        );
    }

    /// What holds coordinates of a part at zero: a fixed or revolute joint, else primitives.
    fn joints_to_ground(&mut self, m: &Mechanism, model: &str, parts: &[String]) {
        self.title("Joints to the ground");
        for (part, name) in m.parts.iter().zip(parts) {
            let held: Vec<usize> = (0..6).filter(|k| !part.free[*k]).collect();
            if part.ground() || held.is_empty() {
                continue;
            }
            let own = name.rsplit('.').next().unwrap_or(name).to_string();
            let at = part.origin.map(|x| x / MM);
            let hold = |file: &mut File, command: &str, what: &str, turned: (V3<f64>, V3<f64>)| {
                let (i, j) = (format!("{name}.{what}_i"), format!("{model}.ground.{own}_{what}_j"));
                file.marker(&i, &at, &turned.0);
                file.marker(&j, &at, &turned.1);
                let key = if command.contains("primitive") { "jprim_name" } else { "joint_name" };
                let id = file.id();
                let joint = format!("{model}.{}", file.name(&format!("{own}_{what}")));
                file.command(command, &[(key, joint), ("adams_id", id), ("i_marker_name", i), ("j_marker_name", j)]);
            };
            let none = ([0.0; 3], [0.0; 3]);
            if held == [0, 1, 2, 3, 4] {
                hold(self, "constraint create joint revolute", "pin", none);
                continue;
            }
            for k in held.iter().copied().filter(|k| *k < 3) {
                // The z axis of the ground's marker along the axis that is held.
                let turned = [[90.0, 90.0, 0.0], [180.0, 90.0, 0.0], [0.0; 3]][k];
                hold(self, "constraint create primitive_joint inplane", &format!("hold_{}", Axis::ALL[k].name()), (turned, turned));
            }
            let turns: Vec<usize> = held.iter().copied().filter(|k| *k >= 3).collect();
            match turns[..] {
                [] => {}
                [_, _, _] => hold(self, "constraint create primitive_joint orientation", "hold_turns", none),
                [a, b] => {
                    let free = 12 - a - b - 3;
                    let turned = [[90.0, 90.0, 0.0], [180.0, 90.0, 0.0], [0.0; 3]][free];
                    hold(self, "constraint create primitive_joint parallel_axis", "hold_turns", (turned, turned));
                }
                [a, ..] => {
                    // Perpendicular to each other: the two axes that a turn about the held one would move.
                    let along = |k: usize| [[90.0, 90.0, 0.0], [180.0, 90.0, 0.0], [0.0; 3]][k];
                    let turned = (along((a - 3 + 1) % 3), along((a - 3 + 2) % 3));
                    hold(self, "constraint create primitive_joint perpendicular", "hold_turn", turned);
                }
            }
        }
    }

    /// The expressions of a law's parameters: design variables, written once for every set of values.
    fn parameters(&mut self, model: &str, law: &Law, to: &mut String) -> Vec<String> {
        let of = |(p, value): (&Param, &f64)| {
            let key = format!("{}_{}_{}", law.at, law.info.name, p.name);
            let value = converted(*value, p, law.axis);
            let known = self.variables.entry(key.clone()).or_default();
            if let Some((_, name)) = known.iter().find(|k| k.0 == value.to_bits()) {
                return format!("({name})");
            }
            let name = format!("{model}.{}", self.name(&key));
            if let Some(known) = self.variables.get_mut(&key) {
                known.push((value.to_bits(), name.clone()));
            }
            let _ = write!(
                to,
                "variable create &\n   variable_name = {name} &\n   units = \"no_units\" &\n   real_value = {} &\n   comments = \"{} at {}: {} [{}]\"\n",
                real(value),
                law.info.name,
                law.at,
                p.doc.replace('"', "'"),
                unit(p, law.axis)
            );
            format!("({name})")
        };
        law.info.params.iter().zip(&law.values).map(of).collect()
    }

    fn general_force(&mut self, m: &Mechanism, model: &str, parts: &[String], joint: &Joint, to: &mut String) {
        let own = self.name(&joint.name);
        if joint.attached && !m.loads.is_empty() {
            let what = "attached when the loads have come on; here it is there from the start: deactivate its GFORCE while they come on, or shift its zero";
            self.leave_out(format!("connector {}: {what}", joint.name));
        }
        let (i, j) = (format!("{}.{own}_i", parts[joint.to]), format!("{}.{own}_j", parts[joint.from]));
        let (at, turned) = (joint.point.map(|x| x / MM), angles(&joint.axes));
        self.marker(&i, &at, &turned);
        self.marker(&j, &at, &turned);
        let mut functions: [Vec<String>; 6] = Default::default();
        for (number, law) in joint.laws.iter().enumerate() {
            let (k, letter) = (law.axis as usize, LETTERS[law.axis as usize % 3]);
            let (x, v) = if k < 3 {
                (format!("D{letter}({i}, {j}, {j})"), format!("V{letter}({i}, {j}, {j}, {j})"))
            } else {
                (format!("(RTOD*A{letter}({i}, {j}))"), format!("(RTOD*W{letter}({i}, {j}, {j}))"))
            };
            if ["added_mass", "mass_deviation", "inertia_deviation"].contains(&law.info.name) {
                self.added_mass(m, model, parts, joint, law);
                continue;
            }
            let p = self.parameters(model, law, to);
            if let Some(force) = law::memoryless(law.info.name, &p, &law.values, &x, &v) {
                functions[k].push(force);
                continue;
            }
            let stem = format!("{model}.{own}_{}_{}_{number}", law.axis.name(), law.info.name);
            let z = |k: usize| format!("DIF({stem}_z{})", k + 1);
            match law::remembering(law.info.name, &p, &law.values, &x, &v, &z) {
                Some(states) => {
                    for (k, rate) in states.rates.iter().enumerate() {
                        let id = self.id();
                        self.command(
                            "part create equation differential_equation",
                            &[
                                ("differential_equation_name", format!("{stem}_z{}", k + 1)),
                                ("adams_id", id),
                                ("initial_condition", "0.0".into()),
                                ("function", function(rate)),
                                ("implicit", "off".into()),
                                ("static_hold", if states.held { "on" } else { "off" }.into()),
                            ],
                        );
                    }
                    functions[k].push(states.force);
                }
                None => {
                    let named = format!("{} at {}: not written as an Adams function; {}", law.info.name, law.at, law.info.equation);
                    self.leave_out(named);
                }
            }
        }
        let id = self.id();
        let written =
            |k: usize| if functions[k].is_empty() { function("0.0") } else { function(&format!("-({})", functions[k].join(" + "))) };
        self.command(
            "force create direct general_force",
            &[
                ("general_force_name", format!("{model}.{own}")),
                ("adams_id", id),
                ("i_marker_name", i.clone()),
                ("j_part_name", parts[joint.from].clone()),
                ("ref_marker_name", j),
                ("x_force_function", written(0)),
                ("y_force_function", written(1)),
                ("z_force_function", written(2)),
                ("x_torque_function", written(3)),
                ("y_torque_function", written(4)),
                ("z_torque_function", written(5)),
            ],
        );
    }

    /// A mass between the ground and a point: a part of its own that slides along the axis and carries the point.
    fn added_mass(&mut self, m: &Mechanism, model: &str, parts: &[String], joint: &Joint, law: &Law) {
        let k = law.axis as usize;
        let mass = if law.info.name == "inertia_deviation" { -0.25 * law.values[0] * law.values[1] } else { law.values[0] };
        if !m.parts[joint.from].ground() || k >= 3 {
            let named = format!("{} at {}: only a mass between the ground and a point along x, y, z is written", law.info.name, law.at);
            return self.leave_out(named);
        }
        let own = self.name(&format!("{}_{}_mass", joint.name, law.axis.name()));
        let (name, at) = (format!("{model}.{own}"), joint.point.map(|x| x / MM));
        let id = self.id();
        let zero = "0.0, 0.0, 0.0".to_string();
        self.command(
            "part create rigid_body name_and_position",
            &[("part_name", name.clone()), ("adams_id", id), ("location", zero.clone()), ("orientation", zero)],
        );
        let a = &joint.axes;
        // z along the axis of the mass.
        let along: M3<f64> = std::array::from_fn(|r| [a[r][(k + 1) % 3], a[r][(k + 2) % 3], a[r][k]]);
        let turned = angles(&along);
        self.marker(&format!("{name}.cm"), &at, &turned);
        self.command(
            "part create rigid_body mass_properties",
            &[
                ("part_name", name.clone()),
                ("mass", real(mass)),
                ("center_of_mass_marker", format!("{name}.cm")),
                ("ixx", "1.0".into()),
                ("iyy", "1.0".into()),
                ("izz", "1.0".into()),
            ],
        );
        let (ground, point) = (format!("{model}.ground.{own}_j"), format!("{}.{own}_p", parts[joint.to]));
        self.marker(&ground, &at, &turned);
        self.marker(&point, &at, &turned);
        let (slide, carry) = (self.name(&format!("{own}_slide")), self.name(&format!("{own}_carry")));
        let (first, second) = (self.id(), self.id());
        self.command(
            "constraint create joint translational",
            &[
                ("joint_name", format!("{model}.{slide}")),
                ("adams_id", first),
                ("i_marker_name", format!("{name}.cm")),
                ("j_marker_name", ground),
            ],
        );
        self.command(
            "constraint create primitive_joint inplane",
            &[
                ("jprim_name", format!("{model}.{carry}")),
                ("adams_id", second),
                ("i_marker_name", point),
                ("j_marker_name", format!("{name}.cm")),
            ],
        );
    }

    fn load(&mut self, model: &str, parts: &[String], part: &Part, load: &Load) {
        let name = self.name(&format!("load_{}_{}", part.name, load.axis.name()));
        let (k, scale) = (load.axis as usize, if load.axis.rotational() { MM } else { 1.0 });
        let turned = [[90.0, 90.0, 0.0], [180.0, 90.0, 0.0], [0.0; 3]][k % 3];
        let at = part.origin.map(|x| x / MM);
        let (i, j) = (format!("{}.{name}_i", parts[load.part]), format!("{model}.ground.{name}_j"));
        self.marker(&i, &at, &turned);
        self.marker(&j, &at, &turned);
        let mut before = 0.0;
        let mut steps = vec![];
        for (stage, value) in load.path.iter().map(|v| v / scale).enumerate() {
            steps.push(format!("STEP(TIME, {stage}, 0, {}, {})", stage + 1, real(value - before)));
            before = value;
        }
        let course = if load.path.len() > 1 { steps.join(" + ") } else { real(before) };
        if load.path.len() > 1 {
            self.line("! The loading path is declared: one second from each value to the next; run quasi-statics to its end first.");
        }
        let id = self.id();
        self.command(
            "force create direct single_component_force",
            &[
                ("single_component_force_name", format!("{model}.{name}")),
                ("adams_id", id),
                ("type_of_freedom", if k < 3 { "translational" } else { "rotational" }.into()),
                ("i_marker_name", i),
                ("j_marker_name", j),
                ("action_only", "on".into()),
                ("function", function(&course)),
            ],
        );
    }

    fn expected(&mut self, m: &Mechanism) {
        self.title("What misfit computes for this mechanism");
        let e = &m.expected;
        for r in &e.remarks {
            self.line(&format!("! {r}"));
        }
        let all: Vec<String> = e.frequencies.iter().map(|f| format!("{f:.3}")).collect();
        if !all.is_empty() {
            self.line(&format!("! Natural frequencies without loads [Hz]: {}", all.join(", ")));
        }
        for (part, axis, q) in e.deflection.iter().filter(|d| m.loads.iter().any(|l| l.part == d.0)) {
            let (value, unit) = if axis.rotational() { (q / DEGREE, "deg") } else { (q / MM, "mm") };
            self.line(&format!("! Under the loads {}.{} = {value:.5} {unit}", m.parts[*part].name, axis.name()));
        }
    }
}
