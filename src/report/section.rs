//! A section of the report: findings, verdicts, figures and tables, as values.
//!
//! A section is kept in a file of its own as JSON, so that `--only` can recompute one and keep the others.
//!
//! **Invariant:** every sentence and every cell is made from numbers of the run that made the section.

use serde::{Deserialize, Serialize};

use crate::math::integrator::Method;

use super::svg::{Key, Plot, sheet};

/// One part of the report.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Section {
    pub(crate) name: String,
    pub(crate) title: String,
    /// Sentences that open the report.
    pub(crate) findings: Vec<String>,
    pub(crate) verdicts: Vec<Verdict>,
    pub(crate) blocks: Vec<Block>,
    /// Seconds it took, and the version that made it.
    pub(crate) seconds: f64,
    pub(crate) version: String,
    /// Whether it was made with `--quick`.
    pub(crate) quick: bool,
}

/// Something that the section was to show, and whether it did.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Verdict {
    /// The claim that should hold.
    pub(crate) claim: String,
    /// The numbers that were seen.
    pub(crate) seen: String,
    pub(crate) holds: bool,
}

/// A piece of a section's body.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) enum Block {
    Text(String),
    Figure(Figure),
    Table(Table),
}

/// A grid of panels.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Figure {
    /// Stem of its `.svg` and `.csv`.
    pub(crate) name: String,
    /// The finding.
    pub(crate) title: String,
    /// How to read it.
    pub(crate) caption: String,
    /// Swatch and label of each entry.
    pub(crate) legend: Vec<(String, String)>,
    pub(crate) panels: Vec<String>,
    /// The figure as a file of its own; not part of the page.
    #[serde(skip)]
    pub(crate) sheet: String,
}

impl Figure {
    pub(crate) fn new(
        name: &str,
        title: impl Into<String>,
        caption: impl Into<String>,
        legend: &[Key],
        plots: &[Plot],
    ) -> Self {
        let panels = plots.iter().map(Plot::render).collect();
        Self::of_panels(name, title, caption, legend, panels)
    }

    /// Makes a figure as [`Figure::new`] does, from panels that are drawn already.
    pub(crate) fn of_panels(
        name: &str,
        title: impl Into<String>,
        caption: impl Into<String>,
        legend: &[Key],
        panels: Vec<String>,
    ) -> Self {
        let title = title.into();
        Self {
            name: name.to_owned(),
            sheet: sheet(&title, legend, &panels),
            title,
            caption: caption.into(),
            legend: legend
                .iter()
                .map(|key| (key.swatch(), key.label.clone()))
                .collect(),
            panels,
        }
    }
}

/// Rows and columns of text.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Table {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) caption: String,
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new(
        name: &str,
        title: impl Into<String>,
        caption: impl Into<String>,
        head: &[&str],
    ) -> Self {
        Self {
            name: name.to_owned(),
            title: title.into(),
            caption: caption.into(),
            head: head.iter().map(|&head| head.to_owned()).collect(),
            rows: Vec::new(),
        }
    }
}

/// The head of a table with a column for each method, and others before and after them.
pub(crate) fn by_method<'a>(before: &[&'a str], after: &[&'a str]) -> Vec<&'a str> {
    [before, &Method::ALL.map(Method::name), after].concat()
}

/// A cell: its text, a line of detail under it, and a class that colours it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Cell {
    pub(crate) text: String,
    pub(crate) detail: String,
    pub(crate) class: String,
}

impl Cell {
    pub(crate) fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    /// A method's name in its colour.
    pub(crate) fn method(method: Method) -> Self {
        Self::new(method.name()).class(method.name())
    }

    pub(crate) fn detail(mut self, detail: impl Into<String>) -> Self {
        self.detail = detail.into();
        self
    }

    pub(crate) fn class(mut self, class: &str) -> Self {
        class.clone_into(&mut self.class);
        self
    }

    /// `yes` or `no`, coloured.
    pub(crate) fn verdict(holds: bool) -> Self {
        if holds {
            Self::new("holds").class("good")
        } else {
            Self::new("falls short").class("bad")
        }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::new(text)
    }
}
