//! Small plots of text.

/// One curve: the mark it is drawn with, and its points.
pub(super) struct Curve<'a> {
    pub mark: char,
    pub x: &'a [f64],
    pub y: &'a [f64],
}

/// Draws curves over one another, the last on top, with the ranges of both axes.
pub(super) fn plot(curves: &[Curve<'_>], width: usize, height: usize, x_name: &str, y_name: &str) -> String {
    let range = |pick: fn(&Curve<'_>) -> Vec<f64>| {
        let all = curves.iter().flat_map(pick).filter(|v| v.is_finite());
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        // A curve without height lies in the middle.
        let pad = if high - low > 1e-9 * high.abs().max(low.abs()) { 0.0 } else { 0.5 * high.abs().max(1e-3) };
        (low - pad, high + pad)
    };
    let ((x0, x1), (y0, y1)) = (range(|c| c.x.to_vec()), range(|c| c.y.to_vec()));
    if !(x1 > x0 && y1 > y0) {
        return String::new();
    }
    let mut canvas = vec![vec![' '; width]; height];
    let cell = |v: f64, (low, high): (f64, f64), n: usize| ((v - low) / (high - low) * (n - 1) as f64).round() as usize;
    for curve in curves {
        for (x, y) in curve.x.iter().zip(curve.y).filter(|(x, y)| x.is_finite() && y.is_finite()) {
            canvas[height - 1 - cell(*y, (y0, y1), height).min(height - 1)][cell(*x, (x0, x1), width).min(width - 1)] = curve.mark;
        }
    }
    let mut text = format!("  {y_name}\n");
    for (k, line) in canvas.iter().enumerate() {
        let label = match k {
            0 => format!("{y1:.3}"),
            k if k + 1 == height => format!("{y0:.3}"),
            _ => String::new(),
        };
        let line: String = line.iter().collect();
        text += format!("  {label:>9} |{line}").trim_end();
        text += "\n";
    }
    let (left, right) = (format!("{x0:.3}"), format!("{x1:.3}"));
    let middle = width.saturating_sub(left.chars().count() + right.chars().count());
    text += &format!("  {:>9} +{}\n  {:>9}  {left}{x_name:^middle$}{right}\n", "", "-".repeat(width), "");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_stand_where_they_belong() {
        let (x, y) = ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);
        let text = plot(&[Curve { mark: '*', x: &x, y: &y }], 11, 3, "t", "u");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "      1.000 |     *");
        assert_eq!(lines[3], "      0.000 |*         *");
        assert_eq!(lines[5], "             0.000t2.000");
        assert_eq!(plot(&[Curve { mark: '*', x: &[], y: &[] }], 11, 3, "t", "u"), "");
        assert!(plot(&[Curve { mark: '*', x: &x, y: &[2.0; 3] }], 11, 3, "t", "u").lines().nth(2).unwrap().ends_with("*    *    *"));
    }
}
