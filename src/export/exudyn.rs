//! A Python script for Exudyn that builds the mechanism, prints its natural frequencies at rest and its deflection under the declared
//! loads, and holds both against misfit's own numbers.

use std::fmt::Write;

use crate::effect::{iwan_limits, prony};
use crate::model::Axis;

use super::law;
use super::mechanism::{Joint, Law, Mechanism};
use super::{ExportError, Exported, Exporter, Source};

pub(super) struct Exudyn;

impl Exporter for Exudyn {
    fn name(&self) -> &'static str {
        "exudyn"
    }
    fn files(&self, of: &Source) -> Result<Exported, ExportError> {
        let mechanism = Mechanism::new(of.system, of.test, of.conditions, "exudyn")?;
        let (text, notes) = script(&mechanism, of);
        Ok(Exported { files: vec![("mechanism.py".into(), text.into_bytes())], notes })
    }
}

/// A text as a Python literal.
fn quoted(text: &str) -> String {
    format!("{:?}", text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>())
}

/// A number as a Python literal.
fn number(x: f64) -> String {
    if x.is_finite() { format!("{x:?}") } else { format!("float(\"{x}\")") }
}

fn list(x: &[f64]) -> String {
    format!("[{}]", x.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "))
}

fn matrix(m: &[[f64; 3]; 3]) -> String {
    format!("[{}]", m.iter().map(|r| list(r)).collect::<Vec<_>>().join(", "))
}

/// A law in the script's words: a spring, a damper, or what else there is.
#[derive(Default)]
struct Put {
    stiffness: f64,
    damping: f64,
    more: Vec<String>,
}

/// `Err` names what the script cannot express.
fn put(law: &Law, fits: bool) -> Result<Put, String> {
    let p = &law.values;
    let mut out = Put::default();
    let branch = |k: f64, tau: f64| format!("(\"branch\", {}, {})", number(k), number(tau));
    match law.info.name {
        "linear_stiffness" | "stiffness_deviation" => out.stiffness = p[0],
        "viscous" | "damping_deviation" => out.damping = p[0],
        "added_mass" | "mass_deviation" if fits => out.more.push(format!("(\"mass\", {})", number(p[0]))),
        // What lies between the nodes is missing at them.
        "inertia_deviation" if fits => out.more.push(format!("(\"mass\", {})", number(-0.25 * p[0] * p[1]))),
        "elastic_slip" => out.more.push(format!("(\"slider\", {}, {})", number(p[0] / p[1]), number(p[0]))),
        "iwan" => {
            let limits = iwan_limits(p[2]);
            let full: f64 = limits.iter().sum();
            let slider = |y: &f64| format!("(\"slider\", {}, {})", number(p[0] / (p[1] * full)), number(p[0] * y / full));
            out.more.extend(limits.iter().map(slider));
        }
        // Stuck at small amplitude; without force at rest.
        "film" if p[2] > 0.0 => {
            out.more.push(branch(p[0] / p[2], p[2] / p[1]));
        }
        name => {
            if let Some(series) = prony(name, p) {
                (out.stiffness, out.damping) = (p[0] * series.spring, p[0] * series.damper);
                out.more.extend(series.branches.iter().map(|(weight, rate)| branch(p[0] * weight, 1.0 / rate)));
                return Ok(out);
            }
            let constants: Vec<String> = p.iter().map(|x| if *x < 0.0 { format!("({})", number(*x)) } else { number(*x) }).collect();
            let force = law::memoryless(name, &constants, p, "x", "v")
                .ok_or_else(|| format!("{name} at {}: not written for Exudyn; {}", law.at, law.info.equation))?;
            out.more.push(format!("(\"force\", lambda x, v: {force})"));
        }
    }
    Ok(out)
}

fn script(m: &Mechanism, of: &Source) -> (String, Vec<String>) {
    let mut notes: Vec<String> = vec![];
    let note = |notes: &mut Vec<String>, text: String| {
        if !notes.contains(&text) {
            notes.push(text);
        }
    };
    for law in &m.instruments {
        note(&mut notes, format!("{law}: acts on the instrument, not on the mechanism"));
    }
    for law in &m.series {
        note(&mut notes, format!("{law}: acts in series, which the script does not express; its place is stiffer than it was identified"));
    }
    let mut connectors = String::new();
    for joint in &m.joints {
        let mut puts: Vec<(Axis, Put)> = vec![];
        for law in &joint.laws {
            match put(law, mass_fits(m, joint, law)) {
                Ok(p) => puts.push((law.axis, p)),
                Err(what) => note(&mut notes, what),
            }
        }
        connectors += &if m.spatial { spatial(joint, &puts) } else { linear(m, joint, &puts) };
    }
    let mut text = head(of, &notes);
    if m.spatial {
        text += "# Name, mass [kg], origin [m], centre of mass from there [m], inertia about the centre of mass [kg m2], coordinates that are held.\nPARTS = [\n";
        for p in &m.parts {
            let held: Vec<String> = (0..6).filter(|k| !p.free[*k]).map(|k| k.to_string()).collect();
            let (name, mass) = (quoted(&p.name), number(p.mass));
            let _ = writeln!(
                text,
                "    ({name}, {mass}, {}, {}, {}, [{}]),",
                list(&p.origin),
                list(&p.centre),
                matrix(&p.inertia),
                held.join(", ")
            );
        }
        text += "]\n# Name, first and second part, point [m], axes (columns x, y, z), stiffness and damping of the six components [N, m, rad, s], more, whether attached under load.\n";
    } else {
        text += "# Degree of freedom, mass [kg] or moment of inertia [kg m2].\nDOFS = [\n";
        for p in &m.parts {
            for axis in Axis::ALL.into_iter().filter(|a| p.free[*a as usize]) {
                let mass = if axis.rotational() { p.inertia[0][0] } else { p.mass };
                let _ = writeln!(text, "    ({}, {}),", quoted(&format!("{}.{}", p.name, axis.name())), number(mass));
            }
        }
        text += "]\n# Place, degree of freedom at either end (None: held), stiffness, damping, more.\n";
    }
    let _ = write!(
        text,
        "CONNECTORS = [\n{connectors}]\n# Where, and the values passed through from 0; the last one stays [N, N m].\nLOADS = [\n"
    );
    for l in &m.loads {
        let place = if m.spatial {
            format!("{}, {}", l.part, l.axis as usize)
        } else {
            quoted(&format!("{}.{}", m.parts[l.part].name, l.axis.name()))
        };
        let _ = writeln!(text, "    ({place}, {}),", list(&l.path));
    }
    let steps = m.loads.iter().map(|l| l.steps).max().unwrap_or(1).max(10);
    let _ = write!(text, "]\nSTEPS = {steps}  # of the loading path, from one value to the next\n");
    let name = |part: usize, axis: Axis| quoted(&format!("{}.{}", m.parts[part].name, axis.name()));
    let shown = |a: &Axis| !m.spatial || !a.rotational();
    let deflection: Vec<String> =
        m.expected.deflection.iter().filter(|d| shown(&d.1)).map(|(p, a, q)| format!("{}: {}", name(*p, *a), number(*q))).collect();
    let _ = write!(
        text,
        "# What misfit's own engines say.\nEXPECTED = {{\n    \"frequencies\": {},\n    \"deflection\": {{{}}},\n}}\n",
        list(&m.expected.frequencies),
        deflection.join(", ")
    );
    let watched: Vec<String> =
        m.expected.deflection.iter().filter(|d| shown(&d.1) && m.loads.iter().any(|l| l.part == d.0)).map(|d| name(d.0, d.1)).collect();
    let _ = write!(text, "WATCHED = [{}]\n\n", watched.join(", "));
    text += if m.spatial { include_str!("exudyn_spatial.py") } else { include_str!("exudyn_linear.py") };
    text += include_str!("exudyn_run.py");
    notes.extend(m.expected.remarks.iter().cloned());
    (text, notes)
}

fn head(of: &Source, notes: &[String]) -> String {
    let clean = |s: &str| super::clean(&s.replace('\\', "/").replace("\"\"\"", "'''"));
    let left_out = if notes.is_empty() {
        "Everything the model holds is in this script.\n".to_string()
    } else {
        format!("NOT IN THIS SCRIPT, or changed:\n{}", notes.iter().map(|n| format!("  - {}\n", clean(n))).collect::<String>())
    };
    format!(
        "\"\"\"Calibrated mechanism in Exudyn, written by misfit export --to exudyn. Needs exudyn and numpy.\n\n\
         Study: {} ({}); fit: {}\nStands at test {}; conditions: {}\nSI throughout: m, kg, N, s, rad.\n\n{left_out}\n    \
         python mechanism.py [--json]     natural frequencies at rest, deflection under the loads, both beside misfit's\n\"\"\"\n\
         import json\nimport math\nimport sys\nimport warnings\n\nimport exudyn as exu\nimport numpy as np\nfrom exudyn.utilities import *  # noqa: F403\n\n\
         # Written so that versions before and after 1.12 take it.\nwarnings.filterwarnings(\"ignore\", category=DeprecationWarning)\n\n\
         ABS, SQRT, EXP, LOG, MAX, SIGN = abs, math.sqrt, math.exp, math.log, max, math.copysign\n\n\
         TEST = {}\n",
        clean(&of.set.study),
        of.set.study_hash,
        clean(&of.set.termination),
        clean(of.test),
        if of.described.is_empty() { "none stated".into() } else { clean(of.described) },
        quoted(of.test)
    )
}

/// Whether a mass can be hung to the second part's own coordinate: from the ground, at its origin, along a fixed axis.
fn mass_fits(m: &Mechanism, joint: &Joint, law: &Law) -> bool {
    if !m.spatial {
        let held = |b: usize| !m.parts[b].free[law.axis as usize];
        return held(joint.from) || held(joint.to);
    }
    let (part, k) = (&m.parts[joint.to], law.axis as usize);
    let there = (0..3).all(|i| (part.origin[i] - joint.point[i]).abs() < 1e-9);
    m.parts[joint.from].ground() && there && k < 3 && (joint.axes[k][k] - 1.0).abs() < 1e-12 && part.free[k]
}

fn spatial(joint: &Joint, puts: &[(Axis, Put)]) -> String {
    let (mut stiffness, mut damping, mut more) = ([0.0; 6], [0.0; 6], vec![]);
    for (axis, p) in puts {
        stiffness[*axis as usize] += p.stiffness;
        damping[*axis as usize] += p.damping;
        more.extend(p.more.iter().map(|l| format!("({}, {l})", *axis as usize)));
    }
    format!(
        "    ({}, {}, {}, {}, {}, {}, {}, [{}], {}),\n",
        quoted(&joint.name),
        joint.from,
        joint.to,
        list(&joint.point),
        matrix(&joint.axes),
        list(&stiffness),
        list(&damping),
        more.join(", "),
        if joint.attached { "True" } else { "False" }
    )
}

fn linear(m: &Mechanism, joint: &Joint, puts: &[(Axis, Put)]) -> String {
    let mut text = String::new();
    for axis in Axis::ALL.into_iter().filter(|a| puts.iter().any(|p| p.0 == *a)) {
        let here = || puts.iter().filter(|p| p.0 == axis);
        let end = |b: usize| {
            let part = &m.parts[b];
            if part.free[axis as usize] { quoted(&format!("{}.{}", part.name, axis.name())) } else { "None".into() }
        };
        let (stiffness, damping) = here().fold((0.0, 0.0), |(k, c), p| (k + p.1.stiffness, c + p.1.damping));
        let more: Vec<&str> = here().flat_map(|p| p.1.more.iter().map(String::as_str)).collect();
        let _ = writeln!(
            text,
            "    ({}, {}, {}, {}, {}, [{}]),",
            quoted(&format!("{}.{}", joint.name, axis.name())),
            end(joint.from),
            end(joint.to),
            number(stiffness),
            number(damping),
            more.join(", ")
        );
    }
    text
}
