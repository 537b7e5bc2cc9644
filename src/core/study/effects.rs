//! `[[effect]]`: the law, where it acts, its values.

use crate::data::toml_strict::{TableView, TomlError, TomlProblem, ValueView};
use crate::data::{Conditions, Dataset, Record, Test};
use crate::effect::{Effect, Info, Kind, Param, Role, Sign};
use crate::explain::Explain;
use crate::model::{AtCondition, Finder, Instance, Model, ModelError, ParamValue, Site, Target};
use crate::units::{Dimension, Unit};

use super::engineering::dimension;
use super::error::at as located;
use super::settings::{effect, unknown};
use super::{StudyError, TestProblem, engineering, formula, levels, site};

/// What a coefficient made by a program acts on; see [`super::Study::instance`].
#[derive(Clone, Debug, PartialEq)]
pub struct CoefficientOf {
    /// `effect.parameter`; none: the strength of the only force effect at the place.
    pub of: Option<String>,
    /// Name of the condition.
    pub condition: String,
    /// Value of the condition at which the factor is 1 [SI].
    pub reference: f64,
}

#[derive(Clone)]
struct Head<'a> {
    table: TableView<'a>,
    effect: &'static Effect,
    at: String,
    site: Site,
    only: Option<AtCondition>,
}

/// Reads every `[[effect]]`.
pub(super) fn read(root: &TableView<'_>, model: &Model, dataset: &Dataset) -> Result<Vec<Instance>, StudyError> {
    let tables = root.tables("effect")?;
    let mut heads: Vec<Head<'_>> = Vec::with_capacity(tables.len());
    let finder = model.finder();
    for table in &tables {
        let head = head(table, &finder, dataset)?;
        let label = format!("{}.{}", head.at, head.effect.info().name);
        match levels::read(table, dataset, &label)? {
            levels::Levels::Any => heads.push(head),
            levels::Levels::Of(list) => heads.extend(list.into_iter().map(|only| Head { only: Some(only), ..head.clone() })),
        }
    }
    let sites: Vec<(&'static Effect, &Site)> = heads.iter().map(|h| (h.effect, &h.site)).collect();
    let at_levels: Vec<bool> = heads.iter().map(|h| h.only.is_some()).collect();
    let mut instances = Vec::with_capacity(heads.len());
    for head in &heads {
        let info = head.effect.info();
        let mut keys = vec!["effect", "at"];
        keys.extend(levels::KEYS);
        keys.extend(info.params.iter().map(|p| p.name));
        if info.role == Role::Coefficient {
            keys.extend(["of", "condition", "reference"]);
        }
        if is_formula(head.effect) {
            keys.extend(formula::KEYS);
        }
        head.table.only(&keys)?;
        let target = match info.role {
            Role::Coefficient => Some(target(head, model, dataset, &sites, &at_levels)?),
            _ => None,
        };
        let condition = target.as_ref().map_or(Dimension::DIMENSIONLESS, |t| t.unit.dimension);
        let (rotational, channel) = site::nature(model, dataset, &head.site);
        let value = |p: &Param| param(&head.table, info, p, dimension(p.dim, rotational, channel, condition));
        let params = info.params.iter().map(value).collect::<Result<Vec<_>, _>>()?;
        let only = head.only.clone();
        instances.push(Instance { target, only, ..Instance::new(head.effect, head.at.clone(), head.site.clone(), params) });
    }
    for (head, instance) in heads.iter().zip(&instances) {
        instance
            .has_company(model, &instances)
            .map_err(|e| head.table.get("at").map_or_else(|| head.table.refuse(e.to_string(), e.accepted()), |v| located(&v, &e)))?;
    }
    Ok(instances)
}

fn head<'a>(table: &TableView<'a>, finder: &Finder, dataset: &Dataset) -> Result<Head<'a>, TomlError> {
    let effect = effect(&table.require("effect", "the name of an effect, such as \"linear_stiffness\"")?)?;
    let value = table.require("at", "a place such as \"c1.x\", a channel such as \"loop-1Hz.force\", or a list of places")?;
    let entries: Vec<ValueView<'a>> = if value.is_list() { value.list()? } else { vec![value.clone()] };
    if entries.is_empty() {
        return Err(value.refuse("an empty list of places", "at least one place"));
    }
    let names = entries.iter().map(|v| v.string()).collect::<Result<Vec<_>, _>>()?;
    let site = site::resolve(finder, dataset, effect, &names).map_err(|(i, e)| located(entries.get(i).unwrap_or(&value), &e))?;
    let effect = match effect {
        Effect::Formula(_) => formula::read(table, site::nature(finder.model, dataset, &site).0)?,
        _ => effect,
    };
    Ok(Head { table: table.clone(), effect, at: names.join(","), site, only: None })
}

/// Deviations of the masses that a study fits: one along all axes in which such a body moves, unless it stands among the effects already.
pub(super) fn masses(graph: &super::GraphSpec, model: &Model, stated: &[Instance]) -> Vec<Instance> {
    let Ok(law) = crate::effect::find("mass_deviation") else { return vec![] };
    let finder = model.finder();
    let one = |(name, body): (String, &super::BodySpec)| -> Option<Instance> {
        let (mass, (least, most)) = (body.mass.as_ref()?, body.mass_range?);
        let places: Vec<usize> = body
            .free
            .iter()
            .filter(|a| !a.rotational())
            .flat_map(|a| finder.places_at(&format!("{name}.{}", a.name())).unwrap_or_default())
            .collect();
        let site = Site::Places(places);
        let there = stated.iter().any(|i| i.name() == "mass_deviation" && i.site == site);
        let value = ParamValue {
            min: least - mass.value,
            max: most - mass.value,
            free: true,
            unit: (mass.unit.symbol.clone(), mass.unit.factor),
            ..ParamValue::fixed(0.0)
        };
        let at = body.free.iter().filter(|a| !a.rotational()).map(|a| format!("{name}.{}", a.name())).collect::<Vec<_>>().join(",");
        (!there && !at.is_empty()).then(|| Instance::new(law, at, site, vec![value]))
    };
    graph.weighed().filter_map(one).collect()
}

/// Whether the law stands in the study file.
pub(super) fn is_formula(effect: &Effect) -> bool {
    matches!(effect, Effect::Force(law) if law.formula().is_some())
}

fn target(
    head: &Head<'_>,
    model: &Model,
    dataset: &Dataset,
    sites: &[(&'static Effect, &Site)],
    at_levels: &[bool],
) -> Result<Target, StudyError> {
    let table = &head.table;
    let of = table.optional("of", |v| v.string())?;
    let (instances, param) = target_of(model, sites, &head.site, of).map_err(|e| match table.get("of").or(table.get("at")) {
        Some(v) => located(&v, &e),
        None => table.refuse(e.to_string(), e.accepted()),
    })?;
    if instances.iter().any(|i| at_levels[*i]) {
        let message = "it acts on an effect whose values are given per value of a condition";
        return Err(table.refuse(message, "either `per` on the effect, or a law over the condition").into());
    }
    let value = table.require("condition", "the name of a condition that every test states, such as \"i\"")?;
    let name = value.string()?;
    let label = format!("{}.{}", head.at, head.effect.info().name);
    let unit = match condition(dataset, name, &label)? {
        Some(unit) => unit,
        None => return Err(no_condition(&value, dataset, name).into()),
    };
    let accepted = format!("the {name} at which the factor is 1 ({})", unit.dimension.examples());
    let reference = table.require("reference", &accepted)?.quantity(unit.dimension)?.value;
    Ok(Target { instances, param, condition: name.to_string(), reference, unit })
}

/// The instances and parameter a coefficient at `site` acts on: `of` as `effect.parameter`, or the strength of the only effect there.
/// Where no one effect covers the site, those of the name that share it out among them.
pub(super) fn target_of(
    model: &Model,
    sites: &[(&'static Effect, &Site)],
    site: &Site,
    of: Option<&str>,
) -> Result<(Vec<usize>, usize), ModelError> {
    let Site::Places(mine) = site else { return Err(ModelError::invalid("at", "a coefficient acts at a place", "a connector's axis")) };
    let covers = |(_, s): &(&Effect, &Site)| mine.iter().all(|m| places_of(s).contains(m));
    let touches = |(_, s): &(&Effect, &Site)| mine.iter().any(|m| places_of(s).contains(m));
    let acting = |e: &Effect| matches!(e, Effect::Force(_) | Effect::Series(_));
    let place = mine.first().map_or(String::new(), |p| model.place_name(*p));
    let here: Vec<usize> = (0..sites.len()).filter(|&i| acting(sites[i].0) && covers(&sites[i])).collect();
    // Every name a target may have; the second effect of a name is `name#2`, as in the names of parameters.
    let mut known: Vec<(String, (Vec<usize>, usize))> = Vec::new();
    for (k, &i) in here.iter().enumerate() {
        let info = sites[i].0.info();
        let before = here[..k].iter().filter(|&&j| sites[j].0.info().name == info.name).count();
        let number = if before > 0 { format!("#{}", before + 1) } else { String::new() };
        known.extend(info.params.iter().enumerate().map(|(p, param)| (format!("{}{number}.{}", info.name, param.name), (vec![i], p))));
    }
    for &(effect, _) in sites.iter().filter(|s| acting(s.0) && touches(s)) {
        let info = effect.info();
        if known.iter().any(|k| k.0.starts_with(&format!("{}.", info.name))) {
            continue;
        }
        let group: Vec<usize> = (0..sites.len()).filter(|&i| sites[i].0.info().name == info.name && touches(&sites[i])).collect();
        let mut theirs: Vec<usize> = group.iter().flat_map(|&i| places_of(sites[i].1)).copied().collect();
        theirs.sort_unstable();
        let mut asked = mine.clone();
        asked.sort_unstable();
        if theirs == asked {
            known.extend(info.params.iter().enumerate().map(|(p, param)| (format!("{}.{}", info.name, param.name), (group.clone(), p))));
        }
    }
    let Some(of) = of else {
        let mut force = here.iter().filter(|&&i| matches!(sites[i].0, Effect::Force(_)));
        return match (force.next(), force.next()) {
            (Some(&i), None) => Ok((vec![i], 0)),
            (None, _) if sites.iter().any(|s| acting(s.0) && touches(s)) => Err(ModelError::invalid(
                &place,
                "the coefficient covers places that do not share one value".to_string(),
                "`of`, where effects of one name share these places out among them, or one [[effect]] for each effect it acts on",
            )),
            (None, _) => Err(ModelError::invalid(&place, format!("no force effect acts at `{place}`"), "a place with a force effect")),
            _ => {
                let names = known.iter().map(|k| k.0.as_str()).collect::<Vec<_>>().join(", ");
                Err(ModelError::invalid(
                    &place,
                    format!("several effects act at `{place}`, and no key `of` says which is meant"),
                    format!("of = one of {names}"),
                ))
            }
        };
    };
    known
        .iter()
        .find(|k| k.0 == of)
        .map(|k| k.1.clone())
        .ok_or_else(|| ModelError::no_such("parameter", of, known.into_iter().map(|k| k.0)))
}

/// The places of a site; none for a channel and for the geometry.
fn places_of(site: &Site) -> &[usize] {
    match site {
        Site::Places(places) => places,
        Site::Channel(_) | Site::Outline(_) => &[],
    }
}

/// The name of a target as `of` takes it.
pub(super) fn of_name(model: &Model, instances: &[Instance], at: &Site, target: &Target) -> String {
    let sites: Vec<(&'static Effect, &Site)> = instances.iter().map(|i| (i.effect, &i.site)).collect();
    let Some(info) = instances.get(target.instances[0]).map(|i| i.effect.info()) else { return String::new() };
    let param = info.params.get(target.param).map_or("", |p| p.name);
    let name = |n: usize| if n > 1 { format!("{}#{n}.{param}", info.name) } else { format!("{}.{param}", info.name) };
    let meant = |n: &usize| target_of(model, &sites, at, Some(&name(*n))) == Ok((target.instances.clone(), target.param));
    name((1..=instances.len()).find(meant).unwrap_or(1))
}

/// That no test states a condition of this name.
pub(super) fn no_condition(value: &ValueView<'_>, dataset: &Dataset, name: &str) -> TomlError {
    unknown(value, "condition", name, stated(dataset).into_iter())
}

/// Names of the conditions that any test states.
pub(super) fn stated(dataset: &Dataset) -> Vec<&str> {
    let mut names: Vec<&str> = dataset.tests.iter().flat_map(|t| conditions_of(t)).flat_map(Conditions::keys).map(String::as_str).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The conditions of a test: those of every row where a table states them by row.
pub(super) fn conditions_of(test: &Test) -> Vec<&Conditions> {
    match &test.record {
        Record::Energy(table) => table.rows.iter().map(|r| &r.conditions).collect(),
        _ => vec![&test.conditions],
    }
}

/// The unit of a condition, which every test must state in one dimension; none when no test states it.
pub(super) fn condition(dataset: &Dataset, name: &str, needed_by: &str) -> Result<Option<Unit>, StudyError> {
    let Some(unit) = engineering::condition(dataset, name) else { return Ok(None) };
    for test in &dataset.tests {
        for conditions in conditions_of(test) {
            match conditions.get(name) {
                None => {
                    let message = format!("it does not state the condition `{name}`, which `{needed_by}` needs");
                    return Err(problem(dataset, test, name, message, format!("conditions = {{ {name} = \"... {}\" }}", unit.symbol)));
                }
                Some(c) if c.unit.dimension != unit.dimension => {
                    let message = format!("it is a {}, and a {} in another test", c.unit.dimension.name(), unit.dimension.name());
                    return Err(problem(dataset, test, name, message, "one dimension in every test".into()));
                }
                Some(_) => {}
            }
        }
    }
    Ok(Some(unit))
}

fn problem(dataset: &Dataset, test: &Test, name: &str, message: String, accepted: String) -> StudyError {
    let about = format!("condition `{name}`");
    TestProblem { file: dataset.file.clone(), line: test.line, test: test.id.clone(), about, message, accepted }.into()
}

fn param(table: &TableView<'_>, info: &Info, p: &Param, dimension: Dimension) -> Result<ParamValue, TomlError> {
    let Some(value) = table.get(p.name) else {
        if p.kind == Kind::Setting {
            return Ok(ParamValue::of(p, p.default));
        }
        let accepted = format!("{} = \"...\" of `{}`, in {}: {}", p.name, info.name, dimension.examples(), p.doc);
        return Err(table.error(TomlProblem::MissingKey { key: p.name.into(), accepted }));
    };
    let setting = p.kind == Kind::Setting;
    let spec = value.parameter(dimension, if setting { &["free"] } else { &[] })?;
    let inner = |key: &str| if value.is_table() { value.table().ok().and_then(|t| t.get(key)) } else { None };
    let at = |key: &str| inner(key).unwrap_or_else(|| value.clone());
    let print = |si: f64| spec.start.unit.print(si);
    if let Some(min) = spec.min.filter(|m| *m < p.min) {
        let beyond = if p.min == 0.0 { "be negative".to_string() } else { format!("fall below {}", print(p.min)) };
        let message = format!("min {} lets `{}` {beyond}", print(min), p.name);
        return Err(at("min").refuse(message, format!("a min of {} or more", if p.min == 0.0 { "0".into() } else { print(p.min) })));
    }
    if let Some(max) = spec.max.filter(|m| *m > p.max) {
        let message = format!("max {} lets `{}` exceed {}", print(max), p.name, print(p.max));
        return Err(at("max").refuse(message, format!("a max of {} or less", print(p.max))));
    }
    let start = spec.start.value;
    if (p.sign == Sign::NonNegative && start < 0.0) || (p.sign == Sign::Positive && start <= 0.0) {
        return Err(at("start").refuse(format!("`{}` is {}", p.name, spec.start), format!("a value {}", p.sign.word())));
    }
    if start < p.min || start > p.max {
        return Err(at("start").refuse(format!("`{}` is {}", p.name, spec.start), format!("{} to {}", print(p.min), print(p.max))));
    }
    let asked = inner("free").map(|v| v.bool()).transpose()?;
    if asked.is_some() && inner("fixed").is_some() {
        return Err(at("free").refuse("free and fixed both stand there", "one of them"));
    }
    if spec.slack.is_some() && info.name != "linear_stiffness" {
        return Err(at("slack").refuse(
            format!("slack of `{}`", info.name),
            "slack at the k of linear_stiffness and at the mass of a body: what a study ties or fixes of the structure",
        ));
    }
    // Bounds of a setting, or `fixed = false`, ask for it to be fitted.
    let fitted = !spec.fixed && (!setting || inner("fixed").is_some() || spec.min.is_some() || spec.max.is_some());
    Ok(ParamValue {
        value: start,
        min: spec.min.unwrap_or(p.min),
        max: spec.max.unwrap_or(p.max),
        free: asked.unwrap_or(fitted),
        prior: spec.prior.map(|p| (p.mean, p.sigma)),
        slack: spec.slack,
        unit: (spec.start.unit.symbol.clone(), spec.start.unit.factor),
    })
}
