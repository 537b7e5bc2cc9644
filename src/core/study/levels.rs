//! `per` and `only` of an `[[effect]]`: values of their own at each value of a condition.
//!
//! `per = "i"` makes one instance of the effect for every value of `i` that the tests state, each with its own values; `monotone =
//! "rising"` or `"falling"` orders their strengths along `i`. It is what a law over the condition (interference_law) is held against.
//! `only = { i = "0.3 mm" }` is one of these instances by itself, which is how a fitted study is written.

use crate::data::Dataset;
use crate::data::toml_strict::{TableView, TomlError};
use crate::effect::Kind;
use crate::model::{AtCondition, FreeParam, Instance, System};

use super::effects::{condition, conditions_of, no_condition};
use super::{OrderSpec, StudyError};

/// Keys of an `[[effect]]` that are read here.
pub(super) const KEYS: [&str; 3] = ["per", "monotone", "only"];

/// The values of a condition an effect is given for.
pub(super) enum Levels {
    /// One set of values for every test.
    Any,
    /// One instance each, rising.
    Of(Vec<AtCondition>),
}

/// Reads `per` or `only`; `label` names the effect in errors.
pub(super) fn read(table: &TableView<'_>, dataset: &Dataset, label: &str) -> Result<Levels, StudyError> {
    let (per, only) = (table.get("per"), table.get("only"));
    if let (Some(monotone), None) = (table.get("monotone"), &per) {
        return Err(monotone.refuse("an order along no condition", "`per = \"i\"` beside it").into());
    }
    match (per, only) {
        (None, None) => Ok(Levels::Any),
        (Some(_), Some(only)) => Err(only.refuse("`per` and `only` both stand there", "one of them").into()),
        (Some(per), None) => {
            let name = per.string()?;
            let Some(unit) = condition(dataset, name, label)? else { return Err(no_condition(&per, dataset, name).into()) };
            let mut values: Vec<f64> = dataset.tests.iter().flat_map(conditions_of).filter_map(|c| c.get(name).map(|c| c.value)).collect();
            values.sort_unstable_by(f64::total_cmp);
            values.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * a.abs().max(b.abs()));
            if values.len() < 2 {
                return Err(per.refuse(format!("every test has the same `{name}`"), "a condition that differs between tests").into());
            }
            let level = |value: f64| AtCondition { name: name.to_string(), value, printed: unit.print(value) };
            Ok(Levels::Of(values.into_iter().map(level).collect()))
        }
        (None, Some(only)) => {
            let only_table = only.table()?;
            let entries: Vec<_> = only_table.entries().collect();
            let [(name, value)] = entries.as_slice() else {
                return Err(only.refuse("not one condition", "only = { i = \"0.3 mm\" }").into());
            };
            let Some(unit) = condition(dataset, name, label)? else { return Err(no_condition(value, dataset, name).into()) };
            let value = value.quantity(unit.dimension)?.value;
            Ok(Levels::Of(vec![AtCondition { name: name.to_string(), value, printed: unit.print(value) }]))
        }
    }
}

/// The orders that `monotone` asks for: of the strengths of one effect, from one value of its condition to the next.
pub(super) fn orders(root: &TableView<'_>, system: &System) -> Result<Vec<OrderSpec>, TomlError> {
    let free = system.free();
    let strengths = |k: usize| -> Vec<&FreeParam> {
        let strength = |f: &&FreeParam| system.instances[k].effect.info().params[f.param].kind == Kind::Strength;
        free.iter().filter(|f| f.instance == k).filter(strength).collect()
    };
    let mut orders = Vec::new();
    let mut next = 0;
    for table in root.tables("effect")? {
        let first = next;
        let of_one_table = |a: &Instance, b: &Instance| a.at == b.at && a.name() == b.name();
        // The instances of one table stand together, each at a higher value than the one before.
        next += 1;
        if table.get("per").is_some() {
            let value = |k: usize| system.instances[k].only.as_ref().map_or(f64::NAN, |o| o.value);
            while next < system.instances.len()
                && of_one_table(&system.instances[next - 1], &system.instances[next])
                && value(next) > value(next - 1)
            {
                next += 1;
            }
        }
        let Some(monotone) = table.get("monotone") else { continue };
        let rising = match monotone.string()? {
            "rising" => true,
            "falling" => false,
            other => return Err(monotone.refuse(format!("`{other}` is no order"), "\"rising\" or \"falling\"")),
        };
        for k in first + 1..next {
            for (a, b) in strengths(k - 1).into_iter().zip(strengths(k)) {
                let (below, above) = if rising { (a, b) } else { (b, a) };
                orders.push(OrderSpec { below: below.name.clone(), above: above.name.clone(), gap: 0.0, line: monotone.line() });
            }
        }
    }
    Ok(orders)
}
