//! Small SVG plots: log axes, lines, markers, marks that explain, heat maps. No library, no script, no colour of its
//! own.
//!
//! Colours are CSS classes ([`STYLE`]): one per method throughout, from a palette that survives colour blindness, with
//! a marker shape each, light and dark. A plot is drawn for a column of some 400 px; figures are grids of such panels.
//!
//! **Invariant:** whatever has no place on the axes is drawn at the edge as lost, never dropped in silence.

mod axis;
mod bars;
mod heat;
mod plot;

pub(crate) use axis::{Axis, Unit, number, one_digit, plain, power, scientific, seconds};
pub(crate) use bars::Bars;
pub(crate) use heat::Heat;
pub(crate) use plot::Plot;

use std::fmt::Write;

use crate::math::count::length_in_f64;
use crate::math::integrator::Method;

/// Classes that plots use, for the page and for files of their own.
pub(crate) const STYLE: &str = include_str!("style.css");

/// Paper of one panel.
pub(crate) const WIDTH: f64 = 420.0;
pub(crate) const HEIGHT: f64 = 336.0;

/// From so many panels on each is half as wide and half as high.
pub(crate) const SMALL: usize = 24;

/// Shapes, so that colour is never alone in telling methods apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Marker {
    None,
    Circle,
    Square,
    Triangle,
    Diamond,
    Wedge,
}

impl Marker {
    /// The shapes of methods, by their place in [`Method::ALL`].
    const OF_METHODS: [Self; 5] = [
        Self::Circle,
        Self::Square,
        Self::Triangle,
        Self::Diamond,
        Self::Wedge,
    ];

    pub(crate) fn of(method: Method) -> Self {
        let shapes = Self::OF_METHODS.into_iter().cycle();
        let mut of = Method::ALL.into_iter().zip(shapes);
        of.find(|(one, _)| *one == method)
            .map_or(Self::None, |(_, shape)| shape)
    }

    /// The shape about `(x, y)` as a path.
    pub(crate) fn path(self, x: f64, y: f64) -> String {
        let r = 3.6;
        match self {
            Self::None => String::new(),
            Self::Circle => format!(
                "M{:.1} {y:.1}a{r} {r} 0 1 0 {d:.1} 0a{r} {r} 0 1 0 -{d:.1} 0z",
                x - r,
                d = 2.0 * r
            ),
            Self::Square => format!("M{:.1} {:.1}h6.4v6.4h-6.4z", x - 3.2, y - 3.2),
            Self::Triangle => format!("M{x:.1} {:.1}l4.2 7.4h-8.4z", y - 4.6),
            Self::Wedge => format!("M{x:.1} {:.1}l4.2 -7.4h-8.4z", y + 4.6),
            Self::Diamond => format!("M{x:.1} {:.1}l4.6 4.6l-4.6 4.6l-4.6 -4.6z", y - 4.6),
        }
    }
}

/// A point of a series, with what a pointer resting on it is told.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// From and to, along x.
    pub(crate) spread: Option<(f64, f64)>,
    pub(crate) tooltip: String,
}

impl Point {
    pub(crate) fn new(x: f64, y: f64, tooltip: impl Into<String>) -> Self {
        Self {
            x,
            y,
            spread: None,
            tooltip: tooltip.into(),
        }
    }
}

/// A line, or marks, or both.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    /// CSS class: a method's name, or one of the style's others.
    pub(crate) class: &'static str,
    pub(crate) marker: Marker,
    pub(crate) line: bool,
    pub(crate) dashed: bool,
    pub(crate) points: Vec<Point>,
}

impl Curve {
    /// A method's line with its colour and marker.
    pub(crate) fn of(method: Method, points: Vec<Point>) -> Self {
        Self {
            class: method.name(),
            marker: Marker::of(method),
            line: true,
            dashed: false,
            points,
        }
    }

    /// A line without markers.
    pub(crate) fn line(class: &'static str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            class,
            marker: Marker::None,
            line: true,
            dashed: false,
            points: points
                .into_iter()
                .map(|(x, y)| Point::new(x, y, ""))
                .collect(),
        }
    }
}

/// Something that explains.
#[derive(Debug, Clone)]
pub(crate) enum Mark {
    /// A line up from `x`.
    Vertical {
        x: f64,
        class: &'static str,
        tooltip: String,
    },
    /// A line across at `y`, labelled.
    Horizontal {
        y: f64,
        class: &'static str,
        label: String,
        /// Whether the label stands at the right end; at the left otherwise.
        right: bool,
    },
    /// Slopes of the given orders, from a corner at `(x, y)`, `decades` wide. Negative orders fall.
    Slopes {
        x: f64,
        y: f64,
        decades: f64,
        orders: Vec<f64>,
    },
}

/// One entry of a legend.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    pub(crate) class: &'static str,
    pub(crate) marker: Marker,
    pub(crate) dashed: bool,
    pub(crate) label: String,
}

impl Key {
    pub(crate) fn of(method: Method) -> Self {
        Self {
            class: method.name(),
            marker: Marker::of(method),
            dashed: false,
            label: method.name().to_owned(),
        }
    }

    /// All methods.
    pub(crate) fn methods() -> Vec<Self> {
        Method::ALL.map(Self::of).to_vec()
    }

    pub(crate) fn line(class: &'static str, label: impl Into<String>) -> Self {
        Self {
            class,
            marker: Marker::None,
            dashed: false,
            label: label.into(),
        }
    }

    /// The sample of line and marker, as an `<svg>` element.
    pub(crate) fn swatch(&self) -> String {
        let dashed = if self.dashed { " dashed" } else { "" };
        format!(
            "<svg class=\"swatch\" viewBox=\"0 0 28 12\" width=\"28\" height=\"12\" aria-hidden=\"true\">\
             <g class=\"series {}{dashed}\"><path class=\"line\" d=\"M1 6H27\"/><path class=\"marker\" \
             d=\"{}\"/></g></svg>",
            self.class,
            self.marker.path(14.0, 6.0)
        )
    }
}

/// Between a sheet's edge and its text in pixels.
const MARGIN: f64 = 14.0;
/// A letter of a heading is no wider on average in the widest of the usual fonts, in pixels.
const LETTER: f64 = 10.4;

/// Panels and legend as one file: a grid `columns` wide, with its style inside.
/// Heading and legend take as many lines as they need.
pub(crate) fn sheet(title: &str, legend: &[Key], panels: &[String]) -> String {
    let columns = match panels.len() {
        few @ 0..=2 => few.max(1),
        SMALL.. => 6,
        many if many % 4 == 0 => 4,
        _ => 3,
    };
    let scale = if panels.len() < SMALL { 1.0 } else { 0.5 };
    let (panel_width, panel_height) = (scale * WIDTH, scale * HEIGHT);
    let rows = panels.len().div_ceil(columns);
    let width = panel_width * length_in_f64(columns);
    let mut head = String::new();
    let mut bottom = 4.0;
    for line in lines(title, width - 2.0 * MARGIN) {
        bottom += 22.0;
        let _ = write!(
            head,
            "<text class=\"heading\" x=\"{MARGIN}\" y=\"{bottom}\">{}</text>",
            escape(&line)
        );
    }
    let (mut x, mut y) = (MARGIN, bottom + 14.0);
    for key in legend {
        let entry = 52.0 + 6.6 * length_in_f64(key.label.chars().count());
        if x > MARGIN && x + entry > width {
            (x, y) = (MARGIN, y + 18.0);
        }
        let swatch = key.swatch();
        let _ = write!(
            head,
            "<g transform=\"translate({x} {y})\">{swatch}<text class=\"label\" x=\"34\" y=\"10\">{}</text></g>",
            escape(&key.label)
        );
        x += entry;
    }
    let header = y + 22.0;
    let height = panel_height * length_in_f64(rows) + header;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\"><style>{STYLE}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>{head}"
    );
    for (index, panel) in panels.iter().enumerate() {
        let (x, y) = (
            panel_width * length_in_f64(index % columns),
            header + panel_height * length_in_f64(index / columns),
        );
        let placed = panel.replacen(
            "<svg ",
            &format!("<svg x=\"{x}\" y=\"{y}\" width=\"{panel_width}\" height=\"{panel_height}\" "),
            1,
        );
        out.push_str(&placed);
    }
    out.push_str("</svg>\n");
    out
}

/// A heading's words in lines of at most `room` pixels; a word that is longer stands alone.
fn lines(heading: &str, room: f64) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in heading.split_whitespace() {
        let length = line.chars().count() + 1 + word.chars().count();
        if !line.is_empty() && LETTER * length_in_f64(length) > room {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(line);
    lines
}

/// Text for use between tags and in attributes.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::{LETTER, length_in_f64, lines};

    #[test]
    fn a_heading_takes_as_many_lines_as_it_needs_and_loses_no_word() {
        let heading =
            "With the effort held, midpoint, Verlet and RK4 go unstable at the same timestep";
        for room in [100.0, 400.0, 812.0, 5000.0] {
            let lines = lines(heading, room);
            assert_eq!(lines.join(" "), heading);
            for line in &lines {
                let alone = !line.contains(' ');
                assert!(
                    alone || LETTER * length_in_f64(line.chars().count()) <= room,
                    "{line}"
                );
            }
        }
        assert_eq!(lines(heading, 5000.0).len(), 1);
    }
}
