//! How many facts a model's error is.

use nalgebra::DVector;

use crate::response::BlockKind;

use super::record::Part;
use super::{Evidence, Record, Seen, Settings, Variances};

/// What every coefficient counts as, and what all of them do.
#[derive(Clone, Debug)]
pub struct Counts {
    /// One for each coefficient of each test, 0 to 1.
    pub z: Vec<DVector<f64>>,
    /// Independent facts of all tests.
    pub n: f64,
    /// Facts that the model's error counts as.
    pub facts: f64,
}

impl Evidence {
    /// Every coefficient is a datum: the ordinary likelihood.
    pub fn independent(&self) -> Counts {
        let ones = |r: &Record| DVector::from_iterator(r.noise.len(), r.noise.iter().map(|n| if n.is_finite() { 1.0 } else { 0.0 }));
        let z: Vec<DVector<f64>> = self.records.iter().map(ones).collect();
        Counts { n: z.iter().map(|z| z.sum()).sum(), z, facts: 0.0 }
    }

    /// Counts by what a model leaves: loops of one channel together, FRFs between the same places together, every channel of a record by itself; a
    /// row of a table is a fact.
    pub fn counts(&self, seen: &[Seen], v: &Variances) -> Counts {
        self.counted(v, |group| self.facts(group, Some(seen)))
    }

    /// The same where a loop counts as no more than it does at least.
    pub fn least_counts(&self, v: &Variances) -> Counts {
        self.counted(v, |group| self.facts(group, None))
    }

    fn counted(&self, v: &Variances, of: impl Fn(&[(usize, usize)]) -> f64) -> Counts {
        let mut counts = self.independent();
        let parts: Vec<Vec<Part>> = self.records.iter().enumerate().map(|(t, r)| r.parts(v.kappa, &v.own_errors(t, r))).collect();
        for group in groups(&self.records) {
            let facts = of(&group);
            if self.records[group[0].0].channels[group[0].1].kind == BlockKind::Frf {
                // Its error has few dimensions already.
                counts.facts += facts;
                continue;
            }
            let range = |&(t, b): &(usize, usize)| self.records[t].channels[b].range.clone().map(move |i| (t, i));
            let compared: Vec<(usize, usize)> =
                group.iter().flat_map(range).filter(|(t, i)| self.records[*t].noise[*i].is_finite()).collect();
            let dominated: f64 = compared.iter().map(|(t, i)| parts[*t][*i].share()).sum();
            let facts = facts.min(dominated);
            let z0 = if dominated > 0.0 { facts / dominated } else { 1.0 };
            compared.iter().for_each(|(t, i)| counts.z[*t][*i] = 1.0 - parts[*t][*i].share() * (1.0 - z0));
            counts.facts += facts;
        }
        counts.n = self.independent_facts(&counts, v);
        counts
    }

    /// Independent facts that coefficients are under these counts, beside the errors that a model has.
    pub fn independent_facts(&self, counts: &Counts, v: &Variances) -> f64 {
        let of = |(t, r): (usize, &Record)| {
            let parts = r.parts(v.kappa, &v.own_errors(t, r));
            parts.iter().zip(counts.z[t].iter()).filter(|(_, z)| **z > 0.0).map(|(p, z)| p.facts(*z)).sum::<f64>()
        };
        self.records.iter().enumerate().map(of).sum::<f64>().max(1.0)
    }

    fn facts(&self, group: &[(usize, usize)], seen: Option<&[Seen]>) -> f64 {
        let s = &self.settings;
        let first = &self.records[group[0].0].channels[group[0].1];
        match first.kind {
            BlockKind::Frf => dimensions(&self.records, group, s),
            BlockKind::Record => s.facts_record,
            BlockKind::Table => first.range.len() as f64,
            BlockKind::Loop => {
                let spread = seen.map_or(0.0, |seen| self.participation(group, seen));
                (spread.max(s.facts_loop) * group.len() as f64).min(s.facts_most)
            }
        }
    }

    /// Number of harmonics' coefficients over which the residual of loops is spread: `(sum p)^2 / sum p^2` of its relative power p.
    fn participation(&self, group: &[(usize, usize)], seen: &[Seen]) -> f64 {
        let mut power = vec![0.0; 1 + group.iter().flat_map(|(t, b)| &self.records[*t].channels[*b].harmonics).max().copied().unwrap_or(0)];
        for (t, b) in group {
            let (record, r) = (&self.records[*t], &seen[*t].r);
            let c = &record.channels[*b];
            c.range.clone().zip(&c.harmonics).for_each(|(i, h)| power[*h] += r[i] * r[i] / record.size[i].max(f64::MIN_POSITIVE));
        }
        // A harmonic is two coefficients of half its power.
        let sum: f64 = power.iter().sum();
        let squares: f64 = power.iter().enumerate().map(|(h, p)| if h == 0 { p * p } else { 0.5 * p * p }).sum();
        sum * sum / squares.max(f64::MIN_POSITIVE)
    }
}

/// Channels (test, block) whose error is one function.
fn groups(records: &[Record]) -> Vec<Vec<(usize, usize)>> {
    let mut groups: Vec<Vec<(usize, usize)>> = Vec::new();
    for (t, record) in records.iter().enumerate() {
        for (b, c) in record.channels.iter().enumerate().filter(|(_, c)| c.kind != BlockKind::Table) {
            let of = |&(t, b): &(usize, usize)| &records[t].channels[b];
            let one = matches!(c.kind, BlockKind::Loop | BlockKind::Frf);
            let same = groups.iter_mut().find(|g| one && of(&g[0]).kind == c.kind && of(&g[0]).label == c.label);
            match same {
                Some(group) => group.push((t, b)),
                None => groups.push(vec![(t, b)]),
            }
        }
    }
    groups
}

/// Dimensions of the error of FRFs between the same places: what a model misses of a mode at one load or amplitude it misses at the next.
fn dimensions(records: &[Record], group: &[(usize, usize)], s: &Settings) -> f64 {
    s.facts_mode * group.iter().map(|(t, b)| records[*t].channels[*b].modes).max().unwrap_or(0) as f64
}

/// Sets how many dimensions the errors of FRFs have for each of their lines.
pub(super) fn smooth(records: &mut [Record], s: &Settings) {
    for group in groups(records) {
        let frf = records[group[0].0].channels[group[0].1].kind == BlockKind::Frf;
        let of = |&(t, b): &(usize, usize)| records[t].noise[records[t].channels[b].range.clone()].iter().filter(|n| n.is_finite()).count();
        let lines: usize = group.iter().map(of).sum();
        let free = if frf { (dimensions(records, &group, s) / lines.max(1) as f64).min(1.0) } else { 1.0 };
        group.iter().for_each(|(t, b)| records[*t].channels[*b].free = free);
    }
}
