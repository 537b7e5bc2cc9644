//! Numbers and names as a person reads them.

/// Text made safe for HTML.
pub fn esc(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Other control characters are not allowed in HTML.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Text made safe for plotly's labels, which read a subset of HTML: of quotes they know no entity.
pub fn label(text: &str) -> String {
    esc(text).replace("&quot;", "\"").replace("&#39;", "'")
}

/// As [`digits`], without zeros at the end: for conditions and other round numbers.
pub fn plain(value: f64, n: usize) -> String {
    let text = digits(value, n);
    if text.contains('.') && !text.contains('×') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A number with `n` significant digits: plain between 1e-3 and 1e5, else as a power of ten; `-` for what is not a number.
pub fn digits(value: f64, n: usize) -> String {
    if value.is_nan() {
        return "-".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let scientific = format!("{:.*e}", n.saturating_sub(1), value.abs());
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let power: i32 = exponent.parse().unwrap_or(0);
    let sign = if value < 0.0 { "−" } else { "" };
    if (-3..5).contains(&power) {
        let decimals = usize::try_from(n as i32 - 1 - power).unwrap_or(0);
        // From the rounded mantissa, so that 0.0999996 is not printed with a digit too many.
        let rounded: f64 = scientific.parse().unwrap_or(value.abs());
        return format!("{sign}{rounded:.decimals$}");
    }
    format!("{sign}{mantissa} × 10{}", exponent.chars().map(superscript).collect::<String>())
}

fn superscript(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
        c => c,
    }
}

/// A fraction as a percentage with two significant digits: `31 %`, `1.1 %`.
pub fn percent(fraction: f64) -> String {
    let value = 100.0 * fraction;
    if !value.is_finite() {
        return digits(value, 2);
    }
    let text = if value.abs() >= 99.5 { digits(value.round(), value.abs().round().log10() as usize + 1) } else { digits(value, 2) };
    format!("{text}\u{a0}%")
}

/// A ratio to the noise floor: `0.94`, `1.08`, `29`.
pub fn ratio(value: f64) -> String {
    digits(value, if (0.995..1.995).contains(&value.abs()) { 3 } else { 2 })
}

/// A probability; small ones as a bound.
pub fn probability(p: f64) -> String {
    if p < 1e-4 { "&lt; 0.0001".into() } else { digits(p, 2) }
}

/// `a`, `a and b`, `a, b and c`.
pub fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [head @ .., last] => format!("{} and {last}", head.join(", ")),
    }
}

/// Name of an effect as words: `elastic slip`.
pub fn words(effect: &str) -> String {
    effect.replace('_', " ")
}

/// A table: header cells, rows of cells already escaped. Numbers (columns named in `right`) stand at the right.
pub fn table(caption: &str, header: &[&str], right: &[usize], rows: &[Vec<String>]) -> String {
    let class = |k: usize| if right.contains(&k) { " class=\"n\"" } else { "" };
    let head: String = header.iter().enumerate().map(|(k, h)| format!("<th scope=\"col\"{}>{h}</th>", class(k))).collect();
    let body: String = rows
        .iter()
        .map(|row| {
            let cells: String = row.iter().enumerate().map(|(k, c)| format!("<td{}>{c}</td>", class(k))).collect();
            format!("<tr>{cells}</tr>\n")
        })
        .collect();
    let caption = if caption.is_empty() { String::new() } else { format!("<caption>{caption}</caption>") };
    format!("<div class=\"scroll\"><table>{caption}<thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table></div>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(digits(0.012345, 3), "0.0123");
        assert_eq!(digits(-20.349, 3), "−20.3");
        assert_eq!(digits(12345.6, 3), "12300");
        assert_eq!(digits(1.5e-7, 2), "1.5 × 10⁻⁷");
        assert_eq!(digits(3.0e12, 2), "3.0 × 10¹²");
        assert_eq!(digits(0.0999996, 3), "0.100");
        assert_eq!(digits(f64::NAN, 3), "-");
        assert_eq!(
            (plain(1.0, 4), plain(0.01, 4), plain(1e5, 2), plain(200.0, 4)),
            ("1".into(), "0.01".into(), "1.0 × 10⁵".into(), "200".into())
        );
        assert_eq!(digits(f64::NEG_INFINITY, 3), "−∞");
        assert_eq!(percent(0.3111), "31\u{a0}%");
        assert_eq!(percent(0.0112), "1.1\u{a0}%");
        assert_eq!(percent(12.343), "1234\u{a0}%");
        assert_eq!(percent(0.996), "100\u{a0}%");
        assert_eq!(ratio(1.0834), "1.08");
        assert_eq!((ratio(28.6), ratio(0.942), ratio(0.9967)), ("29".into(), "0.94".into(), "0.997".into()));
    }

    #[test]
    fn names_are_made_safe() {
        assert_eq!(esc("<script>\"a\" & 'b'</script>"), "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;&lt;/script&gt;");
        assert_eq!(esc("a\u{0}b\nc"), "a b c");
        assert_eq!(label("<a> \"b\" 'c'"), "&lt;a&gt; \"b\" 'c'");
    }
}
