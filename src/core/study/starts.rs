//! The values of a model put into the text of a study.toml in place of its starts; everything else of the text stays as it is.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::data::Dataset;
use crate::model::{Instance, System};
use crate::units::{Unit, parse};

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
                    let value = short(&unit_of(system, dataset, own, p), new.params[p].value, (new.params[p].min, new.params[p].max));
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

/// A start as it is written into the file of a reader: in few digits, unless these lie outside the bounds.
pub(super) fn short(unit: &Unit, value: f64, (min, max): (f64, f64)) -> String {
    let text = unit.print_short(value);
    let within = parse(&text, unit.dimension).is_ok_and(|v| v >= min && v <= max);
    if within { text } else { unit.print(value) }
}

/// The tables of a list of tables.
fn tables<'a, 'b>(root: &'a DeTable<'b>, key: &str) -> Vec<&'a DeTable<'b>> {
    let list = root.get(key).and_then(|v| v.get_ref().as_array());
    list.map_or(vec![], |all| all.iter().filter_map(|v| v.get_ref().as_table()).collect())
}

/// Where a block acts, as an instance says it.
fn at_of(block: &DeTable) -> Option<String> {
    let at = block.get("at")?.get_ref();
    let list = at.as_array().map(|all| all.iter().filter_map(|v| v.get_ref().as_str()).collect::<Vec<_>>().join(","));
    list.or_else(|| at.as_str().map(String::from)).map(|at| at.replace(' ', ""))
}

/// The block each instance was read from; none of those that a block made several of, of what no block states, and of what stands elsewhere by now: the file
/// may have been edited since it was read.
fn blocks_of<'a, 'b>(blocks: &[&'a DeTable<'b>], instances: &[Instance]) -> Vec<Option<&'a DeTable<'b>>> {
    let mut of = Vec::new();
    for block in blocks {
        let (name, at) = (block.get("effect").and_then(|v| v.get_ref().as_str()), at_of(block));
        let several = block.contains_key("per");
        // Those of one block stand one after the other.
        let is_next = |i: &&Instance| Some(i.name()) == name && Some(i.at.replace(' ', "")) == at;
        let own = instances.iter().skip(of.len()).take_while(is_next).take(if several { usize::MAX } else { 1 }).count();
        of.extend(std::iter::repeat_n((!several).then_some(*block), own));
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::study::Study;

    /// Every study of the repository, its free values a little off, reads back with them; what cannot be written is named, and stays.
    #[test]
    fn values_are_put_into_the_text_of_every_study() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../studies");
        let mut written = 0;
        for study in std::fs::read_dir(folder).unwrap().filter_map(|e| Study::load(&e.unwrap().path(), None).ok()) {
            let mut to = study.system.instances.clone();
            for p in to.iter_mut().flat_map(|i| &mut i.params).filter(|p| p.free) {
                p.value = (1.001 * p.value).clamp(p.min, p.max);
            }
            let text = std::fs::read_to_string(&study.file).unwrap();
            let (whole, kept) = moved(&text, &study.system, &study.dataset, &to);
            assert_eq!(whole.lines().count(), text.lines().count());
            assert!(kept.is_empty() || text.contains("per = "), "{}: {kept:?}", study.file.display());
            // Of an effect that stands elsewhere by now the values stay.
            let elsewhere = text.replace("at = \"c", "at = \"d");
            let (other, stays) = moved(&elsewhere, &study.system, &study.dataset, &to);
            assert!(other == elsewhere || stays.len() > kept.len() || !text.contains("at = \"c"), "{}", study.file.display());
            let again = study.reread(&study.file, whole).unwrap();
            for ((own, new), read) in study.system.instances.iter().zip(&to).zip(&again.system.instances) {
                for (k, param) in own.effect.info().params.iter().enumerate() {
                    let name = format!("{}.{}.{}", own.at, own.name(), param.name);
                    let wanted = if kept.contains(&name) { own.params[k].value } else { new.params[k].value };
                    approx::assert_relative_eq!(read.params[k].value, wanted, max_relative = 1e-9);
                    written += usize::from(wanted != own.params[k].value);
                }
            }
        }
        assert!(written > 50, "{written} values");
    }
}
