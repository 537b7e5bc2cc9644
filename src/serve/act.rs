//! What a page can set going: the verbs, on a model of the tree. Each writes its run as the verb does.

use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::diagnose::results::{EffectAt, FitResult, LadderResult, SplitName};
use crate::diagnose::{self, Case, Fitted, Mark, map};
use crate::model::System;
use crate::study::run::RunFolder;
use crate::study::unit_of;
use crate::work::{self, Failure, Scored, Wish, keep, plain};

use super::bench::{Bench, Loaded, Model};
use super::curves::pooled;
use super::job::Job;
use super::order::{ORDER, Order, VERBS, quoted};
use super::picture::{places, printed};

/// Does it, on the thread of its job.
pub fn act(bench: &Bench, loaded: &Loaded, job: &Job, order: &Order) -> Result<Value, Failure> {
    let model = loaded.model(&order.model)?;
    let system = work::with_values(&loaded.study, &model.system, &order.values)?;
    let case = Case { system: system.clone(), ..model.case.clone() };
    let done = match order.verb.as_str() {
        "fit" => fit(loaded, job, &case, order),
        "add" => add(loaded, job, (&model, &case), order),
        "score" => score(loaded, job, &model, order),
        "ladder" => ladder(loaded, job, &case, order),
        "export" => export(loaded, job, &case, order),
        "profile" => profile(loaded, job, &case, order),
        other => Err(Failure::new("serve", other, format!("`{other}` is no verb of the workbench"), VERBS.join(", "))),
    };
    bench.changed();
    done
}

/// The folder of a run with the order in it, so that a run that is killed can be gone on with.
fn begin(loaded: &Loaded, job: &Job, order: &Order) -> Result<RunFolder, Failure> {
    let folder = RunFolder::create(&loaded.study, &order.verb, None)?;
    job.writes(&folder.path);
    let order = Order { study_file: loaded.study_file(), ..order.clone() };
    folder.write(ORDER, plain(&order)?.to_string().as_bytes())?;
    Ok(folder)
}

/// Removes the folder of a run that came to nothing.
fn discard(folder: &RunFolder) {
    // Where the order cannot be removed the folder stays, and is shown as a run without a result.
    let _ = std::fs::remove_file(folder.path.join(ORDER));
    folder.discard();
}

/// Writes the result of a run: the work, and what it says of the workbench it was made in.
fn finish(loaded: &Loaded, job: &Job, order: &Order, folder: &RunFolder, mut value: Value, opens: Option<Value>) -> Result<Value, Failure> {
    value["workbench"] = json!({
        "parent": job.model, "command": job.command, "resumed": order.resume, "held_out_opened": opens,
        "held_out_opened_before": loaded.opened().len(),
    });
    // A ladder that was stopped is climbed again as it was ordered.
    if value["interrupted"] == true {
        value["workbench"]["order"] = plain(order)?;
    }
    folder.result(&value)?;
    // The result says the same.
    let _ = std::fs::remove_file(folder.path.join(ORDER));
    Ok(value)
}

/// The best state of the run that is gone on with, where it kept one.
fn resumed(loaded: &Loaded, order: &Order, folder: &RunFolder) -> Result<bool, Failure> {
    let Some(old) = order.resume.as_ref().map(|r| RunFolder::at(loaded.runs().join(r))).filter(|f| f.checkpoint().is_file()) else {
        return Ok(false);
    };
    work::take_over(&old.path, folder)?;
    Ok(true)
}

fn fit(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let folder = begin(loaded, job, order)?;
    let (case, fitted, result) = fit_into(loaded, job, case, order, &folder).inspect_err(|_| discard(&folder))?;
    let value = finish(loaded, job, order, &folder, work::json(&result, &folder)?, None)?;
    Ok(entered(loaded, &folder, "fit", value, (case, fitted, result), &order.model))
}

/// A fit into the folder of a run.
fn fit_into(loaded: &Loaded, job: &Job, case: &Case, order: &Order, folder: &RunFolder) -> Result<(Case, Fitted, FitResult), Failure> {
    let goes_on = resumed(loaded, order, folder)?;
    job.say(if goes_on { "fit, from the best state of the earlier run" } else { "fit" });
    let monitor = job.monitor(case.system.clone()).checkpoint(folder.checkpoint(), goes_on);
    let (case, fitted, result) = diagnose::fit(case, &loaded.splits(), &monitor)?;
    keep(&loaded.study, &fitted.system, folder, &result)?;
    Ok((case, fitted, result))
}

/// A fit with the profile of one parameter; no model of the tree, but known to its own.
fn profile(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let folder = begin(loaded, job, order)?;
    let made = || -> Result<Value, Failure> {
        let (case, fitted, result) = fit_into(loaded, job, case, order, &folder)?;
        let all =
            work::profiles(&case, &fitted, &folder, std::slice::from_ref(&order.parameter), &job.monitor(fitted.system.clone()), &|l| {
                job.say(l)
            })?;
        if all.is_empty() {
            return Err(Failure::new("identify", &order.parameter, "stopped before the profile was done", "more time"));
        }
        let mut value = work::json(&result, &folder)?;
        value["profiles"] = plain(&all)?;
        Ok(value)
    };
    let value = made().inspect_err(|_| {
        // It holds the fit alone, which is no answer to what was asked.
        let _ = std::fs::remove_dir_all(&folder.path);
    })?;
    let value = finish(loaded, job, order, &folder, value, None)?;
    let profiles = value["profiles"].clone();
    let model = loaded.model(&order.model)?;
    loaded.enter(&folder.path, "profile", value, (*model).clone());
    Ok(json!({ "profiles": profiles, "parent": order.model }))
}

fn entered(
    loaded: &Loaded,
    folder: &RunFolder,
    verb: &str,
    value: Value,
    (case, fitted, result): (Case, Fitted, FitResult),
    parent: &str,
) -> Value {
    let (system, result) = (fitted.system.clone(), Some(Arc::new(result)));
    let model = Model { case: case_of(&case, &system), system, fitted: Some(fitted), result, marks: None };
    let id = loaded.enter(&folder.path, verb, value, model);
    json!({ "model": id, "parent": parent })
}

fn case_of(case: &Case, system: &System) -> Case {
    Case { system: system.clone(), ..case.clone() }
}

/// Adds an effect; another one is added to the same model and becomes a branch beside it.
fn add(loaded: &Loaded, job: &Job, (model, case): (&Model, &Case), order: &Order) -> Result<Value, Failure> {
    let before = match standing(loaded, model).filter(|_| order.values.is_empty()) {
        Some(known) => known,
        None => {
            job.say("fit before");
            diagnose::fit(case, &loaded.splits(), &job.monitor(case.system.clone()))?
        }
    };
    let mut done = add_to(loaded, job, &before, order)?;
    let Some(other) = &order.other else { return Ok(done) };
    let other = Order { verb: order.verb.clone(), model: order.model.clone(), ..(**other).clone() };
    match add_to(loaded, job, &before, &other) {
        Ok(second) => done["beside"] = second["model"].clone(),
        // The first stands in the tree already.
        Err(why) => done["beside_failed"] = why.json()["error"].clone(),
    }
    Ok(done)
}

/// The fit of a model, where it is known for every test that may be seen.
fn standing(loaded: &Loaded, model: &Model) -> Option<(Case, Fitted, FitResult)> {
    let (fitted, result) = (model.fitted.as_ref()?, model.result.as_ref()?);
    let splits = loaded.splits();
    let seen = model.case.plans.iter().filter(|(_, split)| splits.contains(split)).count();
    (result.tests.len() == seen).then(|| (model.case.clone(), fitted.clone(), (**result).clone()))
}

fn add_to(loaded: &Loaded, job: &Job, before: &(Case, Fitted, FitResult), order: &Order) -> Result<Value, Failure> {
    let study = &loaded.study;
    let (case, before_fit, before) = before;
    let wish = Wish {
        effect: order.effect.clone(),
        at: order.at.clone(),
        set: order.set.clone(),
        of: order.of.clone(),
        condition: order.condition.clone(),
        reference: order.reference.clone(),
    };
    let grown = work::wished(&wish, study, &before_fit.system)?;
    let folder = begin(loaded, job, order)?;
    let monitor = job.monitor(grown);
    let done = work::refit(study, case, &before_fit.system, &wish, &loaded.splits(), &monitor, &|step| job.say(step));
    let stopped = || Failure::new("identify", "", "stopped before the refit was done; the model is as it was", "more time");
    let done = done.and_then(|d| d.ok_or_else(stopped)).inspect_err(|_| discard(&folder))?;
    folder.study(study, &done.fitted.system)?;
    folder.residuals(&done.result.tests)?;
    work::report(&folder, study, &done.fitted.system, Some(&done.result), None, None)?;
    let added = EffectAt::of(&done.fitted.system, &done.instance);
    let value = work::json(&json!({ "before": plain(before)?, "after": plain(&done.result)?, "added": plain(&added)? }), &folder)?;
    let value = finish(loaded, job, order, &folder, value, None)?;
    Ok(entered(loaded, &folder, "add", value, (done.case, done.fitted, done.result), &order.model))
}

/// The fit of a model, made where it is not known: from its own values it takes a few iterations.
fn fitted(loaded: &Loaded, job: &Job, model: &Model, id: &str) -> Result<Arc<Model>, Failure> {
    if model.fitted.is_some() {
        return Ok(Arc::new(model.clone()));
    }
    job.say("fit");
    let (case, fitted, result) = diagnose::fit(&model.case, &loaded.splits(), &job.monitor(model.system.clone()))?;
    let known = Arc::new(Model { case, fitted: Some(fitted), result: Some(Arc::new(result)), ..model.clone() });
    loaded.keep(id, known.clone());
    Ok(known)
}

fn score(loaded: &Loaded, job: &Job, model: &Model, order: &Order) -> Result<Value, Failure> {
    let model = fitted(loaded, job, model, &order.model)?;
    // The fit that the scores are about need not be a model of the tree.
    let tests = model.result.as_ref().map_or(Ok(Value::Null), |r| plain(&r.tests))?;
    let errors = tests.as_array().map(|t| pooled(t));
    if let Some(marks) = &model.marks {
        return Ok(json!({ "candidates": **marks, "model": order.model, "errors": errors }));
    }
    let Some(fitted) = &model.fitted else { return Ok(Value::Null) };
    let monitor = job.monitor(fitted.system.clone());
    let marks = map(&model.case, fitted, &monitor, &|step: &str| job.say(step))?;
    let scored = work::scored(&loaded.study, &fitted.system, &marks);
    let one = |pair| candidate(&fitted.system, &loaded.study.dataset, pair);
    let all = marks.iter().zip(&scored).map(one).collect::<Result<Vec<Value>, Failure>>()?;
    let all = Arc::new(Value::from(all));
    if !job.stopped() {
        loaded.keep(&order.model, Arc::new(Model { marks: Some(all.clone()), ..(*model).clone() }));
    }
    Ok(json!({ "candidates": *all, "model": order.model, "errors": errors }))
}

/// A candidate with how it is shown beside its score.
fn candidate(system: &System, dataset: &crate::data::Dataset, (m, scored): (&Mark, &Scored)) -> Result<Value, Failure> {
    let info = m.instance.effect.info();
    let unit = unit_of(system, dataset, &m.instance, 0);
    let mut value = plain(scored)?;
    value["places"] = json!(places(&system.model, &m.instance));
    value["strength"] = printed(info.params[0].default + m.strength, &(unit.symbol.clone(), unit.factor)).into();
    for (key, word) in [
        ("role", info.role.word()),
        ("family", info.family),
        ("equation", info.equation),
        ("claim", info.claim),
        ("parameter", info.params[0].name),
    ] {
        value[key] = word.into();
    }
    Ok(value)
}

fn ladder(loaded: &Loaded, job: &Job, case: &Case, order: &Order) -> Result<Value, Failure> {
    let study = &loaded.study;
    // A ladder that was killed before its first fit has left nothing, and is begun anew.
    let old = order.resume.as_ref().map(|r| RunFolder::at(loaded.runs().join(r))).filter(|f| f.journal().is_file()).map(|f| f.path);
    let folder = begin(loaded, job, order)?;
    let monitor = job.monitor(case.system.clone());
    let done = work::ladder(study, case, &folder, old.as_deref(), monitor, &|step: &str| job.say(step));
    let (result, system) = done.inspect_err(|_| discard(&folder))?;
    let value = work::json(&result, &folder)?;
    // A ladder reads the held-out tests at its end.
    let opens = read(study, &result).then(|| json!({ "by": "ladder", "model": order.model, "when": now() }));
    let value = finish(loaded, job, order, &folder, value, opens)?;
    let model = Model { case: case_of(&loaded.case, &system), system, fitted: None, result: None, marks: None };
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
    let folder = begin(loaded, job, order)?;
    let formats: Vec<&str> = order.to.iter().map(String::as_str).collect();
    let written = work::export(&loaded.study, &fitted, &result, &at, &formats, &folder);
    let (files, notes) = written.inspect_err(|_| discard(&folder))?;
    let json = json!({ "files": files, "notes": notes, "test": at.test, "termination": result.termination });
    finish(loaded, job, order, &folder, work::json(&json, &folder)?, None)?;
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
    let tests = diagnose::compare(&model.case, &model.system, &SplitName::ALL, &crate::parallel::Watch::default())?;
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

/// Saves the effects that a model has beyond the study, as a file of that name beside study.toml; the file, and what is told of it.
pub fn save(loaded: &Loaded, model_id: &str, name: &str) -> Result<(PathBuf, Value), Failure> {
    let model = loaded.model(model_id)?;
    let (own, instances) = (&loaded.study.system.instances, &model.system.instances);
    let begins = own.len() <= instances.len() && own.iter().zip(instances).all(|(a, b)| a.name() == b.name() && a.at == b.at);
    if !begins {
        let message = "the model does not begin with the effects of the study";
        return Err(Failure::new("serve", model_id, message, "the study.toml of its run, which holds it whole"));
    }
    let added = &instances[own.len()..];
    let (file, kept) = loaded.study.save_beside(instances, name)?;
    let same = |(a, b): (&crate::model::Instance, &crate::model::Instance)| a.params.iter().zip(&b.params).all(|(a, b)| a.value == b.value);
    let moved = !own.iter().zip(instances).all(same);
    let effects: Vec<Value> = added.iter().map(|i| plain(&EffectAt::of(&model.system, i))).collect::<Result<_, _>>()?;
    let command = format!("misfit fit {}", quoted(&file.display().to_string()));
    let told = json!({ "file": file.display().to_string(), "added": effects, "moved": moved, "kept": kept, "command": command });
    Ok((file, told))
}
