//! An effect added to a model: every start worth trying, each refitted, the best kept.

use crate::diagnose::results::{FitResult, SplitName};
use crate::diagnose::{self, Case, Fitted};
use crate::effect::{self, Dim, Grid, Kind, Param, Scales};
use crate::identify::Monitor;
use crate::model::{Instance, Site, System};
use crate::study::{CoefficientOf, Study};

use super::Failure;

/// The effect that is to be added.
#[derive(Clone, Debug, Default)]
pub struct Wish {
    /// Name in the library.
    pub effect: String,
    /// Place such as `c1.x`, `c1-7.x`, or channel such as `loop-1Hz.force`.
    pub at: String,
    /// Starts by parameter name, with unit. A value that is given is not searched.
    pub set: Vec<(String, String)>,
    /// Of a coefficient: the parameter that it scales, such as `viscous.c`.
    pub of: Option<String>,
    /// Of a coefficient: the condition.
    pub condition: Option<String>,
    /// Of a coefficient: value of the condition at which the factor is 1, with unit.
    pub reference: Option<String>,
}

/// The model with the effect.
pub struct Refitted {
    /// The effect, at its fitted values; the last of the model's.
    pub instance: Instance,
    /// The case, in as many time steps as the fit needed.
    pub case: Case,
    /// The fit.
    pub fitted: Fitted,
    /// The same, told.
    pub result: FitResult,
}

/// Refits `system` with the effect from every start and keeps the best; none where the monitor stopped it before it was done.
///
/// # Errors
/// Wishes that the study refuses, and a model that works from no start.
pub fn refit(
    study: &Study,
    case: &Case,
    system: &System,
    wish: &Wish,
    splits: &[SplitName],
    monitor: &Monitor,
    say: &dyn Fn(&str),
) -> Result<Option<Refitted>, Failure> {
    let mut best: Option<(Case, Fitted, FitResult)> = None;
    let mut first_failure = None;
    for (k, instance) in starts(wish, &with_model(study, system), case)?.into_iter().enumerate() {
        say(&format!("refit with {} at {}, start {}", wish.effect, wish.at, k + 1));
        let mut with = case.clone();
        with.system = system.clone();
        with.system.instances.push(instance);
        match diagnose::fit(&with, splits, monitor) {
            Ok((_, _, result)) if result.termination == "failed" => {}
            Ok(done) if best.as_ref().is_none_or(|b| done.2.cost < b.2.cost) => best = Some(done),
            Ok(_) => {}
            Err(e) => first_failure = first_failure.or(Some(Failure::from(e))),
        }
        if monitor.stops() {
            return Ok(None);
        }
    }
    let Some((case, fitted, result)) = best else {
        let message = "the refit works from no start; study.toml is as it was";
        return Err(first_failure.unwrap_or_else(|| {
            Failure::new("identify", format!("{} at {}", wish.effect, wish.at), message, "--set with a start that works")
        }));
    };
    let Some(instance) = fitted.system.instances.last().cloned() else {
        return Err(Failure::new("identify", "", "the refit lost the effect", "another start"));
    };
    Ok(Some(Refitted { instance, case, fitted, result }))
}

/// The study with the model that an effect is added to: a law acts on what stands in the model, which may be more than study.toml has.
fn with_model(study: &Study, system: &System) -> Study {
    Study { system: system.clone(), ..study.clone() }
}

/// The new effect at every start worth trying: strengths at none and at a tenth of what acts there, shapes over their grid.
fn starts(wish: &Wish, study: &Study, case: &Case) -> Result<Vec<Instance>, Failure> {
    let info = effect::find(&wish.effect)?.info();
    let of = coefficient(wish, study)?;
    let site = study.site(&wish.effect, &wish.at)?;
    let scales = scales(case, &site)?;
    let given = given(wish, study, &of)?;
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
            let place = format!("{} at {}", info.name, wish.at);
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
            all.push((values.clone(), study.instance(&wish.effect, &wish.at, &values, of.as_ref())?));
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
    let mut widest = Scales::NONE;
    for plan in case.plans_of(SplitName::Fit) {
        widest = widest.with(Scales { periods: plan.periods(), ..Scales::NONE });
        let Site::Places(places) = site else { continue };
        for a in plan.amplitudes(&case.system)?.iter().flat_map(|all| places.iter().filter_map(|p| all.get(*p))) {
            widest = widest.with((*a).into());
        }
    }
    Ok(widest)
}

fn coefficient(wish: &Wish, study: &Study) -> Result<Option<CoefficientOf>, Failure> {
    let (Some(condition), Some(reference)) = (&wish.condition, &wish.reference) else { return Ok(None) };
    let known = study.dataset.tests.iter().find_map(|t| t.conditions.get(condition));
    let Some(known) = known else {
        let names: std::collections::BTreeSet<&str> =
            study.dataset.tests.iter().flat_map(|t| t.conditions.keys()).map(String::as_str).collect();
        let accepted = format!("one of {}", names.into_iter().collect::<Vec<_>>().join(", "));
        return Err(Failure::new("cli", "--condition", format!("no test has a condition `{condition}`"), accepted));
    };
    let reference = crate::units::parse(reference, known.unit.dimension)?;
    Ok(Some(CoefficientOf { of: wish.of.clone(), condition: condition.clone(), reference }))
}

/// The `--set` values in SI.
fn given(wish: &Wish, study: &Study, of: &Option<CoefficientOf>) -> Result<Vec<(String, f64)>, Failure> {
    if wish.set.is_empty() {
        return Ok(vec![]);
    }
    let info = effect::find(&wish.effect)?.info();
    let instance = study.instance(&wish.effect, &wish.at, &[], of.as_ref())?;
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
    wish.set.iter().map(one).collect()
}

/// `system` with the effect as it is wished for, before a fit.
pub fn wished(wish: &Wish, study: &Study, system: &System) -> Result<System, Failure> {
    let mut study = with_model(study, system);
    let of = coefficient(wish, &study)?;
    let instance = study.instance(&wish.effect, &wish.at, &[], of.as_ref())?;
    study.system.instances.push(instance);
    Ok(study.system)
}
