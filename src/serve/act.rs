//! What a page can set going: the verbs, on a model of the tree. Each writes its run as the verb does.

use std::path::PathBuf;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::{Value, json};

use crate::diagnose::results::{EffectAt, LadderResult, SplitName};
use crate::diagnose::{self, Case, Fitted, Mark, map};
use crate::model::System;
use crate::study::run::RunFolder;
use crate::study::unit_of;
use crate::work::{self, Failure, Wish, keep, plain};

use super::bench::{Bench, Loaded, Model, ROOT};
use super::job::Job;
use super::picture::{places, printed};

/// What is to be done.
#[derive(Deserialize, Debug, Clone, Default)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// One of [`VERBS`].
    pub verb: String,
    /// Model of the tree to begin from.
    pub model: String,
    /// Of `add`: the effect...
    #[serde(default)]
    pub effect: String,
    /// ...and its place.
    #[serde(default)]
    pub at: String,
    /// Of `export`: the formats.
    #[serde(default)]
    pub to: Vec<String>,
    /// Starts with unit.
    #[serde(default)]
    pub set: Vec<(String, String)>,
    /// Of a coefficient: the parameter it scales.
    pub of: Option<String>,
    /// Of a coefficient: the condition.
    pub condition: Option<String>,
    /// Of a coefficient: its reference.
    pub reference: Option<String>,
    /// Values to begin from, `instance.parameter` [SI].
    #[serde(default)]
    pub values: std::collections::BTreeMap<String, f64>,
}

/// What can be set going.
pub const VERBS: [&str; 5] = ["fit", "add", "score", "ladder", "export"];

/// The command line that does the same.
pub fn command(bench: &Bench, order: &Order) -> String {
    let study = match order.model.as_str() {
        ROOT => bench.path.clone(),
        run => (if bench.path.is_dir() { bench.path.clone() } else { bench.path.parent().map(PathBuf::from).unwrap_or_default() })
            .join("runs")
            .join(run),
    };
    let study = quoted(&study.display().to_string());
    let verb = if order.verb == "score" { "diagnose" } else { &order.verb };
    let mut line = format!("misfit {verb} {study}");
    if order.verb == "add" {
        line += &format!(" {} --at {}", quoted(&order.effect), quoted(&order.at));
        for (name, value) in &order.set {
            line += &format!(" --set {}", quoted(&format!("{name}={value}")));
        }
        for (option, value) in [("--of", &order.of), ("--condition", &order.condition), ("--reference", &order.reference)] {
            line += &value.as_ref().map_or(String::new(), |v| format!(" {option} {}", quoted(v)));
        }
    }
    if order.verb == "export" {
        line += &format!(" --to {}", order.to.join(","));
    }
    if bench.seed != 1 {
        line += &format!(" --seed {}", bench.seed);
    }
    line + &bench.data.as_ref().map_or(String::new(), |d| format!(" --data {}", quoted(&d.display().to_string())))
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=+,@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The system of a model with other values.
pub fn with_values(system: &System, values: &std::collections::BTreeMap<String, f64>) -> Result<System, Failure> {
    let mut system = system.clone();
    for (key, value) in values {
        let place = key.split_once('.').and_then(|(i, p)| Some((i.parse::<usize>().ok()?, p.parse::<usize>().ok()?)));
        let param = place.and_then(|(i, p)| system.instances.get_mut(i)?.params.get_mut(p));
        let Some(param) = param else {
            return Err(Failure::new("serve", key, "there is no such parameter", "`instance.parameter`, such as 0.0"));
        };
        param.value = *value;
    }
    system.check()?;
    Ok(system)
}

/// Does it, on the thread of its job.
pub fn act(bench: &Bench, loaded: &Loaded, job: &Job, order: &Order) -> Result<Value, Failure> {
    let model = loaded.model(&order.model)?;
    let system = with_values(&model.system, &order.values)?;
    let case = Case { system: system.clone(), ..model.case.clone() };
    let done = match order.verb.as_str() {
        "fit" => fit(loaded, job, &case, order),
        "add" => add(loaded, job, &case, order),
        "score" => score(loaded, job, &model, order),
        "ladder" => ladder(loaded, job, &case, order),
        "export" => export(loaded, job, &case, order),
        other => Err(Failure::new("serve", other, format!("`{other}` is no verb of the workbench"), VERBS.join(", "))),
    };
    bench.changed();
    done
}

/// What a run says of the workbench it was made in.
fn mark(loaded: &Loaded, job: &Job, opens: Option<Value>) -> Value {
    json!({ "parent": job.model, "command": job.command, "held_out_opened": opens, "held_out_opened_before": loaded.opened().len() })
}

fn fit(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let study = &loaded.study;
    let folder = RunFolder::create(study, "fit", None)?;
    job.say("fit");
    let monitor = job.monitor(case.system.clone()).checkpoint(folder.checkpoint(), false);
    let (case, fitted, result) = diagnose::fit(case, &loaded.splits(), &monitor).inspect_err(|_| folder.discard())?;
    keep(study, &fitted.system, &folder, &result)?;
    let mut value = work::json(&result, &folder)?;
    value["workbench"] = mark(loaded, job, None);
    folder.result(&value)?;
    Ok(entered(loaded, &folder, "fit", value, case, fitted, &order.model))
}

fn entered(loaded: &Loaded, folder: &RunFolder, verb: &str, value: Value, case: Case, fitted: Fitted, parent: &str) -> Value {
    let model = Model { system: fitted.system.clone(), case: case_of(&case, &fitted.system), fitted: Some(fitted), marks: None };
    let id = loaded.enter(&folder.path, verb, value, model);
    json!({ "model": id, "parent": parent })
}

fn case_of(case: &Case, system: &System) -> Case {
    Case { system: system.clone(), ..case.clone() }
}

fn add(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let study = &loaded.study;
    let wish = Wish {
        effect: order.effect.clone(),
        at: order.at.clone(),
        set: order.set.clone(),
        of: order.of.clone(),
        condition: order.condition.clone(),
        reference: order.reference.clone(),
    };
    job.say("fit before");
    let splits = loaded.splits();
    let (case, before_fit, before) = diagnose::fit(case, &splits, &job.monitor(case.system.clone()))?;
    let mut grown = before_fit.system.clone();
    grown.instances.push(work::wished(&wish, study)?);
    let monitor = job.monitor(grown);
    let done = work::refit(study, &case, &before_fit.system, &wish, &splits, &monitor, &|step| job.say(step))?;
    let Some(done) = done else {
        return Err(Failure::new("identify", "", "stopped before the refit was done; the model is as it was", "more time"));
    };
    let folder = RunFolder::create(study, "add", None)?;
    folder.study(study, &done.fitted.system)?;
    folder.residuals(&done.result.tests)?;
    work::report(&folder, study, &done.fitted.system, Some(&done.result), None, None)?;
    let added = EffectAt { effect: done.instance.name().into(), at: done.instance.at.clone() };
    let mut value = work::json(&json!({ "before": plain(&before)?, "after": plain(&done.result)?, "added": plain(&added)? }), &folder)?;
    value["workbench"] = mark(loaded, job, None);
    folder.result(&value)?;
    Ok(entered(loaded, &folder, "add", value, done.case, done.fitted, &order.model))
}

/// The fit of a model, made where it is not known: from its own values it takes a few iterations.
fn fitted(loaded: &Loaded, job: &Job, model: &Model, id: &str) -> Result<Arc<Model>, Failure> {
    if model.fitted.is_some() {
        return Ok(Arc::new(model.clone()));
    }
    job.say("fit");
    let (case, fitted, _) = diagnose::fit(&model.case, &[SplitName::Fit, SplitName::Select], &job.monitor(model.system.clone()))?;
    let known = Arc::new(Model { case, fitted: Some(fitted), ..model.clone() });
    loaded.keep(id, known.clone());
    Ok(known)
}

fn score(loaded: &Loaded, job: &Job, model: &Model, order: &Order) -> Result<Value, Failure> {
    let model = fitted(loaded, job, model, &order.model)?;
    if let Some(marks) = &model.marks {
        return Ok(json!({ "candidates": **marks, "model": order.model }));
    }
    let Some(fitted) = &model.fitted else { return Ok(Value::Null) };
    let monitor = job.monitor(fitted.system.clone());
    let marks = map(&model.case, fitted, &monitor, &|step: &str| job.say(step))?;
    let all: Vec<Value> = marks.iter().map(|m| candidate(loaded, &fitted.system, m, &marks)).collect();
    let all = Arc::new(Value::from(all));
    if !job.stopped() {
        loaded.keep(&order.model, Arc::new(Model { marks: Some(all.clone()), ..(*model).clone() }));
    }
    Ok(json!({ "candidates": *all, "model": order.model }))
}

/// A candidate with what `add` is to be given for it.
fn candidate(loaded: &Loaded, system: &System, m: &Mark, all: &[Mark]) -> Value {
    let (i, info) = (&m.instance, m.instance.effect.info());
    let study = &loaded.study;
    let shape = |(k, p): (usize, &crate::effect::Param)| {
        let searched = p.kind == crate::effect::Kind::Shape && i.params[k].value != p.default;
        let unit = unit_of(system, &study.dataset, i, k);
        // It is where a fit begins: three digits are enough, and are read.
        let start = format!("{:.2e}", unit.from_si(i.params[k].value)).parse::<f64>().unwrap_or(i.params[k].value);
        searched.then(|| (p.name, format!("{start} {}", unit.symbol).trim_end().to_string()))
    };
    let set: Vec<(&str, String)> = info.params.iter().enumerate().filter_map(shape).collect();
    let unit = unit_of(system, &study.dataset, i, 0);
    let label = |j: &usize| format!("{} at {}", all[*j].instance.name(), all[*j].instance.at);
    let target = i.target.as_ref().map(|t| {
        let of = m.of.as_ref().and_then(|o| o.split(" over ").next()).unwrap_or_default();
        json!({ "of": of, "condition": t.condition, "reference": t.unit.print(t.reference) })
    });
    json!({
        "effect": info.name, "at": i.at, "of": m.of, "role": info.role.word(), "family": info.family, "equation": info.equation, "claim": info.claim,
        "places": places(&system.model, i), "predicted_drop": m.drop, "p_value": m.p_value,
        "strength": printed(info.params[0].default + m.strength, &(unit.symbol.clone(), unit.factor)),
        "parameter": info.params[0].name, "nats": m.bound, "price": m.price, "promises": m.bound >= m.price,
        "set": set, "target": target, "tied_with": m.tied_with.iter().map(label).collect::<Vec<_>>(),
    })
}

fn ladder(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let study = &loaded.study;
    let folder = RunFolder::create(study, "ladder", None)?;
    job.say("first fit");
    let monitor = job.monitor(case.system.clone());
    let (mut result, system) = diagnose::ladder(case, &monitor, &|step: &str| job.say(step)).inspect_err(|_| folder.discard())?;
    folder.study(study, &system)?;
    result.result_study = Some(folder.path.display().to_string());
    if let Some(last) = result.rungs.last() {
        folder.residuals(&last.tests)?;
    }
    work::report(&folder, study, &system, None, None, Some(&result))?;
    let mut value = work::json(&result, &folder)?;
    // A ladder reads the held-out tests at its end.
    value["workbench"] = mark(loaded, job, read(study, &result).then(|| json!({ "by": "ladder", "model": order.model, "when": now() })));
    folder.result(&value)?;
    let model = Model { case: case_of(&loaded.case, &system), system, fitted: None, marks: None };
    let id = loaded.enter(&folder.path, "ladder", value, model);
    Ok(json!({ "model": id, "parent": order.model, "verdict": plain(&result.verdict)?, "missing": plain(&result.missing)? }))
}

fn export(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let known: Vec<&str> = crate::export::EXPORTERS.iter().map(|e| e.name()).collect();
    if let Some(other) = order.to.iter().find(|f| !known.contains(&f.as_str())) {
        return Err(Failure::new("export", "to", format!("there is no format `{other}`"), known.join(", ")));
    }
    job.say("fit");
    let at = work::Stand::of(&loaded.study, None)?;
    let (_, fitted, result) = diagnose::fit(case, &loaded.splits(), &job.monitor(case.system.clone()))?;
    let folder = RunFolder::create(&loaded.study, "export", None)?;
    let formats: Vec<&str> = order.to.iter().map(String::as_str).collect();
    let (files, notes) = work::export(&loaded.study, &fitted, &result, &at, &formats, &folder)?;
    let json = json!({ "files": files, "notes": notes, "test": at.test, "termination": result.termination });
    let mut value = work::json(&json, &folder)?;
    value["workbench"] = mark(loaded, job, None);
    folder.result(&value)?;
    Ok(json!({ "files": files, "notes": notes, "run": folder.path.file_name().map(|n| n.to_string_lossy()) }))
}

fn read(study: &crate::study::Study, result: &LadderResult) -> bool {
    !study.split.held_out.is_empty() && result.held_out.after.is_some()
}

/// Seconds since 1970.
pub fn now() -> u64 {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs())
}

/// Opens the held-out tests: a comparison is written that says so, whatever is found in them later.
pub fn open(loaded: &Loaded, model_id: &str) -> Result<Value, Failure> {
    if !loaded.opened().is_empty() {
        return Ok(json!({ "held_out_opened": loaded.opened() }));
    }
    let model = loaded.model(model_id)?;
    let tests = diagnose::compare(&model.case, &model.system, &work::ALL, &crate::parallel::Watch::default())?;
    let folder = RunFolder::create(&loaded.study, "compare", None)?;
    folder.study(&loaded.study, &model.system)?;
    folder.residuals(&tests)?;
    let mut value = work::json(&json!({ "study": loaded.study.title, "tests": plain(&tests)? }), &folder)?;
    let opened = json!({ "by": "reader", "model": model_id, "when": now() });
    value["workbench"] = json!({ "parent": model_id, "held_out_opened": opened });
    work::report(&folder, &loaded.study, &model.system, Some(&work::as_it_stands(&model.case, &tests)), None, None)?;
    folder.result(&value)?;
    loaded.enter(&folder.path, "compare", value, (*model).clone());
    Ok(json!({ "held_out_opened": loaded.opened() }))
}

/// Saves the effects that a model has beyond the study, as a file of that name beside study.toml.
pub fn save(loaded: &Loaded, model_id: &str, name: &str) -> Result<Value, Failure> {
    let model = loaded.model(model_id)?;
    let (own, instances) = (&loaded.study.system.instances, &model.system.instances);
    let begins = own.len() <= instances.len() && own.iter().zip(instances).all(|(a, b)| a.name() == b.name() && a.at == b.at);
    if !begins {
        let message = "the model does not begin with the effects of the study";
        return Err(Failure::new("serve", model_id, message, "the study.toml of its run, which holds it whole"));
    }
    let added = &instances[own.len()..];
    let file = loaded.study.save_beside(added, name)?;
    let effects: Vec<Value> = added.iter().map(|i| json!({ "effect": i.name(), "at": i.at })).collect();
    Ok(
        json!({ "file": file.display().to_string(), "added": effects, "command": format!("misfit fit {}", quoted(&file.display().to_string())) }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_words_of_a_shell() {
        assert_eq!(quoted("studies/01"), "studies/01");
        assert_eq!(quoted("a b"), "'a b'");
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        let bench = Bench::new("a".into(), PathBuf::from("my study/study.toml"), None, 2);
        let set = vec![("d".to_string(), "0.07 mm".to_string())];
        let order = Order {
            verb: "add".into(),
            model: "20261124-112100-fit".into(),
            effect: "coulomb".into(),
            at: "c1.x".into(),
            set,
            ..Order::default()
        };
        assert_eq!(command(&bench, &order), "misfit add 'my study/runs/20261124-112100-fit' coulomb --at c1.x --set 'd=0.07 mm' --seed 2");
    }
}
