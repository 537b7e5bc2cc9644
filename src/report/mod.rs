//! The report: one HTML file that opens offline and says first what an engineer asks first: does the model fit, where does it fail,
//! what is missing, how far did the error fall.
//!
//! Measured is drawn dark, computed in colour (Okabe and Ito's palette, distinct to colour-blind eyes), the noise as a grey band of two
//! standard deviations. plotly's script stands once in the file; nothing is loaded from elsewhere.

mod assumptions;
pub mod chart;
mod curves;
mod error;
mod evidence;
mod identified;
mod modes;
mod overview;
mod page;
mod parameters;
mod population;
mod shapes;
mod stage;
mod summary;
mod sweeps;
mod text;
mod tolerance;
mod unexplained;
#[cfg(test)]
mod modes_tests;
#[cfg(test)]
mod tests;

use std::path::Path;

use crate::diagnose::results::{Diagnosis, FitResult, LadderResult};
use crate::model::System;
use crate::predict::Sweep;
use crate::study::Study;
use crate::tolerance::Outcome;

pub use curves::{Units, driven};
pub use error::ReportError;
pub use page::PLOTLY;
pub use population::population;
pub use shapes::{outline, swings};
pub use text::esc as escaped;

/// What a report is made of. A part that is not there is left out of the page.
#[derive(Clone, Copy, Debug)]
pub struct ReportInput<'a> {
    /// The study: title, model, assumptions, conditions of the tests.
    pub study: &'a Study,
    /// The model the page ends with, at its values; none: as the study stands.
    pub system: Option<&'a System>,
    /// The fit of the study as it stands.
    pub fit: Option<&'a FitResult>,
    /// What a diagnosis said of that fit.
    pub diagnosis: Option<&'a Diagnosis>,
    /// The ladder climbed from it; where there is one, its rungs are what the page compares.
    pub ladder: Option<&'a LadderResult>,
}

/// The page as text: one self-contained HTML document.
///
/// Curves are thinned to at most 800 points per trace, and to fewer where there are many, so that the page stays under 8 MB. Refuses
/// curves whose columns are not equally long.
pub fn html(input: &ReportInput) -> Result<String, ReportError> {
    html_with(input, None, &[])
}

/// The page with what a prediction says of tolerance cases and of sweeps.
pub fn html_with(input: &ReportInput, tolerance: Option<&Outcome>, sweeps: &[Sweep]) -> Result<String, ReportError> {
    let stages = stage::stages(input);
    stage::check(&stages)?;
    let mut charts = chart::Charts::default();
    let mut page = page::Page::new(&input.study.title);
    page.section("", "", summary::section(input, &stages, &mut charts));
    // Who asks for the energies of tolerance cases reads them first.
    page.section("tolerance", "Tolerance cases", tolerance.map_or(String::new(), |t| tolerance::section(t, &mut charts)));
    page.section("tests", "Every test against the model", overview::tests(input, &stages, &mut charts));
    page.section("rungs", "The rungs of the ladder", evidence::rungs(input, &stages, &mut charts));
    page.section("unexplained", "What no effect explains", unexplained::section(input, &mut charts));
    page.section("candidates", "Effects that were weighed", evidence::candidates(input));
    page.section("findings", "What the residuals show", evidence::findings(input));
    page.section("sweeps", "Sweeps", sweeps::section(sweeps, &mut charts));
    page.section("parameters", "Parameters", parameters::section(input, &stages));
    page.section("modes", "Natural modes", modes::section(input, &mut charts));
    page.section("curves", "Measurement and model, test by test", curves::section(input, &stages, &mut charts));
    page.section("assumptions", "Assumptions, data and sources", assumptions::section(input));
    Ok(page.finish())
}

/// Writes the page to `file`, whole or not at all.
pub fn write(input: &ReportInput, file: &Path) -> Result<(), ReportError> {
    let text = html(input)?;
    crate::limits::replace(file, text.as_bytes()).map_err(|source| ReportError::Write { file: file.to_path_buf(), source })
}
