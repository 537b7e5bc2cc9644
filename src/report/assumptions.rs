//! What the result rests on: assumptions, notes on the data, sources, licence.

use super::ReportInput;
use super::stage::effect_at;
use super::text::{digits, esc, list};

/// Assumptions, notes, sources.
pub fn section(input: &ReportInput) -> String {
    let study = input.study;
    let data = &study.dataset;
    let items = |title: &str, list: &[String]| {
        let items: String = list.iter().map(|s| format!("<li>{}</li>", esc(s))).collect();
        if items.is_empty() { String::new() } else { format!("<h3>{title}</h3><ul>{items}</ul>") }
    };
    let none = if study.assumptions.is_empty() && data.assumptions.is_empty() { "<p>None are declared.</p>" } else { "" };
    let effects: Vec<String> = study.system.instances.iter().map(|i| effect_at(i.name(), &i.at)).collect();
    let model = format!(
        "<h3>The model as it stands in the study</h3><p>{} bodies, {} places; {}.</p>",
        study.system.model.bodies.len(),
        (0..study.system.model.places.len()).filter(|p| study.system.model.on_connector(*p)).count(),
        if effects.is_empty() { "no effect".into() } else { list(&effects) }
    );
    let fact = |name: &str, text: Option<String>| text.map(|t| format!("<li>{name}: {}</li>", esc(&t))).unwrap_or_default();
    let fit = input.fit.map(|f| {
        format!(
            "<li>Fit: {} after {} iterations in {} s, cost {} over {} values with {} free parameters</li>",
            esc(&f.termination),
            f.iterations,
            digits(f.wall_s, 3),
            digits(f.cost, 5),
            f.n_residuals,
            f.n_free
        )
    });
    format!(
        "{none}{}{}{}{model}<h3>Sources</h3><ul>{}{}{}{}{}{}</ul>",
        items("Assumed in the study", &study.assumptions),
        items("Assumed in the dataset", &data.assumptions),
        items("Notes on data and fit", input.fit.map_or(&[][..], |f| &f.notes)),
        fact("Study", Some(study.file.display().to_string())),
        fact("Dataset", Some(data.file.display().to_string())),
        fact("Dataset title", data.title.clone()),
        fact("Source", data.source.clone()),
        fact("Licence", data.licence.clone()),
        fit.unwrap_or_default(),
    )
}
