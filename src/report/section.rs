//! A section of the report under construction: findings, verdicts, and figures and tables as HTML.
//!
//! **Invariant:** every sentence and every cell is made from numbers of the run that made the section.

use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Value, json};

use super::svg::{HEIGHT, Key, Marker, Plot, WIDTH, csv, escape, lines, style};
use crate::math::count::length_in_f64;
use crate::study::tableau::Pair;

/// One part of the report.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Section {
    pub(crate) name: String,
    pub(crate) title: String,
    /// Sentences for the head of the report.
    pub(crate) findings: Vec<String>,
    pub(crate) verdicts: Vec<Verdict>,
    /// Tables in words alone.
    pub(super) tables: Vec<Value>,
    /// Run time \[s\].
    pub(crate) seconds: f64,
    /// Whether it is made with `--quick`.
    #[serde(skip)]
    pub(crate) quick: bool,
    /// Figures and tables, in order.
    #[serde(skip)]
    pub(crate) html: String,
    /// The processor of the measurements.
    #[serde(skip)]
    pub(super) processor: String,
    /// Name and tableaus of the reader's own method.
    #[serde(skip)]
    pub(super) own: Option<(String, Pair)>,
    /// Folder of the report, which may contain external counts.
    #[serde(skip)]
    pub(super) out: PathBuf,
    /// Names and contents of files beside the page.
    #[serde(skip)]
    pub(super) files: Vec<(String, String)>,
}

/// A claim of the section, and whether it holds.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Verdict {
    /// The claim that should hold.
    pub(crate) claim: String,
    /// The measured numbers.
    pub(crate) seen: String,
    pub(crate) holds: bool,
}

/// Placeholder of a figure's number, which the page inserts.
pub(super) const NUMBER: &str = "Figure #.";

impl Section {
    /// One of two values: for the full report, or for a quick one.
    pub(crate) fn choose<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub(crate) fn claim(&mut self, claim: impl Into<String>, seen: impl Into<String>, holds: bool) {
        let (claim, seen) = (claim.into(), seen.into());
        self.verdicts.push(Verdict { claim, seen, holds });
    }

    pub(crate) fn table(&mut self, table: &Table) {
        self.html += &table.html("h3");
        let row = |row: &Vec<Cell>| row.iter().map(Cell::said).collect();
        let rows: Vec<Vec<String>> = table.rows.iter().map(row).collect();
        let Table { title, head, .. } = table;
        let text = json!({ "name": table.name, "title": title, "head": head, "rows": rows });
        self.tables.push(text);
    }

    /// A grid of panels with its files. The title states the result, and the caption explains the figure.
    pub(crate) fn figure(&mut self, name: &str, title: &str, caption: &str, panels: &[Plot]) {
        let mut legend: Vec<&Key> = Vec::new();
        for key in panels
            .iter()
            .flat_map(|plot| &plot.curves)
            .map(|it| &it.key)
        {
            match legend.iter_mut().find(|known| known.label == key.label) {
                // A line and its marks are one entry.
                Some(known) if known.marker == Marker::None => *known = key,
                None if !key.label.is_empty() => legend.push(key),
                _ => {}
            }
        }
        let key = |key: &&Key| format!("<span>{} {}</span>", key.swatch(), escape(&key.label));
        let drawn: String = panels.iter().map(Plot::svg).collect();
        self.html += &format!(
            "<figure id=\"{name}\"><h3>{NUMBER} {}</h3><p class=\"legend\">{}</p><div class=\"panels{}\">{drawn}</div>\
             <figcaption>{} <a href=\"{name}.svg\">{name}.svg</a>, <a href=\"{name}.csv\">{name}.csv</a>\
             </figcaption></figure>",
            escape(title),
            legend.iter().map(key).collect::<String>(),
            grid(panels.len()).1,
            escape(caption),
        );
        self.files.push((format!("{name}.csv"), csv(panels)));
        self.files
            .push((format!("{name}.svg"), sheet(title, &legend, panels)));
    }
}

/// Rows and columns of text.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    name: &'static str,
    title: String,
    caption: String,
    head: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new<'a>(
        name: &'static str,
        title: impl Into<String>,
        caption: impl Into<String>,
        head: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        Self {
            name,
            title: title.into(),
            caption: caption.into(),
            head: head.into_iter().map(str::to_owned).collect(),
            rows: Vec::new(),
        }
    }

    /// The table under a heading; a long one is folded.
    pub(super) fn html(&self, heading: &str) -> String {
        const FOLDED: usize = 8;
        let fold = if self.rows.len() > FOLDED {
            let summary = format!("<details><summary>{} rows</summary>", self.rows.len());
            (summary, "</details>")
        } else {
            (String::new(), "")
        };
        let head = |name: &String| match name.as_str() {
            "" => "<td></td>".to_owned(),
            name => format!("<th>{}</th>", escape(name)),
        };
        let row = |row: &Vec<Cell>| {
            let cells: String = row.iter().map(Cell::html).collect();
            format!("<tr>{cells}</tr>")
        };
        format!(
            "<{heading}>{}</{heading}><p class=\"caption\">{}</p>{}<div class=\"scroll\"><table><thead><tr>{}</tr>\
             </thead><tbody>{}</tbody></table></div>{}",
            escape(&self.title),
            escape(&self.caption),
            fold.0,
            self.head.iter().map(head).collect::<String>(),
            self.rows.iter().map(row).collect::<String>(),
            fold.1
        )
    }
}

/// Class and words of a verdict; `None` for a claim that was not tested.
pub(crate) const fn verdict(holds: Option<bool>) -> (&'static str, &'static str) {
    match holds {
        Some(true) => ("good", "holds"),
        Some(false) => ("bad", "does not hold"),
        None => ("soft", "not run"),
    }
}

/// A cell: its text, a line of detail under it, and a class that colours it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    text: String,
    detail: String,
    class: &'static str,
}

impl Cell {
    pub(crate) fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    pub(crate) fn detail(self, detail: impl Into<String>) -> Self {
        Self {
            detail: detail.into(),
            ..self
        }
    }

    pub(crate) fn class(self, class: &'static str) -> Self {
        Self { class, ..self }
    }

    pub(crate) fn verdict(holds: Option<bool>) -> Self {
        let (class, words) = verdict(holds);
        Self::new(words).class(class)
    }

    fn said(&self) -> String {
        match self.detail.as_str() {
            "" => self.text.clone(),
            detail => format!("{} ({detail})", self.text),
        }
    }

    fn html(&self) -> String {
        let detail = match self.detail.as_str() {
            "" => String::new(),
            detail => format!("<small>{}</small>", escape(detail)),
        };
        format!(
            "<td class=\"{}\">{}{detail}</td>",
            self.class,
            escape(&self.text)
        )
    }
}

/// For a number of panels: the columns of the sheet, the class of the grid on the page, and the scale of a panel.
fn grid(panels: usize) -> (usize, &'static str, f64) {
    match panels {
        0..=2 => (panels.max(1), " few", 1.0),
        24.. => (6, " many", 0.5),
        _ if panels.is_multiple_of(4) => (4, " four", 1.0),
        _ => (3, "", 1.0),
    }
}

/// A figure as one file, with its style inside. Heading and legend are wrapped.
fn sheet(title: &str, legend: &[&Key], panels: &[Plot]) -> String {
    /// Between the edge and the text in pixels.
    const MARGIN: f64 = 14.0;
    let (columns, _, scale) = grid(panels.len());
    let (panel_width, panel_height) = (scale * WIDTH, scale * HEIGHT);
    let width = panel_width * length_in_f64(columns);
    let mut head = String::new();
    let mut y = 4.0;
    for line in lines(title, width - 2.0 * MARGIN, LETTER) {
        y += 22.0;
        let line = escape(&line);
        head += &format!("<text class=\"heading\" x=\"{MARGIN}\" y=\"{y}\">{line}</text>");
    }
    let mut x = MARGIN;
    y += 14.0;
    for key in legend {
        let entry = 52.0 + 6.6 * length_in_f64(key.label.chars().count());
        if x > MARGIN && x + entry > width {
            (x, y) = (MARGIN, y + 18.0);
        }
        head += &format!(
            "<g transform=\"translate({x} {y})\">{}<text class=\"label\" x=\"34\" y=\"10\">{}</text></g>",
            key.swatch(),
            escape(&key.label)
        );
        x += entry;
    }
    let header = y + 22.0;
    let height = panel_height * length_in_f64(panels.len().div_ceil(columns)) + header;
    let placed = panels.iter().enumerate().map(|(index, panel)| {
        let x = panel_width * length_in_f64(index % columns);
        let y = header + panel_height * length_in_f64(index / columns);
        let place =
            format!("<svg x=\"{x}\" y=\"{y}\" width=\"{panel_width}\" height=\"{panel_height}\" ");
        panel.svg().replacen("<svg ", &place, 1)
    });
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\"><style>{}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>\
         {head}{}</svg>\n",
        style(),
        placed.collect::<String>()
    )
}

/// Upper bound of the average width of a heading's letter in the usual fonts, in pixels.
const LETTER: f64 = 10.4;
