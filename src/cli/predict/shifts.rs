//! Shifts of natural frequencies between tests, mode by mode.

use crate::cli::table::{significant, table};
use crate::predict::{Shift, over_none};

/// Distinct values in the order in which they come.
fn distinct<T: PartialEq + Clone>(values: impl Iterator<Item = T>) -> Vec<T> {
    values.fold(vec![], |mut list, v| {
        if !list.contains(&v) {
            list.push(v);
        }
        list
    })
}

/// A row a mode, a column a test, and the error over no shift of both.
pub(super) fn text(shifts: &[Shift]) -> String {
    let Some(all) = over_none(shifts.iter()) else { return String::new() };
    let (tests, modes) = (distinct(shifts.iter().map(|s| s.test.clone())), distinct(shifts.iter().map(|s| s.mode)));
    let ratio = |wanted: &dyn Fn(&Shift) -> bool| over_none(shifts.iter().filter(|s| wanted(s))).map_or("-".into(), |r| significant(r, 3));
    let of = |mode: u32, test: &str| {
        let one = shifts.iter().find(|s| s.mode == mode && s.test == test);
        one.map_or("-".into(), |s| format!("{:+.3} ({:+.3})", 100.0 * s.computed, 100.0 * s.measured))
    };
    let row = |mode: &u32| {
        let cells = tests.iter().map(|t| of(*mode, t));
        [vec![mode.to_string()], cells.collect(), vec![ratio(&|s| s.mode == *mode)]].concat()
    };
    let mut rows: Vec<Vec<String>> = modes.iter().map(row).collect();
    let last = tests.iter().map(|t| ratio(&|s| s.test == *t));
    rows.push([vec!["over no shift".into()], last.collect(), vec![significant(all, 3)]].concat());
    let header: Vec<&str> = [vec!["mode"], tests.iter().map(String::as_str).collect(), vec!["over no shift"]].concat();
    let upto = |n: &u32| {
        let part = over_none(shifts.iter().filter(|s| s.mode <= *n));
        part.map(|r| format!("modes 1 to {n}: {}", significant(r, 3)))
    };
    let cumulated: Vec<String> = modes.iter().skip(1).filter_map(upto).collect();
    format!(
        "Shifts of natural frequencies in %, computed (measured), and their root mean square error over that of no shift\n{}{}\n\n",
        table(&header, &rows),
        cumulated.join("; ")
    )
}
