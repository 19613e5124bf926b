//! A section of the page: charts of one kind, and what they share.

use super::measure::Measure;
use super::parts::{Axis, Chart};
use super::scale::Spacing;
use super::study::Study;
use std::collections::HashSet;

/// Charts of one kind and scene, or why there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    pub title: String,
    /// How to read the charts, and what is missing from them.
    pub note: String,
    pub charts: Vec<Chart>,
}

/// Explains why a chart of time has fewer points than one of size; empty if it does not.
pub fn missing_times(study: &Study, scene: &str) -> String {
    let of_scene = || study.runs.iter().filter(|r| r.scene == scene);
    let missing = of_scene().filter(|r| !study.counts_time(r)).count();
    match missing {
        0 => String::new(),
        n => format!(
            "{n} of the {} runs were made on a busy machine and are missing from charts of time.",
            of_scene().count()
        ),
    }
}

/// A logarithmic axis.
pub fn axis(cost: &Measure) -> Axis {
    Axis { name: cost.title(), spacing: Spacing::Log10, quantity: cost.quantity }
}

/// Turns a name into a part of a file name that differs from all in `taken`.
pub fn slug(name: &str, taken: &mut HashSet<String>) -> String {
    let letters = name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' });
    let words: String = letters.collect();
    let base = words.split_whitespace().collect::<Vec<_>>().join("-");
    let base = if base.is_empty() { "scene".to_owned() } else { base };
    let mut slug = base.clone();
    let mut number = 2;
    while !taken.insert(slug.clone()) {
        slug = format!("{base}-{number}");
        number += 1;
    }
    slug
}
