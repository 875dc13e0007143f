//! Small SVG plots: axes, lines and markers. Without library, script or fixed colours.
//!
//! Colours are CSS classes (`style.css`): one per method in all figures, each with a marker shape, for light and dark
//! mode. The palette suits colour-blind readers. Curves differ in print too: methods by their markers, joints by their
//! dashes. A plot is drawn for a column of some 400 px; figures are grids of such panels.
//!
//! **Invariant:** a value outside the axes is drawn at the edge as lost, never dropped silently.

mod axis;
pub mod numbers;
mod plot;

pub use axis::{Axis, Unit};
pub(crate) use numbers::{number, one_digit, plain, power, scientific, seconds};
pub(crate) use plot::Thumbnail;
pub use plot::{Plot, csv};

use crate::math::count::length_in_f64;
use crate::math::integrator::Method;

/// The style of the page and of files of their own: the classes that plots use, after the colours of methods and joints,
/// which are those of the program's page.
pub(crate) fn style() -> String {
    let lines = include_str!("../../../page/style.css").lines();
    let is_shared = |it: &&str| it.starts_with("  --joint") || it.starts_with("  --method");
    let colours: String = lines.filter(is_shared).collect();
    format!(":root{{{colours}}}{}", include_str!("style.css"))
}

/// Size of one panel, in pixels.
pub(crate) const WIDTH: f64 = 420.0;
pub(crate) const HEIGHT: f64 = 336.0;

/// Marker shapes: lines differ in shape as well as in colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Down,
    Plus,
    None,
}

impl Marker {
    /// The shape about `(x, y)` as a path.
    pub(crate) fn path(self, x: f64, y: f64) -> String {
        let (left, up, shape) = match self {
            Self::Circle => (3.6, 0.0, "a3.6 3.6 0 1 0 7.2 0a3.6 3.6 0 1 0 -7.2 0z"),
            Self::Square => (3.2, 3.2, "h6.4v6.4h-6.4z"),
            Self::Triangle => (0.0, 4.6, "l4.2 7.4h-8.4z"),
            Self::Diamond => (0.0, 4.6, "l4.6 4.6l-4.6 4.6l-4.6 -4.6z"),
            Self::Down => (4.2, 2.8, "h8.4l-4.2 7.4z"),
            Self::Plus => (1.5, 4.5, "h3v3h3v3h-3v3h-3v-3h-3v-3h3z"),
            Self::None => return String::new(),
        };
        format!("M{:.1} {:.1}{shape}", x - left, y - up)
    }
}

/// The look of a curve, and its name in the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// CSS class: a method's name, or one of the style's others.
    pub(crate) class: &'static str,
    pub(crate) marker: Marker,
    pub(crate) dashed: bool,
    /// Empty: not in the legend.
    pub(crate) label: String,
}

impl Key {
    /// A method's colour and marker.
    pub(crate) fn of(method: Method) -> Self {
        use Marker::{Circle, Diamond, Square, Triangle};
        let markers = [Circle, Square, Triangle, Diamond];
        let marker = markers.get(method as usize).copied().unwrap_or(Circle);
        let label = match method {
            Method::Verlet => "verlet, a predictor-corrector with a velocity guess",
            _ => method.name(),
        };
        Self::line(method.name(), label).marked(marker)
    }

    /// A method's prediction: dashed, with hollow marks, and not in the legend.
    pub(crate) fn predicted(method: Method) -> Self {
        let mut key = Self::of(method).dashed();
        key.label.clear();
        key
    }

    /// A line without markers.
    pub fn line(class: &'static str, label: impl Into<String>) -> Self {
        Self {
            class,
            marker: Marker::None,
            dashed: false,
            label: label.into(),
        }
    }

    pub(crate) fn marked(self, marker: Marker) -> Self {
        Self { marker, ..self }
    }

    /// The same look, dashed.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self {
            dashed: true,
            ..self
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

/// A point of a curve.
#[derive(Debug, Clone)]
pub struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// A note that is not on the axes; often empty.
    pub(crate) note: String,
    /// Ends of a horizontal line through it.
    pub(crate) spread: Option<(f64, f64)>,
}

impl Point {
    pub(crate) fn new(x: f64, y: f64, note: impl Into<String>) -> Self {
        Self {
            x,
            y,
            note: note.into(),
            spread: None,
        }
    }
}

impl From<(f64, f64)> for Point {
    fn from((x, y): (f64, f64)) -> Self {
        Self::new(x, y, "")
    }
}

/// A line with marks, or marks alone.
#[derive(Debug, Clone)]
pub struct Curve {
    pub(crate) key: Key,
    pub(crate) has_line: bool,
    pub(crate) has_tooltips: bool,
    pub(crate) points: Vec<Point>,
}

impl Curve {
    /// A line with the marks of its key.
    pub fn line(key: Key, points: impl IntoIterator<Item = impl Into<Point>>) -> Self {
        let points = points.into_iter().map(Into::into).collect();
        Self {
            key,
            has_line: true,
            has_tooltips: true,
            points,
        }
    }

    /// Marks alone.
    pub fn dots(key: Key, points: impl IntoIterator<Item = impl Into<Point>>) -> Self {
        Self {
            has_line: false,
            ..Self::line(key, points)
        }
    }

    /// Markers without tooltips, for curves with thousands of points.
    pub(crate) fn cells(key: Key, points: impl IntoIterator<Item = impl Into<Point>>) -> Self {
        Self {
            has_tooltips: false,
            ..Self::dots(key, points)
        }
    }
}

/// Text for use between tags and in attributes.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A heading's words in lines of at most `room` pixels, with `letter` pixels for a letter. A longer word has its own
/// line.
pub fn lines(heading: &str, room: f64, letter: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in heading.split_whitespace() {
        let line = lines.last().map_or("", String::as_str);
        let length = line.chars().count() + 1 + word.chars().count();
        if line.is_empty() || letter * length_in_f64(length) <= room {
            let line = format!("{line} {word}").trim_start().to_owned();
            lines.pop();
            lines.push(line);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}
