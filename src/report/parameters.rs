//! Parameters with intervals and identifiability.

use crate::diagnose::results::ParameterResult;

use super::ReportInput;
use super::stage::Stage;
use super::text::{digits, esc, table};

/// The parameters of the last stage, beside their values on the first, and the combinations the data do not determine.
pub fn section(input: &ReportInput, stages: &[Stage]) -> String {
    let (Some(first), Some(last)) = (stages.first(), stages.last()) else { return String::new() };
    if last.parameters.is_empty() {
        return String::new();
    }
    let several = stages.len() > 1;
    let row = |p: &ParameterResult| {
        let before = first.parameters.iter().find(|q| q.name == p.name);
        let mut row = vec![esc(&p.name)];
        if several {
            row.push(before.map_or("-".into(), printed));
        }
        row.extend([printed(p), interval(p), state(p), p.note.as_deref().map(esc).unwrap_or_default()]);
        row
    };
    let rows: Vec<Vec<String>> = last.parameters.iter().map(row).collect();
    let header: &[&str] = if several {
        &["Parameter", "Model as given", "Now", "95 % interval", "Determined by the data?", "Note"]
    } else {
        &["Parameter", "Value", "95 % interval", "Determined by the data?", "Note"]
    };
    // The unidentifiable combinations are the fit's: they are shown where the fit is of a model that the page shows.
    let named = input.fit.filter(|f| !f.unidentifiable.is_empty()).map(|f| {
        let items: String = f.unidentifiable.iter().map(|u| format!("<li>{}</li>", esc(u))).collect();
        let of = if f.effects == last.effects { "" } else { " (model as given)" };
        format!("<h3>Combinations the data do not determine{of}</h3><ul>{items}</ul>")
    });
    format!("{}{}", table("", header, &[], &rows), named.unwrap_or_default())
}

/// Value as the engineer writes it.
fn printed(p: &ParameterResult) -> String {
    let text = if p.printed.is_empty() { format!("{} {}", digits(p.value, 5), p.unit) } else { p.printed.replace("+-", "±") };
    esc(text.trim())
}

fn interval(p: &ParameterResult) -> String {
    esc(&p.printed_interval).replace("-inf", "−∞").replace("inf", "∞")
}

fn state(p: &ParameterResult) -> String {
    let known = match (p.identifiable, p.known()) {
        (true, "at its bound" | "yes") => "<span class=\"yes\">yes</span>".to_string(),
        (_, "at its bound") => "<span class=\"no\">no</span>".to_string(),
        (_, other) => format!("<span class=\"no\">{other}</span>"),
    };
    format!("{known}{}", if p.at_bound { ", <span class=\"no\">at its bound</span>" } else { "" })
}
