//! The tables of a realistic trial.

use crate::trial::{Realistic, Share};

use super::table::{significant, table};

fn percent(v: f64) -> String {
    format!("{:.0}", 100.0 * v)
}

fn share(s: &Share) -> String {
    format!("{} of {} ({}-{} %)", s.count, s.of, percent(s.interval.0), percent(s.interval.1))
}

fn rows<const N: usize, T>(all: &[T], row: impl Fn(&T) -> [String; N]) -> Vec<Vec<String>> {
    all.iter().map(|r| row(r).to_vec()).collect()
}

/// Recovery over strength, claims, null rows; counts with Wilson's intervals of 95 %.
pub(super) fn tell(r: &Realistic) -> String {
    let number = |v: Option<f64>| v.map_or("-".into(), |v| significant(v, 3));
    let mut text = String::new();
    if !r.curve.is_empty() {
        text += "\nHidden effect and its place first, over its strength in standard deviations\n\n";
        let strength = |from: f64, to: Option<f64>| to.map_or(format!("{from} and more"), |to| format!("{from} to {to}"));
        let all = rows(&r.curve, |b| [b.structure.into(), strength(b.from, b.to), share(&b.strict), share(&b.with_ties)]);
        text += &table(&["structure", "strength", "strict", "with ties"], &all);
    }
    text += "\nWhat is claimed\n\n";
    let all = rows(&r.structures, |s| {
        [
            s.structure.into(),
            s.cases.to_string(),
            share(&s.first_strict),
            share(&s.first_with_ties),
            share(&s.both),
            share(&s.quiet),
            significant(s.wrong_per_case, 2),
            significant(s.wrong_instruments_per_case, 2),
            share(&s.blamed),
            share(&s.unfounded),
            number(s.held_out_over_truth),
            number(s.wall_s),
        ]
    });
    let heads = [
        "structure",
        "cases",
        "first, strict",
        "first, with ties",
        "both of two",
        "quiet where nothing is",
        "wrong effects a case",
        "wrong instruments a case",
        "instrument blamed on physics",
        "claimed, held-out did not fall",
        "held-out over true law, median",
        "median s",
    ];
    text += &table(&heads, &all);
    if !r.null_rows.is_empty() {
        text += "\nNothing hidden\n\n";
        let names = |all: &[(String, usize)]| all.iter().map(|(n, c)| format!("{c} {n}")).collect::<Vec<_>>().join(", ");
        let all = rows(&r.null_rows, |n| {
            let (effect, instrument) = (share(&n.false_effect), share(&n.false_instrument));
            [n.imperfection.into(), n.structure.into(), effect, instrument, share(&n.unexplained), names(&n.named)]
        });
        text += &table(&["imperfection", "structure", "false effect", "false instrument", "unexplained", "named"], &all);
    }
    text
}
