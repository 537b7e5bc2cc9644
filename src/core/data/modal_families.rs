//! Modal tables that belong together: the same modes under another load, temperature, interference. A mode of one table that lies far off
//! where the others agree is out of family.

use super::{ModeRow, Record, Test};

/// A natural frequency that does not go with the same mode in the other tables.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfFamily {
    /// The test it stands in.
    pub test: String,
    /// Number of the mode.
    pub mode: u32,
    /// Frequency [Hz].
    pub frequency: f64,
    /// The other tests with their frequencies of the mode [Hz].
    pub others: Vec<(String, f64)>,
    /// ln(f / mean of the others).
    pub deviation: f64,
    /// Root mean square of the same over the other modes of the test: what its conditions do.
    pub usual: f64,
    /// Standard deviation that frequencies and conditions give [-].
    pub sigma: f64,
}

impl OutOfFamily {
    /// The deviation in standard deviations.
    pub fn number(&self) -> f64 {
        self.deviation / self.sigma
    }

    /// In words.
    pub fn claim(&self) -> String {
        let others: Vec<String> = self.others.iter().map(|(test, f)| format!("{f} Hz in {test}")).collect();
        format!(
            "mode {}: {} Hz is out of family with {}: {:+.1} % where its other modes differ by {:.2} %",
            self.mode,
            self.frequency,
            others.join(" and "),
            100.0 * self.deviation.exp_m1(),
            100.0 * self.usual.exp_m1()
        )
    }
}

/// Standard deviations beyond which a mode is called out of family.
pub const OUT_OF_FAMILY: f64 = 3.3;
/// Assumed relative deviation of a frequency that states none.
const UNSTATED: f64 = 0.005;

/// Every mode out of family. Tables belong together when they state the same conditions and list the same modes with the same families;
/// three are needed to say which one is off.
pub fn out_of_family(tests: &[Test]) -> Vec<OutOfFamily> {
    let tables: Vec<(&Test, &[ModeRow])> = tests
        .iter()
        .filter_map(|t| match &t.record {
            Record::Modal(table) => Some((t, table.rows.as_slice())),
            _ => None,
        })
        .collect();
    let together = |a: &(&Test, &[ModeRow]), b: &(&Test, &[ModeRow])| {
        let listed = |rows: &[ModeRow]| rows.iter().map(|r| (r.mode, r.family.clone())).collect::<Vec<_>>();
        a.0.conditions.keys().eq(b.0.conditions.keys()) && listed(a.1) == listed(b.1)
    };
    let mut found = Vec::new();
    for (k, (test, rows)) in tables.iter().enumerate() {
        let others: Vec<_> = tables.iter().enumerate().filter(|(j, t)| *j != k && together(&tables[k], t)).map(|(_, t)| *t).collect();
        if others.len() < 2 {
            continue;
        }
        let log = |rows: &[ModeRow], m: usize| rows[m].frequency.value.ln();
        let mean = |m: usize| others.iter().map(|o| log(o.1, m)).sum::<f64>() / others.len() as f64;
        // Half the range of a mode over some tables: the one that is off is the one without which the rest agree.
        let range = |m: usize, left: usize| {
            let all =
                tables.iter().enumerate().filter(|(j, t)| *j != left && (*j == k || together(&tables[k], t))).map(|(_, t)| log(t.1, m));
            let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            0.5 * (high - low)
        };
        let deviations: Vec<f64> = (0..rows.len()).map(|m| log(rows, m) - mean(m)).collect();
        for (m, row) in rows.iter().enumerate() {
            let rest = deviations.iter().enumerate().filter(|(j, _)| *j != m).map(|(_, d)| d * d);
            let usual = (rest.clone().sum::<f64>() / rest.count().max(1) as f64).sqrt();
            let of =
                |r: &ModeRow| r.frequency.sigma.map_or(UNSTATED, |s| s / r.frequency.value).max(r.frequency.rounding / r.frequency.value);
            let spread: f64 = others.iter().map(|o| of(&o.1[m]).powi(2)).sum::<f64>() / (others.len() as f64).powi(2);
            let sigma = (of(row).powi(2) + spread + usual * usual).sqrt();
            let odd = OutOfFamily {
                test: test.id.clone(),
                mode: row.mode,
                frequency: row.frequency.value,
                others: others.iter().map(|o| (o.0.id.clone(), o.1[m].frequency.value)).collect(),
                deviation: deviations[m],
                usual,
                sigma,
            };
            let alone = (0..tables.len()).filter(|j| *j != k && together(&tables[k], &tables[*j])).all(|j| range(m, k) < range(m, j));
            if odd.number().abs() > OUT_OF_FAMILY && alone {
                found.push(odd);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Dataset, toml_strict::TomlFile};

    fn tests(middle: [f64; 3]) -> Vec<Test> {
        let table = |id: &str, load: f64, f: [f64; 3]| {
            let rows: String = (0..3).map(|k| format!("{{ mode = {}, frequency = \"{} Hz\" }},", k + 1, f[k])).collect();
            format!("[[test]]\nid = \"{id}\"\nkind = \"modal\"\nconditions = {{ load = \"{load} N\" }}\nrows = [{rows}]\n")
        };
        let text = format!(
            "schema = 1\n{}{}{}[[test]]\nid = \"free\"\nkind = \"modal\"\nrows = [{{ mode = 1, frequency = \"400 Hz\" }}]\n",
            table("low", 20.0, [100.0, 200.0, 300.0]),
            table("mid", 80.0, middle),
            table("high", 140.0, [101.0, 199.0, 301.0])
        );
        Dataset::from_toml(&TomlFile::parse("dataset.toml".as_ref(), text, "data").unwrap(), None).unwrap().tests
    }

    #[test]
    fn the_one_that_disagrees_is_named_and_no_other() {
        assert!(out_of_family(&tests([100.4, 199.6, 300.2])).is_empty());
        let found = out_of_family(&tests([100.4, 199.6, 330.0]));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].test.as_str(), found[0].mode), ("mid", 3));
        assert!((found[0].deviation - (330.0f64 / (300.0f64 * 301.0).sqrt()).ln()).abs() < 1e-12);
        assert!(found[0].number() > 10.0 && found[0].claim().contains("mode 3"));
        // Nor is one load at which all modes lie higher.
        assert!(out_of_family(&tests([103.0, 206.0, 309.0])).is_empty());
    }
}
