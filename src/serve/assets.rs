//! The page, held in the program.

use crate::report::PLOTLY;

/// Content type and text of a file of the page.
pub fn file(name: &str) -> Option<(&'static str, &'static str)> {
    const JS: &str = "text/javascript; charset=utf-8";
    Some(match name {
        "" => ("text/html; charset=utf-8", include_str!("page/index.html")),
        "style.css" => ("text/css; charset=utf-8", include_str!("page/style.css")),
        "main.js" => (JS, include_str!("page/main.js")),
        "core.js" => (JS, include_str!("page/core.js")),
        "compare.js" => (JS, include_str!("page/compare.js")),
        "plots.js" => (JS, include_str!("page/plots.js")),
        "structure.js" => (JS, include_str!("page/structure.js")),
        "parameters.js" => (JS, include_str!("page/parameters.js")),
        "models.js" => (JS, include_str!("page/models.js")),
        "modes.js" => (JS, include_str!("page/modes.js")),
        "new.js" => (JS, include_str!("page/new.js")),
        "plotly.js" => (JS, PLOTLY.as_str()),
        "icon.svg" => ("image/svg+xml", include_str!("page/icon.svg")),
        _ => return None,
    })
}
