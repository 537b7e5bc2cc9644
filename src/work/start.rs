//! Parameters that begin from other values than those of the study: by name on the command line, by place in the model on the page.

use std::collections::BTreeMap;

use crate::explain::Explain;
use crate::model::{FreeParam, System};
use crate::study::{Study, unit_of};
use crate::units::Unit;

use super::Failure;

/// The system of a study with starts such as `c1.x.viscous.c` = `120 N s/m`, free or fixed; every start with its unit.
///
/// # Errors
/// A name that no parameter of the study has, a value that cannot be read or lies outside the bounds of its parameter.
pub fn started(study: &Study, starts: &[(String, String)]) -> Result<System, Failure> {
    let mut system = study.system.clone();
    let all = system.params();
    for (name, text) in starts {
        let Some(of) = all.iter().find(|f| f.name == *name) else {
            let names: Vec<&str> = all.iter().map(|f| f.name.as_str()).take(NAMES).collect();
            let more = if all.len() > NAMES { ", ..." } else { "" };
            let accepted = format!("{}{more}", names.join(", "));
            return Err(Failure::new("cli", "--start", format!("there is no parameter `{name}`"), accepted));
        };
        let unit = unit(study, &system, of);
        let value = crate::units::parse(text, unit.dimension).map_err(|e| Failure::new("cli", name, e.to_string(), e.accepted()))?;
        set(&mut system, of, value, &unit, "cli")?;
    }
    system.check()?;
    Ok(system)
}

/// Names that are told where there is no such parameter.
const NAMES: usize = 40;

/// A system with other values [SI] of parameters, each known by its place in the model, `instance.parameter`.
///
/// # Errors
/// A place without a parameter, a value outside the bounds of its parameter.
pub fn with_values(study: &Study, system: &System, values: &BTreeMap<String, f64>) -> Result<System, Failure> {
    let mut started = system.clone();
    for (of, value) in placed(system, values)? {
        let unit = unit(study, system, &of);
        set(&mut started, &of, value, &unit, "serve")?;
    }
    started.check()?;
    Ok(started)
}

/// What `--start` is given for these values: `c1.x.viscous.c=120 N s/m`.
///
/// # Errors
/// A place without a parameter.
pub fn starts(study: &Study, system: &System, values: &BTreeMap<String, f64>) -> Result<Vec<String>, Failure> {
    let told = |(of, value): (FreeParam, f64)| format!("{}={}", of.name, unit(study, system, &of).print(value));
    Ok(placed(system, values)?.into_iter().map(told).collect())
}

/// The parameters that the values are of.
fn placed(system: &System, values: &BTreeMap<String, f64>) -> Result<Vec<(FreeParam, f64)>, Failure> {
    if values.is_empty() {
        return Ok(vec![]);
    }
    let all = system.params();
    let one = |(key, value): (&String, &f64)| {
        let place = key.split_once('.').and_then(|(i, p)| Some((i.parse::<usize>().ok()?, p.parse::<usize>().ok()?)));
        let of = place.and_then(|place| all.iter().find(|f| (f.instance, f.param) == place));
        let none = || Failure::new("serve", key, "there is no such parameter", "`instance.parameter`, such as 0.0");
        Ok((of.ok_or_else(none)?.clone(), *value))
    };
    values.iter().map(one).collect()
}

fn unit(study: &Study, system: &System, of: &FreeParam) -> Unit {
    unit_of(system, &study.dataset, &system.instances[of.instance], of.param)
}

fn set(system: &mut System, of: &FreeParam, value: f64, unit: &Unit, stage: &str) -> Result<(), Failure> {
    let param = &mut system.instances[of.instance].params[of.param];
    if !(param.min..=param.max).contains(&value) {
        let accepted = match (param.min.is_finite(), param.max.is_finite()) {
            (true, true) => format!("{} to {}", unit.print(param.min), unit.print(param.max)),
            (true, false) => format!("{} or more", unit.print(param.min)),
            _ => format!("{} or less", unit.print(param.max)),
        };
        return Err(Failure::new(stage, &of.name, format!("{} lies outside the bounds of the parameter", unit.print(value)), accepted));
    }
    param.value = value;
    Ok(())
}
