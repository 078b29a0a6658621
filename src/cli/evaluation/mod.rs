//! Evaluation of scenes against photographs, for the commands `eval` and `compare`: options, measuring, and results as CSV and
//! as a page.

mod csv;
mod evaluator;
mod measure_options;
mod metric;
mod output_options;
mod page;
mod photographs;
mod view_pictures;

pub(super) use csv::quoted;
pub(super) use evaluator::{Evaluated, Evaluator, SceneToEvaluate, Shown};
pub(super) use measure_options::MeasureOptions;
pub(super) use metric::Metric;
pub(super) use output_options::OutputOptions;
pub(super) use page::{Page, PageTable, TableCell};
pub(super) use photographs::Photographs;
pub(super) use view_pictures::ShownView;
