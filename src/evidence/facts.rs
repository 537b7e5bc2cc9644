//! How many facts a model's error is.

use nalgebra::DVector;

use crate::response::BlockKind;

use super::{Evidence, Record, Seen, Variances};

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
    /// All coefficients are independent: the ordinary likelihood.
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
        let share = |t: usize| -> Vec<f64> {
            let (record, errors) = (&self.records[t], v.own_errors(t, &self.settings));
            let d = record.variance(v.kappa, &errors);
            let mut share = vec![0.0; d.len()];
            for (c, tau) in record.channels.iter().zip(&errors) {
                c.range.clone().for_each(|i| share[i] = if d[i].is_finite() { tau * tau * record.size[i] / d[i] } else { 0.0 });
            }
            share
        };
        let shares: Vec<Vec<f64>> = (0..self.records.len()).map(share).collect();
        for group in self.groups() {
            let dominated: f64 = group.iter().flat_map(|(t, b)| shares[*t][self.records[*t].channels[*b].range.clone()].iter()).sum();
            let facts = of(&group).min(dominated);
            let z0 = if dominated > 0.0 { facts / dominated } else { 1.0 };
            for (t, b) in &group {
                let range = self.records[*t].channels[*b].range.clone();
                for i in range.filter(|i| self.records[*t].noise[*i].is_finite()) {
                    counts.z[*t][i] = 1.0 - shares[*t][i] * (1.0 - z0);
                }
            }
            counts.facts += facts;
        }
        counts.n = counts.z.iter().map(|z| z.sum()).sum::<f64>().max(1.0);
        counts
    }

    /// Channels (test, block) whose error is one function.
    fn groups(&self) -> Vec<Vec<(usize, usize)>> {
        let mut groups: Vec<Vec<(usize, usize)>> = Vec::new();
        for (t, record) in self.records.iter().enumerate() {
            for (b, c) in record.channels.iter().enumerate().filter(|(_, c)| c.kind != BlockKind::Table) {
                let of = |&(t, b): &(usize, usize)| &self.records[t].channels[b];
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

    fn facts(&self, group: &[(usize, usize)], seen: Option<&[Seen]>) -> f64 {
        let s = &self.settings;
        let first = &self.records[group[0].0].channels[group[0].1];
        match first.kind {
            // What a model misses of a mode at one load or amplitude it misses at the next.
            BlockKind::Frf => s.facts_mode * group.iter().map(|(t, b)| self.records[*t].channels[*b].modes).max().unwrap_or(0) as f64,
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
