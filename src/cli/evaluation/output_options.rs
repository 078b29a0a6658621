//! Options of the files that an evaluation writes.

use std::path::{Path, PathBuf};

use super::csv::csv;
use super::page::Page;
use super::view_pictures::{PictureFormat, ViewPictures};
use crate::{Context, Error, check_output, write_atomically};
use strivec_measure::Report;
use strivec_recipe::Reservation;

/// The files of results.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Files of results")]
pub(crate) struct OutputOptions {
    /// Write the measures of each view as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write one HTML page without references to other files: tables, and rendered pictures beside photographs and errors
    /// (brightest at 0.2 and above)
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Show the pictures of N views in the report, spread over the split; 0 shows none
    #[arg(long, value_name = "N", default_value_t = 12, requires = "report")]
    report_views: usize,
    /// Encode the report's pictures as JPEG (quality 90) or, exact and about five times as large, as PNG
    #[arg(long, value_enum, default_value_t, requires = "report")]
    report_pictures: PictureFormat,
}

impl OutputOptions {
    /// Checks, before any work is done, that the files can be written, and reserves them.
    pub(crate) fn check(&self, session: &Context) -> Result<Vec<Reservation>, Error> {
        if self.csv.is_some() && self.csv == self.report {
            return Err(Error::Usage("--csv and --report name the same file; name two".into()));
        }
        self.csv.iter().chain(&self.report).map(|path| check_output(path, session.force)).collect()
    }

    /// Collects the pictures of the report for `views` views.
    pub(crate) fn pictures(&self, views: usize) -> ViewPictures {
        let shown = if self.report.is_some() { self.report_views } else { 0 };
        ViewPictures::new(views, shown, self.report_pictures)
    }

    /// Writes the files: the views of `reports`, by file, and the page.
    pub(crate) fn write(
        &self,
        reports: &[(&Path, &Report)],
        page: impl FnOnce() -> Page,
        session: &Context,
    ) -> Result<(), Error> {
        if let Some(path) = &self.csv {
            write_atomically(path, csv(reports).as_bytes(), session.force)?;
        }
        match &self.report {
            Some(path) => write_atomically(path, page().html().as_bytes(), session.force),
            None => Ok(()),
        }
    }
}
