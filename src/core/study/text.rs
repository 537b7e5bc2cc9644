//! A study as text: one effect, or the whole file.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use crate::data::{Conditions, Control, Dataset, StoredEnergy};
use crate::diagnose::{STATED, Settings};
use crate::effect::{Effect, Kind};
use crate::identify::Loss;
use crate::model::{Instance, System};
use crate::units::{Dimension, Quantity, Unit};

use super::load::folder_of;
use super::{ConnectorSpec, CycleQuantity, Ends, Predicted, PredictionSpec, Study};
use super::{effects, starts, unit_of};

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn list<S: AsRef<str>>(items: &[S]) -> String {
    format!("[{}]", items.iter().map(|i| quoted(i.as_ref())).collect::<Vec<_>>().join(", "))
}

/// `to` as seen from the folder `from`; as it is, but absolute, where they have no folder in common but the root.
fn relative(from: &Path, to: &Path) -> PathBuf {
    let whole = |p: &Path| p.canonicalize().or_else(|_| std::path::absolute(p)).unwrap_or_else(|_| p.to_path_buf());
    let (from, to) = (whole(from), whole(to));
    let (a, b): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    let rooted = a.iter().take(common).filter(|c| matches!(c, Component::Normal(_))).count();
    if rooted == 0 {
        return to;
    }
    let up = a.iter().skip(common).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(b.iter().skip(common).copied()).collect();
    if path.as_os_str().is_empty() { PathBuf::from(".") } else { path }
}

/// The `[[effect]]` block of an instance of `system` (or of one that is about to join it).
/// `exact`: starts that read back to the last bit, for the record of a run; without it in few digits, for the file of a reader.
pub(super) fn effect(system: &System, dataset: &Dataset, instance: &Instance, exact: bool) -> String {
    let info = instance.effect.info();
    let entries: Vec<&str> = instance.at.split(',').map(str::trim).collect();
    let at = if entries.len() == 1 { quoted(entries[0]) } else { list(&entries) };
    let mut text = format!("[[effect]]\neffect = {}\nat = {at}\n", quoted(info.name));
    if let Effect::Force(law) = instance.effect
        && let Some(formula) = law.formula()
    {
        let definition = &formula.definition;
        let _ = writeln!(text, "expression = {}", quoted(&definition.expression));
        if !definition.states.is_empty() {
            let states: Vec<String> = definition.states.iter().map(|(name, rate)| format!("{name} = {}", quoted(rate))).collect();
            let _ = writeln!(text, "states = {{ {} }}", states.join(", "));
        }
        if definition.active {
            text.push_str("active = true\n");
        }
    }
    if let Some(only) = &instance.only {
        let _ = writeln!(text, "only = {{ {} = {} }}", only.name, quoted(&only.printed));
    }
    if let Some(target) = &instance.target {
        let of = effects::of_name(&system.model, &system.instances, &instance.site, target);
        let unit = &target.unit;
        let _ = writeln!(text, "of = {}\ncondition = {}", quoted(&of), quoted(&target.condition));
        let _ = writeln!(text, "reference = {}", quoted(&unit.print(target.reference)));
    }
    for (p, (param, value)) in info.params.iter().zip(&instance.params).enumerate() {
        let unit = unit_of(system, dataset, instance, p);
        let print = |si: f64| quoted(&unit.print(si));
        let start = if exact { print(value.value) } else { quoted(&starts::short(&unit, value.value, (value.min, value.max))) };
        let mut keys = vec![format!("start = {start}")];
        for (key, bound, own) in [("min", value.min, f64::NEG_INFINITY), ("max", value.max, param.max)] {
            if bound.is_finite() && bound != own {
                keys.push(format!("{key} = {}", print(bound)));
            }
        }
        if let Some((mean, sigma)) = value.prior {
            keys.push(format!("prior = {{ mean = {}, sigma = {} }}", print(mean), print(sigma)));
        }
        keys.extend(value.slack.map(|w| format!("slack = {w:?}")));
        let setting = param.kind == Kind::Setting;
        match (setting, value.free) {
            (true, true) => keys.push("free = true".into()),
            (_, false) => keys.push("fixed = true".into()),
            (false, true) => {}
        }
        let implied = value.min == param.min && value.max == param.max && value.prior.is_none() && value.slack.is_none();
        let _ = match setting && !value.free && implied {
            true => writeln!(text, "{} = {start}", param.name),
            false => writeln!(text, "{} = {{ {} }}", param.name, keys.join(", ")),
        };
    }
    text
}

impl Study {
    /// A whole study.toml with the values and the effects of `system` (the study's own model, effects added and removed as they may be):
    /// starts are its values; graph, split, orders, settings, assumptions and predictions are the study's. Orders on parameters that
    /// `system` does not free are left out. Comments of the original are not kept. The text is for a file in `folder`: paths are
    /// relative to it where the two have a folder in common, so that a study may be moved with its runs.
    pub fn with_values(&self, system: &System, folder: &Path) -> String {
        let path = |path: &Path| quoted(&relative(folder, path).to_string_lossy());
        let mut text = String::from("schema = 1\n");
        let file = &self.dataset.file;
        let beside = if file.file_name().is_some_and(|n| n == "dataset.toml") { folder_of(file) } else { file.clone() };
        let _ = writeln!(text, "title = {}\ndataset = {}", quoted(&self.title), path(&beside));
        if let Some(data) = &self.data {
            let _ = writeln!(text, "folder = {}", path(data));
        }
        if !self.assumptions.is_empty() {
            let _ = writeln!(text, "assumptions = {}", list(&self.assumptions));
        }
        let (select, held_out) = (list(&self.split.select), list(&self.split.held_out));
        let _ = writeln!(text, "split = {{ select = {select}, held_out = {held_out} }}");
        for l in &self.leave_out {
            let _ = writeln!(
                text,
                "\n[[leave_out]]\ntest = {}\nquantity = \"{}\"\nmode = {}\nwhy = {}",
                quoted(&l.test),
                l.quantity,
                l.mode,
                quoted(&l.why)
            );
        }
        for s in &self.shifts {
            let _ = writeln!(
                text,
                "\n[[shift]]\ntest = {}\nagainst = {}\nsigma = \"{} %\"",
                quoted(&s.test),
                quoted(&s.against),
                100.0 * s.sigma
            );
        }
        self.settings(&mut text);
        for table in &self.graph.tables {
            let _ = write!(text, "\n{table}");
        }
        for body in &self.graph.bodies {
            let _ = writeln!(text, "\n[[body]]\nname = {}", quoted(&body.name));
            if body.fixed {
                text.push_str("fixed = true\n");
            } else {
                let _ = writeln!(text, "free = {}", list(&body.free.iter().map(|a| a.name()).collect::<Vec<_>>()));
            }
            match &body.mass {
                Some(mass) if body.mass_range.is_some() || body.mass_slack.is_some() => {
                    let mut keys = vec![format!("start = {}", quoted(&mass.to_string()))];
                    let si = |v: f64| quoted(&mass.unit.print(v));
                    if let Some((least, most)) = body.mass_range {
                        keys.push(format!("min = {}", si(least)));
                        keys.extend(most.is_finite().then(|| format!("max = {}", si(most))));
                    }
                    keys.extend(body.mass_slack.map(|w| format!("slack = {w:?}")));
                    let _ = writeln!(text, "mass = {{ {} }}", keys.join(", "));
                }
                mass => quantity(&mut text, "mass", mass.as_ref()),
            }
            quantity(&mut text, "inertia", body.inertia.as_ref());
            if let Some(count) = body.count {
                let _ = writeln!(text, "count = {count}");
            }
        }
        for ConnectorSpec { name, ends } in &self.graph.connectors {
            let _ = writeln!(text, "\n[[connector]]\nname = {}", quoted(name));
            let _ = match ends {
                Ends::Between { from, to } => writeln!(text, "from = {}\nto = {}", quoted(from), quoted(to)),
                Ends::Chain(body) => writeln!(text, "chain = {}", quoted(body)),
            };
        }
        for instance in system.instances.iter().filter(|i| !i.follower) {
            let _ = write!(text, "\n{}", effect(system, &self.dataset, instance, true));
        }
        let free = system.free();
        for order in &self.orders {
            let there = |name: &str| free.iter().find(|f| f.name == name);
            let (Some(below), Some(_)) = (there(&order.below), there(&order.above)) else { continue };
            let _ = writeln!(text, "\n[[order]]\norder = {}", list(&[&order.below, &order.above]));
            if order.gap > 0.0 {
                let unit = unit_of(system, &self.dataset, &system.instances[below.instance], below.param);
                let _ = writeln!(text, "gap = {}", quoted(&unit.print(order.gap)));
            }
        }
        for prediction in &self.predictions {
            prediction_text(&mut text, prediction);
        }
        if let Some(t) = &self.tolerance {
            let _ = write!(text, "\n[tolerance]\ndataset = {}\n{}", path(&t.file), t.text);
        }
        text
    }

    fn settings(&self, text: &mut String) {
        text.push_str("\n[fit]\n");
        let (loss, width) = match self.fit.loss {
            Loss::Squares => ("squares", None),
            Loss::Huber(k) => ("huber", Some(k)),
            Loss::SoftL1(k) => ("soft_l1", Some(k)),
            Loss::Cauchy(k) => ("cauchy", Some(k)),
        };
        let _ = writeln!(text, "loss = {}\nstarts = {}", quoted(loss), self.fit.starts);
        if let Some(width) = width {
            // TOML tells integers from floats; both are read as numbers.
            let _ = writeln!(text, "width = {width:?}");
        }
        if let Some(n) = self.fit.max_iterations {
            let _ = writeln!(text, "max_iterations = {n}");
        }
        if let Some(n) = self.fit.points {
            let _ = writeln!(text, "points = {n}");
        }
        if let Some(part) = self.fit.frf_tolerance {
            let _ = writeln!(text, "frf_tolerance = {part:?}");
        }
        let search = &self.search;
        let (mut own, mut default) = (search.constants.clone(), Settings::default());
        let stated = STATED.iter().map(|s| (s.key, *(s.field)(&mut own), *(s.field)(&mut default)));
        let stated: Vec<(&str, f64)> = stated.filter(|(_, own, default)| own != default).map(|(key, own, _)| (key, own)).collect();
        if search.effects.is_some() || search.places.is_some() || search.max_added.is_some() || search.slack.is_some() || !stated.is_empty()
        {
            text.push_str("\n[search]\n");
            for (key, names) in [("effects", &search.effects), ("places", &search.places)] {
                if let Some(names) = names {
                    let _ = writeln!(text, "{key} = {}", list(names));
                }
            }
            if let Some(slack) = search.slack {
                let _ = writeln!(text, "slack = {slack}");
            }
            if let Some(n) = search.max_added {
                let _ = writeln!(text, "max_added = {n}");
            }
            for (key, value) in stated {
                let _ = writeln!(text, "{key} = {value:?}");
            }
        }
    }
}

fn quantity(text: &mut String, key: &str, value: Option<&Quantity>) {
    if let Some(q) = value {
        let _ = writeln!(text, "{key} = {}", quoted(&q.to_string()));
    }
}

/// The place of a cycle, and between what it is driven.
fn cycle_text(text: &mut String, at: &str, control: Control, limits: (f64, f64)) {
    let dimension = match control {
        Control::Force => super::site::along(&[Dimension::FORCE, Dimension::MOMENT], at),
        Control::Displacement => super::site::along(&[Dimension::LENGTH, Dimension::ANGLE], at),
    };
    let (word, si) = (control.role().word(), |value: f64| quoted(&Quantity::si(value, dimension).to_string()));
    let _ = writeln!(text, "at = {}\ncontrol = {}\n{word}_min = {}\n{word}_max = {}", quoted(at), quoted(word), si(limits.0), si(limits.1));
}

fn prediction_text(text: &mut String, prediction: &PredictionSpec) {
    let si = |value: f64, dimension: Dimension| quoted(&Quantity::si(value, dimension).to_string());
    // The number of the mode is added to the case as it is read.
    let case = match &prediction.quantity {
        Predicted::Shift { mode, .. } => prediction.case.strip_suffix(&format!(", mode {mode}")).unwrap_or(&prediction.case),
        _ => &prediction.case,
    };
    let _ = writeln!(text, "\n[[prediction]]\ncase = {}\nquantity = {}", quoted(case), quoted(prediction.quantity.word()));
    match &prediction.quantity {
        Predicted::Cycle { quantity, at, control, limits, .. } => {
            cycle_text(text, at, *control, *limits);
            if let CycleQuantity::Stored(reading) | CycleQuantity::LossRatio(reading) = quantity {
                let _ = writeln!(text, "W_s_reading = \"{}\"", if *reading == StoredEnergy::Slope { "slope" } else { "product" });
            }
        }
        Predicted::Travel { at, respond, control, limits, .. } => {
            cycle_text(text, at, *control, *limits);
            let _ = writeln!(text, "respond = {}", quoted(respond));
        }
        Predicted::Frequency(mode) | Predicted::Damping(mode) => {
            let _ = writeln!(text, "mode = {mode}");
        }
        Predicted::Sweep { at, respond, mean, amplitude, frequencies, duration } => {
            let force = super::site::along(&[Dimension::FORCE, Dimension::MOMENT], at);
            let _ = writeln!(text, "at = {}\nrespond = {}", quoted(at), quoted(respond));
            let _ = writeln!(text, "mean = {}\namplitude = {}", si(*mean, force), si(*amplitude, force));
            let (from, to) = (si(frequencies.0, Dimension::FREQUENCY), si(frequencies.1, Dimension::FREQUENCY));
            let _ = writeln!(text, "frequency_from = {from}\nfrequency_to = {to}\nduration = {}", si(*duration, Dimension::TIME));
        }
        Predicted::Shift { test, against, mode } => {
            let _ = writeln!(text, "test = {}\nagainst = {}\nmodes = [{mode}]", quoted(test), quoted(against));
            return;
        }
        Predicted::Frf { excite, respond, frequency, excitation, .. } => {
            let _ = writeln!(text, "excite = {}\nrespond = {}", quoted(excite), quoted(respond));
            let _ = writeln!(text, "frequency = {}", si(*frequency, Dimension::FREQUENCY));
            if let Some(f) = excitation {
                let dimension = super::site::along(&[Dimension::FORCE, Dimension::MOMENT], excite);
                let _ = writeln!(text, "excitation = {}", si(*f, dimension));
            }
        }
    }
    conditions_text(text, &prediction.conditions);
    quantity(text, "reference", prediction.reference.as_ref());
}

fn conditions_text(text: &mut String, conditions: &Conditions) {
    if conditions.is_empty() {
        return;
    }
    let one = |(name, c): (&String, &crate::data::Condition)| match c.sigma {
        // A difference has no offset of a temperature scale, and reads back as it is printed.
        Some(sigma) => {
            let unit = Unit::si(c.unit.dimension);
            let pair = format!("{{ value = {}, sigma = {} }}", quoted(&unit.print(c.value)), quoted(&unit.print(sigma)));
            format!("{} = {pair}", quoted(name))
        }
        None => format!("{} = {}", quoted(name), quoted(&c.unit.print(c.value))),
    };
    let _ = writeln!(text, "conditions = {{ {} }}", conditions.iter().map(one).collect::<Vec<_>>().join(", "));
}
