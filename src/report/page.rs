//! The frame of the page: head, style, contents, and plotly's script once.

use std::io::Read;
use std::sync::LazyLock;

use flate2::read::GzDecoder;

use super::text::esc;

/// A page under construction.
pub struct Page {
    title: String,
    contents: Vec<(String, String)>,
    body: String,
}

impl Page {
    /// An empty page.
    pub fn new(title: &str) -> Self {
        Page { title: esc(title), contents: vec![], body: String::new() }
    }

    /// Adds a section; one without content is left out. The first, without a heading, is the summary.
    pub fn section(&mut self, id: &str, heading: &str, content: String) {
        if content.is_empty() {
            return;
        }
        if heading.is_empty() {
            self.body += &content;
            return;
        }
        self.contents.push((id.into(), heading.into()));
        self.body += &format!("<section id=\"{id}\">\n<h2>{heading}</h2>\n{content}</section>\n");
    }

    /// The document.
    pub fn finish(self) -> String {
        let links: String = self.contents.iter().map(|(id, h)| format!("<a href=\"#{id}\">{h}</a>\n")).collect();
        let Page { title, body, .. } = self;
        let css = include_str!("page.css");
        let body = body.replacen(CONTENTS, &format!("<nav aria-label=\"Contents\">{links}</nav>"), 1);
        let body = body.replacen(SCRIPT, &script(), 1);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title} - misfit report</title>\n\
             <style>\n{css}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
        )
    }
}

/// Where the contents stand: after the first screen.
pub const CONTENTS: &str = "<!--contents-->";
/// Where plotly's script stands: after the words of the first screen, so that they are there before it is parsed, before the first chart.
pub const SCRIPT: &str = "<!--script-->";

/// plotly.js 3.7.0 with the traces `scatter`, `bar` and `pie`: the npm package `plotly.js-basic-dist-min`, unchanged (MIT). It is compressed in the program,
/// which is a third of a megabyte of it then and not more than one.
pub static PLOTLY: LazyLock<String> = LazyLock::new(|| {
    let mut text = String::new();
    // The bytes are part of the program: a test reads them.
    let _ = GzDecoder::new(include_bytes!("plotly/plotly-basic.min.js.gz").as_slice()).read_to_string(&mut text);
    text
});

/// plotly, and a few lines that draw a chart when it comes into view.
fn script() -> String {
    format!("<script>\n{}</script>\n<script>\n{}</script>\n", *PLOTLY, include_str!("page.js"))
}
