//! Some of the lines of an FRF.

use std::sync::Arc;

use super::{Plan, Work};

impl Plan {
    /// An FRF whose lines are dear, each a balance of its own or about where a model stands under its loads, at no more than about so many lines for each of its
    /// resonances, of which it has three at least; `None` for other tests and where it has no more. A line that stands for others counts as they do. They
    /// lie as densely as the measured curve turns. `rises`: see [`resonances`].
    pub fn fewer_lines(&self, of_each: usize, rises: f64) -> Option<Plan> {
        let Work::Frf(frf) = &self.work else { return None };
        let [block] = self.blocks.as_slice() else { return None };
        let measured = &self.measured[block.range.clone()];
        let most = of_each.max(1) * resonances(measured, rises).max(3);
        if !frf.dear() || block.abscissa.len() <= most {
            return None;
        }
        Some(self.of_lines(&along(measured, most)))
    }

    /// The same FRF at these lines, each with the number of lines it stands for.
    pub(super) fn of_lines(&self, kept: &[(usize, f64)]) -> Plan {
        let (Work::Frf(frf), [block]) = (&self.work, self.blocks.as_slice()) else { return self.clone() };
        let rows: Vec<(usize, f64)> = kept.iter().flat_map(|(k, count)| [(2 * k, *count), (2 * k + 1, *count)]).collect();
        let lines: Vec<usize> = kept.iter().map(|k| k.0).collect();
        let pick = |values: &[f64]| rows.iter().filter_map(|(r, _)| values.get(*r).copied()).collect::<Vec<f64>>();
        let mut block = block.clone();
        block.abscissa = lines.iter().map(|k| block.abscissa[*k]).collect();
        block.range = 0..rows.len();
        Plan {
            measured: pick(&self.measured),
            sigma: rows.iter().map(|(r, count)| self.sigma[*r] / count.sqrt()).collect(),
            granted: rows.iter().filter_map(|(r, count)| self.granted.get(*r).map(|g| g / count)).collect(),
            left_out: (0..rows.len()).filter(|n| self.left_out.contains(&rows[*n].0)).collect(),
            covariance: self.covariance.as_ref().map(|c| Arc::new(c.of_rows(&rows))),
            work: Work::Frf(frf.of_lines(&lines)),
            blocks: vec![block],
            ..self.clone()
        }
    }
}

/// Maxima of an FRF's magnitude that stand above the minima on either side by the factor `rises`; one at least. `lines`: real and imaginary parts in turn.
pub fn resonances(lines: &[f64], rises: f64) -> usize {
    let h: Vec<f64> = lines.chunks(2).map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
    let (mut count, mut low, mut high, mut rising) = (0, f64::INFINITY, 0.0f64, true);
    for v in h {
        if rising {
            (low, high) = (low.min(v), if v < low { 0.0 } else { high.max(v) });
            if high > rises * low && v < high / rises {
                (count, rising, low) = (count + 1, false, v);
            }
        } else {
            low = low.min(v);
            if v > rises * low {
                (rising, high) = (true, v);
            }
        }
    }
    count.max(1)
}

/// At most `most` lines of a curve of real and imaginary parts in turn, in order, each with the number of lines that are nearest to it. Half of them follow
/// the lines, half the path of the curve in parts of its own size: a resonance of few lines is as well covered as a broad one.
fn along(curve: &[f64], most: usize) -> Vec<(usize, f64)> {
    let n = curve.len() / 2;
    let size = |re: f64, im: f64| re.hypot(im);
    let step = |k: usize| {
        let (a, b) = (&curve[2 * k - 2..2 * k], &curve[2 * k..2 * k + 2]);
        let step = size(b[0] - a[0], b[1] - a[1]) / size(a[0], a[1]).max(size(b[0], b[1])).max(f64::MIN_POSITIVE);
        if step.is_finite() { step } else { 0.0 }
    };
    let steps: Vec<f64> = (1..n).map(step).collect();
    let whole: f64 = steps.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut kept: Vec<usize> = Vec::with_capacity(most);
    let mut come = 0.0;
    for k in 0..n {
        if k > 0 {
            come += 0.5 * steps[k - 1] / whole + 0.5 / (n - 1) as f64;
        }
        // The first line at or beyond each of the places that share the way evenly.
        if come >= kept.len() as f64 / most.saturating_sub(1).max(1) as f64 - 1e-12 && kept.len() < most {
            kept.push(k);
        }
    }
    let mut counted: Vec<(usize, f64)> = kept.iter().map(|k| (*k, 0.0)).collect();
    for k in 0..n {
        let nearest = (0..kept.len()).min_by_key(|i| kept[*i].abs_diff(k));
        counted[nearest.unwrap_or(0)].1 += 1.0;
    }
    counted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_lines_cover_a_narrow_resonance_and_count_as_all() {
        // 400 lines, the resonance of 0.5 % about line 200.
        let h = |k: usize| {
            let r = 0.5 + k as f64 / 400.0;
            num_complex::Complex64::new(1.0 - r * r, 0.01 * r).inv()
        };
        let curve: Vec<f64> = (0..400).flat_map(|k| [h(k).re, h(k).im]).collect();
        let kept = along(&curve, 40);
        assert!(kept.len() <= 40 && kept.len() > 25, "{}", kept.len());
        assert!(kept.windows(2).all(|w| w[0].0 < w[1].0));
        assert_eq!(kept.iter().map(|k| k.1).sum::<f64>(), 400.0);
        // Evenly taken there would be one or two.
        let near = kept.iter().filter(|(k, _)| k.abs_diff(200) <= 6).count();
        assert!(near >= 6, "{near} lines at the resonance, of 13");
    }
}
