//! `misfit add`: writes an effect into study.toml and refits.
//!
//! The refit comes first, in memory: the file is touched only when it works.

use serde_json::json;

use crate::diagnose::results::{EffectAt, FitResult};
use crate::diagnose::{self, Case, Fitted};
use crate::effect::{self, Dim, Grid, Kind, Param, Scales};
use crate::model::{Instance, Site};
use crate::study::{CoefficientOf, Study};

use super::failure::Failure;
use super::session::{Common, Session};
use super::{Outcome, fit, report, text};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Name of the effect; `misfit effects` lists them
    effect: String,
    /// Place such as c1.x, c1-7.x, or channel such as loop-1Hz.force
    #[arg(long, value_name = "PLACE")]
    at: String,
    /// Start of a parameter, such as v0="1 mm/s"; without it a strength starts at none and a shape where the tests move
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// For a coefficient: the parameter it scales, such as viscous.c
    #[arg(long, value_name = "EFFECT.PARAMETER", requires = "condition")]
    of: Option<String>,
    /// For a coefficient: the condition
    #[arg(long, value_name = "NAME", requires = "reference")]
    condition: Option<String>,
    /// For a coefficient: value of the condition at which the factor is 1, such as "0.3 mm"
    #[arg(long, value_name = "VALUE", requires = "condition")]
    reference: Option<String>,
}

fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=VALUE, such as v0=\"1 mm/s\"")?;
    Ok((name.trim().to_string(), value.trim().to_string()))
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("fit before");
    let (case, before_fit, before) = diagnose::fit(&case, &fit::ALL, &session.monitor())?;
    let instances = starts(args, &study, &case)?;
    let mut best: Option<(Fitted, FitResult)> = None;
    let mut first_failure = None;
    for (k, instance) in instances.into_iter().enumerate() {
        session.progress.say(&format!("refit with {} at {}, start {}", args.effect, args.at, k + 1));
        let mut with = case.clone();
        with.system = before_fit.system.clone();
        with.system.instances.push(instance);
        match diagnose::fit(&with, &fit::ALL, &session.monitor()) {
            Ok((_, _, result)) if result.termination == "failed" => {}
            Ok((_, fitted, result)) if best.as_ref().is_none_or(|b| result.cost < b.1.cost) => best = Some((fitted, result)),
            Ok(_) => {}
            Err(e) => first_failure = first_failure.or(Some(Failure::from(e))),
        }
        if session.interrupted() {
            break;
        }
    }
    session.progress.end();
    if session.interrupted() {
        return Err(Failure::new("identify", "", "interrupted before the refit was done; study.toml is as it was", "more time"));
    }
    let Some((after_fit, after)) = best else {
        let message = "the refit works from no start; study.toml is as it was";
        return Err(first_failure.unwrap_or_else(|| {
            Failure::new("identify", format!("{} at {}", args.effect, args.at), message, "--set with a start that works")
        }));
    };
    let Some(instance) = after_fit.system.instances.last() else {
        return Err(Failure::new("identify", "", "the refit lost the effect", "another start"));
    };
    // The run is complete before the engineer's file changes: had it no room on the disk, nothing would have happened.
    let folder = session.folder(&study, "add")?;
    folder.study(&study, &after_fit.system)?;
    folder.residuals(&after.tests)?;
    let added = EffectAt { effect: instance.name().into(), at: instance.at.clone() };
    let value = fit::json(&json!({ "before": fit::plain(&before)?, "after": fit::plain(&after)?, "added": fit::plain(&added)? }), &folder)?;
    report::write(&folder, &study, &after_fit.system, Some(&after), None, None)?;
    folder.result(&value)?;
    study.write_effect(instance)?;
    let shown = args.common.study.display().to_string();
    let text = format!(
        "before\n{}\nafter: {} at {} is in {}\n{}",
        text::tests(&before.tests),
        added.effect,
        added.at,
        study.file.display(),
        text::fit(&after, &shown)
    );
    Ok(Outcome { json: value, text, code: fit::code(&after.termination) })
}

/// The new effect at every start worth trying: strengths at none and at a tenth of what acts there, shapes over their grid.
fn starts(args: &Args, study: &Study, case: &Case) -> Result<Vec<Instance>, Failure> {
    let info = effect::find(&args.effect)?.info();
    let of = coefficient(args, study)?;
    let site = study.site(&args.effect, &args.at)?;
    let scales = scales(case, &site)?;
    let given = given(args, study, &of)?;
    let set = |p: &Param| given.iter().find(|(name, _)| name == p.name).map(|g| g.1);
    // A value that is given is not searched.
    let mut shapes: Vec<Vec<(&str, f64)>> = vec![vec![]];
    for p in info.params {
        let values = match (set(p), p.grid) {
            (Some(v), _) => vec![v],
            (None, Grid::None) => continue,
            (None, grid) => grid.values(&scales),
        };
        if values.is_empty() {
            let message = format!("the tests do not say where `{}` of `{}` would lie", p.name, info.name);
            let place = format!("{} at {}", info.name, args.at);
            return Err(Failure::new("effect", place, message, format!("--set {}=VALUE with a unit", p.name)));
        }
        shapes = shapes.iter().flat_map(|s| values.iter().map(|v| [s.as_slice(), &[(p.name, *v)]].concat())).collect();
    }
    let mut all = Vec::new();
    for strong in [false, true] {
        for shape in &shapes {
            let mut values = shape.clone();
            for p in info.params.iter().filter(|p| strong && p.kind == Kind::Strength && set(p).is_none()) {
                let Dim::Place { f, x, t } = p.dim else { continue };
                let time = if scales.v > 0.0 { scales.x / scales.v } else { 0.0 };
                let scale = 0.1 * scales.f.powi(f.into()) * scales.x.powi(x.into()) * time.powi(t.into());
                if scale.is_finite() && scale > 0.0 {
                    values.push((p.name, scale));
                }
            }
            all.push((values.clone(), study.instance(&args.effect, &args.at, &values, of.as_ref())?));
        }
    }
    // Where nothing says how strong it could be, both rounds are one.
    let mut seen: Vec<Vec<(&str, f64)>> = Vec::new();
    all.retain(|(v, _)| {
        !seen.contains(v) && {
            seen.push(v.clone());
            true
        }
    });
    Ok(all.into_iter().map(|(_, i)| i).collect())
}

/// Motion and force at the places of the effect under the fitted tests.
fn scales(case: &Case, site: &Site) -> Result<Scales, Failure> {
    let mut widest = Scales { least_v: f64::INFINITY, periods: (f64::INFINITY, 0.0), ..Scales::default() };
    for plan in case.plans_of(crate::diagnose::results::SplitName::Fit) {
        let (shortest, longest) = plan.periods();
        widest.periods = (widest.periods.0.min(shortest), widest.periods.1.max(longest));
        let Site::Places(places) = site else { continue };
        for a in plan.amplitudes(&case.system)?.iter().flat_map(|all| places.iter().filter_map(|p| all.get(*p))) {
            let least_v = if a.v > 0.0 { widest.least_v.min(a.v) } else { widest.least_v };
            widest = Scales {
                x: widest.x.max(a.x),
                most: widest.most.max(a.most),
                v: widest.v.max(a.v),
                f: widest.f.max(a.f),
                least_v,
                ..widest
            };
        }
    }
    Ok(widest)
}

fn coefficient(args: &Args, study: &Study) -> Result<Option<CoefficientOf>, Failure> {
    let (Some(condition), Some(reference)) = (&args.condition, &args.reference) else { return Ok(None) };
    let known = study.dataset.tests.iter().find_map(|t| t.conditions.get(condition));
    let Some(known) = known else {
        let names: std::collections::BTreeSet<&str> =
            study.dataset.tests.iter().flat_map(|t| t.conditions.keys()).map(String::as_str).collect();
        let accepted = format!("one of {}", names.into_iter().collect::<Vec<_>>().join(", "));
        return Err(Failure::new("cli", "--condition", format!("no test has a condition `{condition}`"), accepted));
    };
    let reference = crate::units::parse(reference, known.unit.dimension)?;
    Ok(Some(CoefficientOf { of: args.of.clone(), condition: condition.clone(), reference }))
}

/// The `--set` values in SI.
fn given(args: &Args, study: &Study, of: &Option<CoefficientOf>) -> Result<Vec<(String, f64)>, Failure> {
    if args.set.is_empty() {
        return Ok(vec![]);
    }
    let info = effect::find(&args.effect)?.info();
    let instance = study.instance(&args.effect, &args.at, &[], of.as_ref())?;
    let one = |(name, value): &(String, String)| {
        let Some(index) = info.param(name) else {
            let names: Vec<&str> = info.params.iter().map(|p| p.name).collect();
            return Err(Failure::new(
                "effect",
                info.name,
                format!("`{}` has no parameter `{name}`", info.name),
                format!("one of {}", names.join(", ")),
            ));
        };
        let dimension = crate::study::dimension_of(&study.system, &study.dataset, &instance, index);
        Ok((name.clone(), crate::units::parse(value, dimension)?))
    };
    args.set.iter().map(one).collect()
}
