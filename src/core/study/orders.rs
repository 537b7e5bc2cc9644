//! `[[order]]`: monotone orders, and the constraints of a fit.

use crate::data::Dataset;
use crate::data::toml_strict::{TableView, TomlError};
use crate::explain::Explain;
use crate::identify::{Constraints, IdentifyError, Prior};
use crate::model::{FreeParam, System};

use super::engineering::{dimension_of, unit_of};
use super::levels;
use super::settings::unknown;

/// below + gap <= above.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderSpec {
    /// Name of the smaller parameter, as [`System::free`] has it.
    pub below: String,
    /// Name of the greater one.
    pub above: String,
    /// Least difference [SI].
    pub gap: f64,
    /// Line in study.toml.
    pub line: usize,
}

/// Reads every `[[order]]` and refuses what no point satisfies.
pub(super) fn read(root: &TableView<'_>, system: &System, dataset: &Dataset) -> Result<Vec<OrderSpec>, TomlError> {
    let free = system.free();
    let mut orders: Vec<OrderSpec> = levels::orders(root, system)?;
    for table in root.tables("order")? {
        table.only(&["order", "gap"])?;
        let list = table.require("order", "[\"c1.x.viscous.c\", \"c2.x.viscous.c\"], in rising order")?;
        let mut members: Vec<&FreeParam> = Vec::new();
        for v in list.list()? {
            let name = v.string()?;
            let Some(param) = free.iter().find(|f| f.name == name) else {
                return Err(unknown(&v, "free parameter", name, free.iter().map(|f| f.name.as_str())));
            };
            if members.contains(&param) {
                return Err(v.refuse(format!("`{name}` stands twice in one order"), "each parameter once"));
            }
            members.push(param);
        }
        if members.len() < 2 {
            return Err(list.refuse("an order of fewer than two parameters", "at least two names in rising order"));
        }
        let dimension = |f: &FreeParam| dimension_of(system, dataset, &system.instances[f.instance], f.param);
        if let Some(odd) = members.iter().find(|f| dimension(f) != dimension(members[0])) {
            let message =
                format!("`{}` is a {} and `{}` a {}", members[0].name, dimension(members[0]).name(), odd.name, dimension(odd).name());
            return Err(list.refuse(message, "parameters of one dimension"));
        }
        let gap = table.optional("gap", |v| {
            let gap = v.quantity(dimension(members[0]))?;
            if gap.value < 0.0 {
                return Err(v.refuse(format!("a gap of {gap}"), "a gap of 0 or more"));
            }
            // The fit moves the logarithm of a positive shape: there a difference is no linear constraint.
            if gap.value > 0.0 && members.iter().any(|f| f.log) {
                return Err(v.refuse("a gap between shape parameters, which are fitted by their logarithms", "an order without gap"));
            }
            Ok(gap.value)
        })?;
        if let Some(odd) = members.iter().find(|f| f.log != members[0].log) {
            let message = format!("one of `{}` and `{}` is fitted by its logarithm, the other is not", members[0].name, odd.name);
            return Err(list.refuse(message, "strengths alone, or shapes without prior alone"));
        }
        let pair =
            |w: &[&FreeParam]| OrderSpec { below: w[0].name.clone(), above: w[1].name.clone(), gap: gap.unwrap_or(0.0), line: list.line() };
        orders.extend(members.windows(2).map(pair));
        // Checked one declaration at a time: the first that cannot be satisfied together with those before it is the one to name.
        constraints(&orders, system, &free, dataset).map_err(|e| list.refuse(e.to_string(), e.accepted()))?;
    }
    Ok(orders)
}

/// Bounds and orders in the variables of the fit (logarithms where [`FreeParam::log`]), checked. Orders on parameters that `free` does
/// not hold are left out: they act on nothing.
pub(super) fn constraints(
    orders: &[OrderSpec],
    system: &System,
    free: &[FreeParam],
    dataset: &Dataset,
) -> Result<Constraints, IdentifyError> {
    let variable = |f: &FreeParam, value: f64| if f.log { value.max(0.0).ln() } else { value };
    let value = |f: &FreeParam| &system.instances[f.instance].params[f.param];
    let mut all = Constraints::bounds(
        free.iter().map(|f| variable(f, value(f).min)).collect(),
        free.iter().map(|f| variable(f, value(f).max)).collect(),
    );
    let index = |name: &str| free.iter().position(|f| f.name == name);
    for order in orders {
        if let (Some(below), Some(above)) = (index(&order.below), index(&order.above))
            && free[below].log == free[above].log
        {
            all = all.order(below, above, order.gap);
        }
    }
    let names: Vec<String> = free.iter().map(|f| f.name.clone()).collect();
    match all.validate(&names) {
        Ok(()) => Ok(all),
        // In the engineer's units: the numbers of the fit are SI, or logarithms.
        Err(IdentifyError::Infeasible { .. }) => {
            Err(IdentifyError::Infeasible { constraints: in_units(&all, orders, system, free, dataset) })
        }
        Err(e) => Err(e),
    }
}

/// The bounds of every ordered parameter and the orders between them, as text.
fn in_units(all: &Constraints, orders: &[OrderSpec], system: &System, free: &[FreeParam], dataset: &Dataset) -> Vec<String> {
    let mut text = Vec::new();
    for (j, f) in free.iter().enumerate().filter(|(j, _)| all.orders.iter().any(|o| o.below == *j || o.above == *j)) {
        let instance = &system.instances[f.instance];
        let (value, unit) = (&instance.params[f.param], unit_of(system, dataset, instance, f.param));
        if all.lower[j].is_finite() {
            text.push(format!("{} >= {}", f.name, unit.print(value.min)));
        }
        if all.upper[j].is_finite() {
            text.push(format!("{} <= {}", f.name, unit.print(value.max)));
        }
    }
    for o in orders {
        let plus = free
            .iter()
            .find(|f| f.name == o.below && o.gap > 0.0)
            .map_or(String::new(), |f| format!(" + {}", unit_of(system, dataset, &system.instances[f.instance], f.param).print(o.gap)));
        text.push(format!("{}{plus} <= {}", o.below, o.above));
    }
    text
}

/// Priors of the free parameters that have one, in the variables of the fit (a parameter with a prior is never a logarithm).
pub(super) fn priors(system: &System, free: &[FreeParam]) -> Vec<Prior> {
    let prior = |(index, f): (usize, &FreeParam)| {
        system.instances[f.instance].params[f.param].prior.map(|(mean, sigma)| Prior { index, mean, sigma })
    };
    free.iter().enumerate().filter_map(prior).collect()
}
