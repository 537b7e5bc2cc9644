//! How many facts a model's error is.

use crate::response::BlockKind;

use super::{Evidence, Record, Seen, Variances};

/// What a coefficient counts as.
#[derive(Clone, Copy, Debug)]
pub struct Count {
    /// Facts, 0 to 1.
    pub z: f64,
    /// Dimensions that the model's error has for each coefficient of its channel: 1 where it is white, fewer where it is a smooth function of few.
    pub free: f64,
}

impl Count {
    /// Variance in the directions in which the model may err: there the error of all coefficients together stands beside the noise of one.
    fn whole(&self, noise: f64, error: f64) -> f64 {
        noise + error / self.free
    }

    /// One over the weight of a residual's square.
    pub fn variance(&self, noise: f64, error: f64) -> f64 {
        self.whole(noise, error) / self.z
    }

    /// What a coefficient adds to `-2 ln L` beside the square of its residual over [`Count::variance`]. With D the variance of `whole`:
    /// `z [free ln D + (1 - free) (ln noise + 1 - noise / D)]`. The second part is that of the directions in which the model does not err, where the
    /// residual is noise of the size it is known to have: 1, of which noise / D stands in the square already.
    pub fn level(&self, noise: f64, error: f64) -> f64 {
        let whole = self.whole(noise, error);
        let rough = if self.free < 1.0 { (1.0 - self.free) * (noise.ln() + 1.0 - noise / whole) } else { 0.0 };
        self.z * (self.free * whole.ln() + rough)
    }

    /// Independent facts that it is beside an error of this size.
    fn facts(&self, noise: f64, error: f64) -> f64 {
        self.z * (noise + error) / self.whole(noise, error).max(f64::MIN_POSITIVE)
    }
}

/// What every coefficient counts as, and what all of them do.
#[derive(Clone, Debug)]
pub struct Counts {
    /// One for each coefficient of each test.
    pub of: Vec<Vec<Count>>,
    /// Independent facts of all tests.
    pub n: f64,
    /// Facts that the model's error counts as.
    pub facts: f64,
}

impl Evidence {
    /// All coefficients are independent: the ordinary likelihood.
    pub fn independent(&self) -> Counts {
        let one = |n: &f64| Count { z: if n.is_finite() { 1.0 } else { 0.0 }, free: 1.0 };
        let of: Vec<Vec<Count>> = self.records.iter().map(|r| r.noise.iter().map(one).collect()).collect();
        Counts { n: of.iter().flatten().map(|c| c.z).sum(), of, facts: 0.0 }
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
        let parts = |(t, record): (usize, &Record)| record.parts(v.kappa, &v.own_errors(t, record));
        let parts: Vec<Vec<(f64, f64)>> = self.records.iter().enumerate().map(parts).collect();
        for group in self.groups() {
            let kind = self.records[group[0].0].channels[group[0].1].kind;
            let range = |&(t, b): &(usize, usize)| self.records[t].channels[b].range.clone().map(move |i| (t, i));
            let compared: Vec<(usize, usize)> = group.iter().flat_map(range).filter(|(t, i)| self.records[*t].noise[*i].is_finite()).collect();
            let facts = of(&group);
            counts.facts += match kind {
                // The error along lines is one smooth function, whatever its size.
                BlockKind::Frf => {
                    let free = (facts / compared.len().max(1) as f64).min(1.0);
                    compared.iter().for_each(|(t, i)| counts.of[*t][*i].free = free);
                    facts
                }
                _ => {
                    let share = |(t, i): &(usize, usize)| parts[*t][*i].1 / (parts[*t][*i].0 + parts[*t][*i].1).max(f64::MIN_POSITIVE);
                    let dominated: f64 = compared.iter().map(share).sum();
                    let facts = facts.min(dominated);
                    let z0 = if dominated > 0.0 { facts / dominated } else { 1.0 };
                    compared.iter().for_each(|(t, i)| counts.of[*t][*i].z = 1.0 - share(&(*t, *i)) * (1.0 - z0));
                    facts
                }
            };
        }
        let all = counts.of.iter().flatten().zip(parts.iter().flatten()).filter(|(c, _)| c.z > 0.0);
        counts.n = all.map(|(c, (noise, error))| c.facts(*noise, *error)).sum::<f64>().max(1.0);
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
