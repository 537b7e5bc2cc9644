//! Deviations of parts to the contact area of their assembly.
//!
//! A table of cases states for every set of tolerances t_k the least and the greatest area. Both are taken as
//! ln A_max = a + r + sum u_k t_k and ln A_min = a - r - sum v_k t_k, with u, v >= 0 by least squares over the cases; r is what deviations move that no column
//! states. An assembly with deviations s_k t_k, s_k within -1/2 and 1/2, has ln A = a + 2 r s_r + 2 sum t_k (u_k max(s_k, 0) + v_k min(s_k, 0)): at the ends of
//! all tolerances it has the areas of the table. Columns that grow in proportion over the cases cannot be told apart: they move the area by the same amount
//! per width.

use nalgebra::{DMatrix, DVector};

/// ln of the area over deviations of parts.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLaw {
    /// ln of the area of parts without deviation (area in m2).
    pub base: f64,
    /// Half the range of ln A that no stated tolerance explains.
    pub rest: f64,
    /// Growth of ln A_max with each tolerance [1/m].
    pub up: Vec<f64>,
    /// Fall of ln A_min with each tolerance [1/m].
    pub down: Vec<f64>,
    /// Largest difference of ln A to the table.
    pub off: f64,
    /// Tolerances that the cases do not tell apart.
    pub together: Vec<Vec<usize>>,
}

/// A case: its tolerances [m], least and greatest area [m2].
pub type Ends = (Vec<f64>, f64, f64);

/// Correlation over the cases from which two columns count as one.
const ALIKE: f64 = 0.98;

impl AreaLaw {
    /// Least squares over the cases.
    pub fn fit(cases: &[Ends]) -> AreaLaw {
        let n = cases.first().map_or(0, |c| c.0.len());
        let column = |k: usize| cases.iter().map(|c| c.0[k]).collect::<Vec<f64>>();
        let mut together: Vec<Vec<usize>> = Vec::new();
        for k in 0..n {
            match together.iter_mut().find(|g| correlation(&column(g[0]), &column(k)) > ALIKE) {
                Some(group) => group.push(k),
                None => together.push(vec![k]),
            }
        }
        let sums: Vec<Vec<f64>> = cases.iter().map(|c| together.iter().map(|g| g.iter().map(|k| c.0[*k]).sum()).collect()).collect();
        let high: Vec<f64> = cases.iter().map(|c| c.2.ln()).collect();
        let low: Vec<f64> = cases.iter().map(|c| -c.1.ln()).collect();
        let (top, up) = rising(&sums, &high);
        let (bottom, down) = rising(&sums, &low);
        // Without a range of its own (crossed ends) the parts explain all of it.
        let (base, rest) = (0.5 * (top - bottom), (0.5 * (top + bottom)).max(0.0));
        let spread = |of: &[f64]| {
            let mut each = vec![0.0; n];
            together.iter().zip(of).for_each(|(g, v)| g.iter().for_each(|k| each[*k] = *v));
            each
        };
        let mut law = AreaLaw { base, rest, up: spread(&up), down: spread(&down), off: 0.0, together };
        law.off = cases.iter().map(|c| (law.ends(&c.0).1 - c.2.ln()).abs().max((law.ends(&c.0).0 - c.1.ln()).abs())).fold(0.0, f64::max);
        law
    }

    /// ln A at the ends of all tolerances.
    pub fn ends(&self, widths: &[f64]) -> (f64, f64) {
        let sum = |of: &[f64]| of.iter().zip(widths).map(|(a, t)| a * t).sum::<f64>();
        (self.base - self.rest - sum(&self.down), self.base + self.rest + sum(&self.up))
    }

    /// The law with its slopes scaled so that the ends of a case are those of its row.
    pub fn through(&self, case: &Ends) -> AreaLaw {
        let (low, high) = self.ends(&case.0);
        let factor = |wanted: f64, range: f64| if range > 0.0 { (wanted / range).max(0.0) } else { 0.0 };
        // A range that the law does not know at all is one of the rest.
        let (up, down) = (factor(case.2.ln() - self.base, high - self.base), factor(self.base - case.1.ln(), self.base - low));
        let scaled = |of: &[f64], f: f64| of.iter().map(|v| v * f).collect();
        AreaLaw { rest: 0.5 * self.rest * (up + down), up: scaled(&self.up, up), down: scaled(&self.down, down), ..self.clone() }
    }

    /// Derivative of ln A with respect to the width of tolerance `k` at the deviation `s` over the width.
    pub fn slope(&self, k: usize, s: f64) -> f64 {
        2.0 * s * if s > 0.0 { self.up[k] } else { self.down[k] }
    }

    /// ln A of an assembly: deviations over the widths, that of the rest last.
    pub fn log_area(&self, widths: &[f64], s: &[f64]) -> f64 {
        let own: f64 = widths.iter().zip(s).enumerate().map(|(k, (t, s))| t * self.slope(k, *s)).sum();
        self.base + own + 2.0 * self.rest * s.get(widths.len()).copied().unwrap_or(0.0)
    }
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let product = |x: &[f64], mx: f64, y: &[f64], my: f64| x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    let (aa, bb) = (product(a, ma, a, ma), product(b, mb, b, mb));
    // Columns that do not vary cannot be told apart either.
    if aa == 0.0 && bb == 0.0 {
        1.0
    } else if aa == 0.0 || bb == 0.0 {
        0.0
    } else {
        product(a, ma, b, mb) / (aa * bb).sqrt()
    }
}

/// Intercept and slopes of 0 or above, by least squares; slopes alone where the rows do not tell both.
fn rising(rows: &[Vec<f64>], y: &[f64]) -> (f64, Vec<f64>) {
    let groups = rows.first().map_or(0, Vec::len);
    let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
    let mut used: Vec<usize> = (0..groups).collect();
    loop {
        let a = DMatrix::from_fn(rows.len(), used.len() + 1, |r, c| if c == 0 { 1.0 } else { rows[r][used[c - 1]] });
        let largest = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let solved = a.svd(true, true).solve(&DVector::from_column_slice(y), 1e-9 * largest);
        let Ok(x) = solved else { return (mean, vec![0.0; groups]) };
        let least = (1..x.len()).min_by(|p, q| x[*p].total_cmp(&x[*q])).filter(|k| x[*k] < 0.0);
        if let Some(k) = least {
            used.remove(k - 1);
            continue;
        }
        let mut slopes = vec![0.0; groups];
        used.iter().enumerate().for_each(|(c, g)| slopes[*g] = x[c + 1]);
        return (x[0], slopes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tolerances, the second with a twin: slopes are found and shared, the ends are met.
    #[test]
    fn a_table_of_the_form_is_found_again() {
        let truth =
            AreaLaw { base: -11.5, rest: 0.2, up: vec![300.0, 200.0, 200.0], down: vec![50.0, 80.0, 80.0], off: 0.0, together: vec![] };
        let mut cases: Vec<Ends> = Vec::new();
        for a in [1e-4, 7e-4, 1.3e-3] {
            for b in [0.5e-4, 7e-4, 1.3e-3] {
                let widths = vec![a, b, 0.5 * b];
                let (low, high) = truth.ends(&widths);
                cases.push((widths, low.exp(), high.exp()));
            }
        }
        let law = AreaLaw::fit(&cases);
        assert_eq!(law.together, vec![vec![0], vec![1, 2]]);
        assert!(law.off < 1e-9 && (law.rest - 0.2).abs() < 1e-9 && (law.base + 11.5).abs() < 1e-9, "{law:?}");
        assert!((law.up[0] - 300.0).abs() < 1e-6 && (law.up[1] - 200.0).abs() < 1e-6 && (law.down[2] - 80.0).abs() < 1e-6, "{law:?}");
        // A row that lies off the form is met by the law through it, at both ends.
        let odd = (vec![1e-4, 0.5e-4, 0.25e-4], 7.1e-6, 14.0e-6);
        let own = law.through(&odd);
        let at = |s: f64| own.log_area(&odd.0, &[s, s, s, s]).exp();
        assert!((at(0.5) / odd.2 - 1.0).abs() < 0.1 && (at(-0.5) / odd.1 - 1.0).abs() < 0.1, "{} {}", at(0.5), at(-0.5));
        assert_eq!(own.log_area(&odd.0, &[0.0; 4]), law.base);
    }
}
