//! Parts of a pose file that make no sense: a few are left out by name, many are an error.

use super::source::{MAX_COORDINATE, Source, UnusedView, Why, first_of};
use crate::views::{SfmPoint, Split};
use crate::{Report, Result};
use std::path::Path;

/// Of ten parts one may be left out; more are no slip of a program, but another format or a failed reconstruction.
const ONE_IN: usize = 10;

/// The views or points of a file that make no sense.
#[derive(Clone, Debug, Default)]
pub(crate) struct LeftOut {
    /// The problem of the first, and the names of all.
    problem: String,
    names: Vec<String>,
    views: Vec<UnusedView>,
}

impl LeftOut {
    /// Leaves a part out, named as its file does ("image 4 (\"a.png\")").
    pub fn push(&mut self, name: String, problem: impl Into<String>) {
        if self.names.is_empty() {
            self.problem = problem.into();
        }
        self.names.push(name);
    }

    /// Leaves a view out; `element` names it as its file does.
    pub fn push_view(&mut self, element: String, name: &str, problem: impl Into<String>) {
        self.push_split_view(element, name, problem, None);
    }

    /// The same, with the side of the split that the files state.
    pub fn push_split_view(
        &mut self,
        element: String,
        name: &str,
        problem: impl Into<String>,
        split: Option<Split>,
    ) {
        self.push(element, problem);
        self.views.push(UnusedView { name: name.to_owned(), why: Why::Broken, split });
    }

    /// Number of parts.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// What is wrong with the first, and which others there are.
    pub fn details(&self) -> String {
        match &self.names[..] {
            [] => String::new(),
            [only] => format!("{only}: {}", self.problem),
            [first, others @ ..] => {
                format!("{first}: {}; also {}", self.problem, first_of(others.iter().cloned()))
            }
        }
    }

    /// As [`Self::finish`], for views of a capture.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn finish_views(mut self, path: &Path, total: usize, source: &mut Source) -> Result<()> {
        source.unused.append(&mut self.views);
        self.finish(path, "views", total, &mut source.report)
    }

    /// Warns of the parts that were left out of `total`, if any; `noun` is what they are ("views").
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if they are more than a tenth of all.
    pub fn finish(self, path: &Path, noun: &str, total: usize, report: &mut Report) -> Result<()> {
        let count = self.count();
        if is_too_many(count, total) {
            return Err(invalid!(
                path,
                "{count} of {total} {noun} are broken, and no more than one in {ONE_IN} may be left out: {}; \
                 export them again",
                self.details()
            ));
        }
        if count > 0 {
            let what = format!(
                "{}: {count} of {total} {noun} {} broken and left out: {}",
                crate::text::path(path),
                if count == 1 { "is" } else { "are" },
                self.details()
            );
            report.warn(&format!("{noun}-left-out"), count, what);
        }
        Ok(())
    }
}

/// Whether so large a share of all can be no slip.
pub(crate) fn is_too_many(count: usize, total: usize) -> bool {
    count * ONE_IN > total
}

fn is_place(point: &SfmPoint) -> bool {
    let p = point.position_in_capture;
    p.is_finite() && p.abs().max_element() <= MAX_COORDINATE
}

/// Leaves out points without a position, and warns of those that could not be read.
///
/// # Errors
/// [`crate::Error::InvalidInput`] if they are more than a tenth of all.
pub(crate) fn points(source: &mut Source, report: &mut Report) -> Result<()> {
    let mut left_out = LeftOut::default();
    for (name, problem) in std::mem::take(&mut source.broken_points) {
        left_out.push(name, problem);
    }
    let total = source.points.len() + left_out.count();
    push_points(&source.points, &mut left_out);
    if left_out.count() == 0 {
        return Ok(());
    }
    let path = source.points_file.clone().unwrap_or_else(|| source.path.clone());
    left_out.finish(&path, "points", total, report)?;
    source.retain_points(is_place);
    Ok(())
}

/// The points as they are, unless too many of them have no position.
///
/// # Errors
/// [`crate::Error::InvalidInput`] if they are more than a tenth of all.
pub(crate) fn checked_points(path: &Path, points: Vec<SfmPoint>) -> Result<Vec<SfmPoint>> {
    let mut left_out = LeftOut::default();
    push_points(&points, &mut left_out);
    left_out.finish(path, "points", points.len(), &mut Report::default())?;
    Ok(points)
}

fn push_points(points: &[SfmPoint], left_out: &mut LeftOut) {
    for (index, point) in points.iter().enumerate().filter(|(_, point)| !is_place(point)) {
        let position = point.position_in_capture.to_array();
        left_out.push(format!("number {}", index + 1), format!("its position is {position:?}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finished(broken: usize, total: usize) -> Result<Report> {
        let mut left_out = LeftOut::default();
        for index in 0..broken {
            left_out.push(format!("image {index}"), format!("its pose is {index}"));
        }
        let mut report = Report::default();
        left_out.finish(Path::new("model"), "views", total, &mut report).map(|()| report)
    }

    #[test]
    fn a_tenth_may_be_left_out_and_no_more() {
        assert!(finished(0, 0).unwrap().warnings.is_empty(), "negative control");
        let report = finished(2, 20).unwrap();
        assert_eq!((&*report.warnings[0].code, report.warnings[0].count), ("views-left-out", 2));
        let message = &report.warnings[0].message;
        assert_eq!(
            message,
            "model: 2 of 20 views are broken and left out: image 0: its pose is 0; also image 1"
        );
        for (broken, total) in [(1, 9), (3, 20), (1, 1)] {
            let message = finished(broken, total).unwrap_err().to_string();
            assert!(message.contains("image 0: its pose is 0") && message.contains("one in 10"), "{message}");
        }
    }
}
