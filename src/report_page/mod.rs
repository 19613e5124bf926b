//! The report of a run as one web page: the scene in the page that draws it, and beneath it what was measured. Everything here is a
//! function of [`ReportFigures`], which `litetex report` collects: no file is read, nothing is rendered.

mod bars;
mod coverage;
mod curve;
mod escape;
mod figures;
mod html;
mod picture;
mod sections;
#[cfg(test)]
mod tests;

pub use coverage::{COVERAGE_VIEWS_MAX, Coverage, SeenCounter};
pub use curve::TrainingCurve;
pub use figures::{FileFigures, ReportFigures, WorstView, WorstViews};
pub use html::report_html;
pub use picture::{PICTURE_PX, Picture};
