//! Charts: plotly's figures (traces, layout, configuration) as JSON, in the page's one style. The names of attributes are plotly's own:
//! <https://plotly.com/javascript/reference/>.

use serde_json::{Map, Value, json};

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
    pub fn figure(&mut self, chart: Chart, height: usize, caption: &str, class: &str) -> String {
        self.count += 1;
        let id = format!("chart-{}", self.count);
        let config = json!({ "responsive": true, "displaylogo": false, "displayModeBar": false });
        let [data, layout, config] = [chart.data.into(), chart.layout.into(), config].map(|v: Value| in_script(&v));
        format!(
            "<figure class=\"{class}\"><figcaption>{caption}</figcaption><div id=\"{id}\" style=\"height:{height}px\"></div>\n\
             <script>Plotly.newPlot(\"{id}\", {data}, {layout}, {config});</script></figure>\n"
        )
    }
}

/// JSON inside a script of the page: without `<`, no text of it ends the script or opens a comment.
fn in_script(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Attributes of a trace, an axis, a line or a marker, by plotly's names.
pub struct Attributes(Map<String, Value>);

impl Attributes {
    fn new<const N: usize>(all: [(&str, Value); N]) -> Self {
        Attributes(all.into_iter().map(|(name, value)| (name.to_string(), value)).collect())
    }

    /// With one attribute more, or another value of it.
    pub fn set(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.0.insert(name.into(), value.into());
        self
    }
}

impl From<Attributes> for Value {
    fn from(attributes: Attributes) -> Value {
        Value::Object(attributes.0)
    }
}

/// Traces over two axes.
pub struct Chart {
    data: Vec<Value>,
    layout: Attributes,
}

impl Chart {
    /// An empty chart.
    pub fn new(x: &Along, y: &Along) -> Self {
        let family = "Helvetica Neue, Helvetica, Arial, Liberation Sans, sans-serif";
        let layout = Attributes::new([
            ("paper_bgcolor", "white".into()),
            ("plot_bgcolor", "white".into()),
            ("font", json!({ "family": family, "size": 12, "color": INK })),
            ("margin", json!({ "l": 56, "r": 10, "t": 8, "b": 44 })),
            ("hovermode", "closest".into()),
            ("showlegend", true.into()),
            ("legend", json!({ "orientation": "h", "x": 0.0, "xanchor": "left", "y": 1.02, "yanchor": "bottom" })),
        ]);
        Chart { data: vec![], layout }.with("xaxis", axis(x)).with("yaxis", axis(y))
    }

    /// With an axis in place of `xaxis` or `yaxis`, or a further one, `yaxis2`.
    pub fn with(mut self, name: &str, axis: Attributes) -> Self {
        self.layout = self.layout.set(name, axis);
        self
    }

    /// Draws a trace over those before it.
    pub fn add(&mut self, trace: Attributes) {
        self.data.push(trace.into());
    }
}

/// The page's style for charts that are drawn elsewhere: an empty layout, an axis of each kind, colours.
pub fn style() -> Value {
    let axis = |along: &Along| Value::from(axis(along));
    json!({
        "layout": Value::from(Chart::new(&linear(""), &linear("")).layout),
        "linear": axis(&linear("")), "decades": axis(&decades("")), "frequencies": axis(&frequencies("")),
        "ink": INK, "first": FIRST, "last": LAST, "grey": GREY, "others": OTHERS,
    })
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
pub fn axis(along: &Along) -> Attributes {
    let font = json!({ "size": 12, "color": "#333333" });
    let axis = Attributes::new([
        ("title", json!({ "text": label(along.title), "font": font })),
        ("tickfont", font),
        ("gridcolor", "#e9e9e9".into()),
        ("linecolor", GREY.into()),
        ("showline", true.into()),
        ("zeroline", false.into()),
        ("automargin", true.into()),
    ]);
    match along.log {
        None => axis,
        Some(Ticks::Decades) => axis.set("type", "log").set("dtick", 1).set("exponentformat", "power"),
        Some(Ticks::At(of_ten)) => {
            let at: Vec<f64> = (-6..7).flat_map(|d| of_ten.iter().map(move |v| v * 10f64.powi(d))).collect();
            let text: Vec<String> = at.iter().map(|v| plain(*v, 1)).collect();
            axis.set("type", "log").set("tickvals", at).set("ticktext", text)
        }
    }
}

/// The line of a trace, `width` in pixels.
pub fn stroke(colour: &str, width: f64) -> Attributes {
    Attributes::new([("color", colour.into()), ("width", width.into())])
}

/// The marker of a trace, `size` in pixels; the symbol by plotly's name.
pub fn marker(colour: &str, size: usize, symbol: &str) -> Attributes {
    Attributes::new([("color", colour.into()), ("size", size.into()), ("symbol", symbol.into())])
}

/// A trace of values or words over values or words; `mode`: `lines`, `markers`, `lines+markers`.
pub fn scatter(x: impl Into<Value>, y: impl Into<Value>, name: &str, mode: &str) -> Attributes {
    Attributes::new([("type", "scatter".into()), ("x", x.into()), ("y", y.into()), ("name", label(name).into()), ("mode", mode.into())])
}

/// Bars over names.
pub fn bars(names: Vec<String>, heights: Vec<f64>, name: &str, colour: &str) -> Attributes {
    Attributes::new([
        ("type", "bar".into()),
        ("x", names.into()),
        ("y", heights.into()),
        ("name", label(name).into()),
        ("marker", json!({ "color": colour })),
    ])
}

/// A computed curve.
pub fn line(x: Vec<f64>, y: Vec<f64>, name: &str, colour: &str) -> Attributes {
    scatter(short(x), short(y), name, "lines").set("line", stroke(colour, 1.8))
}

/// Points.
pub fn points(x: Vec<f64>, y: Vec<f64>, name: &str, colour: &str, size: usize) -> Attributes {
    scatter(short(x), short(y), name, "markers").set("marker", marker(colour, size, "circle").set("opacity", 0.75))
}

/// The band of two standard deviations as one closed outline: there along its upper edge, back along its lower.
///
/// Of a closed loop the upper edge runs round one way and the lower the other; what both enclose cancels and only the band is filled.
pub fn band(x: &[f64], low: &[f64], high: &[f64]) -> Attributes {
    let there_and_back = |there: &[f64], back: &[f64]| there.iter().chain(back.iter().rev()).copied().collect::<Vec<f64>>();
    scatter(short(there_and_back(x, x)), short(there_and_back(high, low)), "± 2 σ of the measurement", "lines")
        .set("line", stroke(GREY, 0.0))
        .set("fill", "toself")
        .set("fillcolor", "rgba(90, 90, 90, 0.22)")
        .set("hoverinfo", "skip")
}

/// A dashed line without markers.
pub fn dashed(x: Vec<f64>, y: Vec<f64>, name: &str) -> Attributes {
    scatter(short(x), short(y), name, "lines").set("line", stroke(GREY, 1.5).set("dash", "dash"))
}

/// A curve that is there but hidden until its name is clicked, where it belongs to a stage in between.
pub fn shown(trace: Attributes, k: usize, n: usize) -> Attributes {
    if k == 0 || k + 1 == n { trace } else { trace.set("visible", "legendonly") }
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

    #[test]
    fn no_text_leaves_its_script_and_none_is_changed() {
        let hostile = "</script><script>alert(1)</script> <!--<script> \"x\" \\ \u{2028}";
        let mut chart = Chart::new(&linear(hostile), &decades("y"));
        chart.add(line(vec![0.0, f64::NAN], vec![1.0, 2.0], hostile, INK).set("text", hostile));
        let html = Charts::default().figure(chart, 100, "", "");
        assert_eq!((html.matches("<script").count(), html.matches("</script").count(), html.matches("<!--").count()), (1, 1, 0), "{html}");
        let call = html.split("newPlot(").nth(1).and_then(|c| c.split(");</script>").next()).unwrap();
        let arguments: Value = serde_json::from_str(&format!("[{call}]")).unwrap();
        let trace = &arguments[1][0];
        assert_eq!((arguments[0].as_str(), trace["text"].as_str()), (Some("chart-1"), Some(hostile)));
        // Names are plotly's labels, which read HTML; what is no number leaves a gap.
        assert_eq!(trace["name"].as_str(), Some(label(hostile).as_str()));
        assert_eq!(arguments[2]["xaxis"]["title"]["text"].as_str(), Some(label(hostile).as_str()));
        assert_eq!(trace["x"], json!([0.0, null]));
        assert_eq!(arguments[2]["yaxis"]["type"], "log");
    }
}
