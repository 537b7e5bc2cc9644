//! The values of a model put into the text of a study.toml in place of its starts; everything else of the text stays as it is.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::data::Dataset;
use crate::model::{Instance, System};

use super::engineering::unit_of;

/// Relative difference of values that are written alike.
const SAME: f64 = 1e-12;

/// The text with the values of `to`, instances as those of `system` that it was read as, and the names of the parameters whose values stand nowhere in it:
/// those that are not stated, and those given per value of a condition.
pub(super) fn moved(text: &str, system: &System, dataset: &Dataset, to: &[Instance]) -> (String, Vec<String>) {
    let mut places: Vec<(Range<usize>, String)> = Vec::new();
    let mut kept = Vec::new();
    let body = text.strip_prefix('\u{feff}').unwrap_or(text);
    let shift = text.len() - body.len();
    let parsed = DeTable::parse(body).ok();
    let blocks = parsed.as_ref().map_or(vec![], |root| tables(root.get_ref(), "effect"));
    let of_block = blocks_of(&blocks, &system.instances);
    let changed = |a: f64, b: f64| (a - b).abs() > SAME * a.abs().max(b.abs());
    for (k, (own, new)) in system.instances.iter().zip(to).enumerate() {
        for (p, param) in own.effect.info().params.iter().enumerate().filter(|(p, _)| changed(own.params[*p].value, new.params[*p].value)) {
            match of_block.get(k).copied().flatten().and_then(|block| start(block, param.name)) {
                Some(span) => {
                    let value = unit_of(system, dataset, own, p).print(new.params[p].value);
                    places.push((span.start + shift..span.end + shift, toml::Value::from(value).to_string()));
                }
                None => kept.push(format!("{}.{}.{}", own.at, own.name(), param.name)),
            }
        }
    }
    places.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    let mut whole = text.to_string();
    places.into_iter().for_each(|(span, value)| whole.replace_range(span, &value));
    (whole, kept)
}

/// The tables of a list of tables.
fn tables<'a, 'b>(root: &'a DeTable<'b>, key: &str) -> Vec<&'a DeTable<'b>> {
    let list = root.get(key).and_then(|v| v.get_ref().as_array());
    list.map_or(vec![], |all| all.iter().filter_map(|v| v.get_ref().as_table()).collect())
}

/// The block each instance was read from; none of those that a block made several of, and of what no block states.
fn blocks_of<'a, 'b>(blocks: &[&'a DeTable<'b>], instances: &[Instance]) -> Vec<Option<&'a DeTable<'b>>> {
    let mut of = Vec::new();
    for block in blocks {
        let name = block.get("effect").and_then(|v| v.get_ref().as_str());
        let several = block.contains_key("per");
        let at = instances.get(of.len()).map(|i| i.at.clone());
        // Those of one block stand one after the other at the same place.
        while let Some(_) = instances.get(of.len()).filter(|i| Some(i.name()) == name && (!several || Some(&i.at) == at.as_ref())) {
            of.push((!several).then_some(*block));
            if !several {
                break;
            }
        }
    }
    of
}

/// Where the start of a parameter stands: its quantity, or that under `start`.
fn start(block: &DeTable, name: &str) -> Option<Range<usize>> {
    let quantity = |v: &Spanned<DeValue>| v.get_ref().as_str().is_some().then(|| v.span());
    let stated = block.get(name)?;
    match stated.get_ref().as_table() {
        Some(table) => quantity(table.get("start")?),
        None => quantity(stated),
    }
}
