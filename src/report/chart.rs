//! Charts: plotly's traces and layout in the page's one style.

use plotly::color::{NamedColor, Rgba};
use plotly::common::ExponentFormat;
use plotly::common::{Anchor, DashType, Fill, Font, HoverInfo, Line, Marker, Mode, Orientation, Title, Visible};
use plotly::configuration::DisplayModeBar;
use plotly::layout::{Axis, AxisType, HoverMode, Legend, Margin};
use plotly::{Configuration, Layout, Plot, Scatter};

use super::text::{label, plain};

/// Measured.
pub const INK: &str = "#1a1a1a";
/// Computed, the first model.
pub const FIRST: &str = "#d55e00";
/// Computed, the last model.
pub const LAST: &str = "#0072b2";
/// Floor, bands.
pub const GREY: &str = "#8c8c8c";
/// Models in between, and further tests.
pub const OTHERS: [&str; 5] = ["#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8a6d00"];

/// The colour of stage `k` of `n`.
pub fn stage_colour(k: usize, n: usize) -> &'static str {
    match k {
        k if k + 1 == n => LAST,
        0 => FIRST,
        k => OTHERS[(k - 1) % OTHERS.len()],
    }
}

/// Charts of a page, numbered.
#[derive(Default)]
pub struct Charts {
    count: usize,
}

impl Charts {
    /// A chart with its caption (HTML, already escaped), `height` in pixels.
    pub fn figure(&mut self, plot: &Plot, height: usize, caption: &str, class: &str) -> String {
        self.count += 1;
        let id = format!("chart-{}", self.count);
        format!(
            "<figure class=\"{class}\"><figcaption>{caption}</figcaption><div style=\"height:{height}px\">{}</div></figure>\n",
            plot.to_inline_html(Some(&id))
        )
    }
}

/// What an axis shows.
pub struct Along<'a> {
    /// Title with unit.
    pub title: &'a str,
    /// Whether logarithmic, and then where the ticks stand.
    pub log: Option<Ticks>,
}

/// Ticks of a logarithmic axis.
#[derive(Clone, Copy, PartialEq)]
pub enum Ticks {
    /// At powers of ten.
    Decades,
    /// At these and their multiples of ten.
    At(&'static [f64]),
}

/// A linear axis.
pub fn linear(title: &str) -> Along<'_> {
    Along { title, log: None }
}

/// A logarithmic axis over many decades.
pub fn decades(title: &str) -> Along<'_> {
    Along { title, log: Some(Ticks::Decades) }
}

/// A logarithmic axis of errors and ratios: 1, 3, 10.
pub fn ratios(title: &str) -> Along<'_> {
    Along { title, log: Some(Ticks::At(&[1.0, 3.0])) }
}

/// A logarithmic axis of frequencies: 1, 2, 5, 10.
pub fn frequencies(title: &str) -> Along<'_> {
    Along { title, log: Some(Ticks::At(&[1.0, 2.0, 5.0])) }
}

/// An axis in the page's style.
pub fn axis(along: &Along) -> Axis {
    let font = || Font::new().size(12).color("#333333");
    let axis = Axis::new()
        .title(Title::with_text(label(along.title)).font(font()))
        .tick_font(font())
        .grid_color("#e9e9e9")
        .line_color("#8c8c8c")
        .show_line(true)
        .zero_line(false)
        .auto_margin(true);
    match along.log {
        None => axis,
        Some(Ticks::Decades) => axis.type_(AxisType::Log).dtick(1.0).exponent_format(ExponentFormat::Power),
        Some(Ticks::At(of_ten)) => {
            let at: Vec<f64> = (-6..7).flat_map(|d| of_ten.iter().map(move |v| v * 10f64.powi(d))).collect();
            let text = at.iter().map(|v| plain(*v, 1)).collect();
            axis.type_(AxisType::Log).tick_values(at).tick_text(text)
        }
    }
}

/// An empty chart.
pub fn chart(x: &Along, y: &Along) -> (Plot, Layout) {
    let mut plot = Plot::new();
    let bar = Configuration::new().responsive(true).display_logo(false).display_mode_bar(DisplayModeBar::False);
    plot.set_configuration(bar);
    let layout = Layout::new()
        .x_axis(axis(x))
        .y_axis(axis(y))
        .paper_background_color(NamedColor::White)
        .plot_background_color(NamedColor::White)
        .font(Font::new().family("Helvetica Neue, Helvetica, Arial, Liberation Sans, sans-serif").size(12).color(INK))
        .margin(Margin::new().left(56).right(10).top(8).bottom(44))
        .hover_mode(HoverMode::Closest)
        .show_legend(true)
        .legend(Legend::new().orientation(Orientation::Horizontal).x(0.0).x_anchor(Anchor::Left).y(1.02).y_anchor(Anchor::Bottom));
    (plot, layout)
}

/// A computed curve.
pub fn line(x: Vec<f64>, y: Vec<f64>, name: &str, colour: &'static str) -> Box<Scatter<f64, f64>> {
    Scatter::new(short(x), short(y)).name(label(name)).mode(Mode::Lines).line(Line::new().color(colour).width(1.8))
}

/// Points.
pub fn points(x: Vec<f64>, y: Vec<f64>, name: &str, colour: &'static str, size: usize) -> Box<Scatter<f64, f64>> {
    Scatter::new(short(x), short(y)).name(label(name)).mode(Mode::Markers).marker(Marker::new().color(colour).size(size).opacity(0.75))
}

/// The band of two standard deviations as one closed outline: there along its upper edge, back along its lower.
///
/// Of a closed loop the upper edge runs round one way and the lower the other; what both enclose cancels and only the band is filled.
pub fn band(x: &[f64], low: &[f64], high: &[f64]) -> Box<Scatter<f64, f64>> {
    let there_and_back = |there: &[f64], back: &[f64]| there.iter().chain(back.iter().rev()).copied().collect::<Vec<f64>>();
    Scatter::new(short(there_and_back(x, x)), short(there_and_back(high, low)))
        .name("± 2 σ of the measurement")
        .mode(Mode::Lines)
        .line(Line::new().width(0.0).color(GREY))
        .fill(Fill::ToSelf)
        .fill_color(Rgba::new(90, 90, 90, 0.22))
        .hover_info(HoverInfo::Skip)
}

/// A dashed line without markers.
pub fn dashed(x: Vec<f64>, y: Vec<f64>, name: &str) -> Box<Scatter<f64, f64>> {
    Scatter::new(short(x), short(y)).name(label(name)).mode(Mode::Lines).line(Line::new().color(GREY).width(1.5).dash(DashType::Dash))
}

/// A curve that is there but hidden until its name is clicked, where it belongs to a stage in between.
pub fn shown(trace: Box<Scatter<f64, f64>>, k: usize, n: usize) -> Box<Scatter<f64, f64>> {
    if k == 0 || k + 1 == n { trace } else { trace.visible(Visible::LegendOnly) }
}

/// Five significant digits: more cannot be seen, and they fill the page.
fn short(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(|v| if v.is_finite() { format!("{v:.4e}").parse().unwrap_or(v) } else { v }).collect()
}

/// Indices of at most `limit` of the points of `key`, in order: the lowest and the highest of each stretch, so that peaks stay.
pub fn thin(key: &[f64], limit: usize) -> Vec<usize> {
    let n = key.len();
    if n <= limit {
        return (0..n).collect();
    }
    let stretches = (limit.saturating_sub(2) / 2).max(1);
    let mut picked = vec![0];
    for s in 0..stretches {
        let range = s * n / stretches..(s + 1) * n / stretches;
        let by_key = |a: &usize, b: &usize| key[*a].total_cmp(&key[*b]);
        if let (Some(low), Some(high)) = (range.clone().min_by(by_key), range.max_by(by_key)) {
            picked.extend([low.min(high), low.max(high)]);
        }
    }
    picked.push(n - 1);
    picked.dedup();
    picked
}

/// The values at the given indices.
pub fn pick(values: &[f64], indices: &[usize]) -> Vec<f64> {
    indices.iter().filter_map(|i| values.get(*i).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks_ends_and_the_limit() {
        let mut key = vec![0.0; 10_000];
        key[4321] = 5.0;
        key[777] = -3.0;
        let picked = thin(&key, 800);
        assert!(picked.len() <= 800, "{}", picked.len());
        assert!(picked.contains(&4321) && picked.contains(&777));
        assert_eq!((picked.first(), picked.last()), (Some(&0), Some(&9999)));
        assert!(picked.windows(2).all(|w| w[0] < w[1]));
        assert_eq!(thin(&[1.0, 2.0], 800), vec![0, 1]);
        assert!(thin(&[], 800).is_empty());
    }
}
