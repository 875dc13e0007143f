//! One panel: axes and curves.
//!
//! **Invariant:** lines break at lost points, which are drawn at the upper edge.

use super::{Axis, Curve, HEIGHT, Key, Marker, Point, WIDTH, escape, lines};
use crate::math::count::length_in_f64;

/// Left, right, upper and lower ends of the axes in a panel, and in a thumbnail of half its size.
const ENDS: [f64; 4] = [58.0, WIDTH - 14.0, 42.0, HEIGHT - 46.0];
const SMALL_ENDS: [f64; 4] = [8.0, 0.5 * WIDTH - 8.0, 40.0, 0.5 * HEIGHT - 24.0];

/// A panel with axes.
#[derive(Debug, Clone)]
pub struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// Its texts, if it has half the size and no scales.
    pub(crate) thumbnail: Option<Thumbnail>,
    pub(crate) curves: Vec<Curve>,
}

/// The texts of a thumbnail.
#[derive(Debug, Clone)]
pub(crate) struct Thumbnail {
    /// The words below it on the left.
    pub(crate) note: String,
    /// Class and words below it on the right.
    pub(crate) verdict: (&'static str, &'static str),
}

impl Plot {
    /// A panel without curves.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            thumbnail: None,
            curves: Vec::new(),
        }
    }

    /// The panel with more curves.
    #[must_use]
    pub fn with(mut self, curves: impl IntoIterator<Item = Curve>) -> Self {
        self.curves.extend(curves);
        self
    }

    pub(crate) fn add(&mut self, curve: Curve) {
        self.curves.push(curve);
    }

    fn ends(&self) -> [f64; 4] {
        self.thumbnail.as_ref().map_or(ENDS, |_| SMALL_ENDS)
    }

    fn across(&self, value: f64) -> f64 {
        let [left, right, ..] = self.ends();
        left + self.x.place(value).clamp(0.0, 1.0) * (right - left)
    }

    fn down(&self, value: f64) -> f64 {
        let [.., top, bottom] = self.ends();
        bottom - self.y.place(value).clamp(0.0, 1.0) * (bottom - top)
    }

    /// The panel as it is shown: an `<svg>` element without style.
    pub(crate) fn svg(&self) -> String {
        let curves: String = self.curves.iter().map(|curve| self.curve(curve)).collect();
        let (scale, frame) = match &self.thumbnail {
            None => (1.0, self.frame()),
            Some(words) => (0.5, self.words(words)),
        };
        format!(
            "<svg class=\"plot\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{frame}{curves}</svg>",
            scale * WIDTH,
            scale * HEIGHT,
            escape(&self.title),
        )
    }

    /// The legend's name of a curve, or of one with the same style. Dashes and bare points are added to it.
    fn name(&self, curve: &Curve) -> String {
        let key = &curve.key;
        let keys = self.curves.iter().map(|curve| &curve.key);
        let alike = keys.filter(|it| it.class == key.class && it.dashed == key.dashed);
        let labels = std::iter::once(key).chain(alike);
        let mut labels = labels.map(|it| it.label.as_str());
        let label = labels.find(|label| !label.is_empty()).unwrap_or(key.class);
        let dashed = if key.dashed { ", dashed" } else { "" };
        let points = if curve.has_line { "" } else { ", points" };
        format!("{label}{dashed}{points}")
    }

    /// The title of a thumbnail and the texts below it.
    fn words(&self, thumbnail: &Thumbnail) -> String {
        /// Upper bound of the average width of a heading's letter, in pixels.
        const LETTER: f64 = 8.2;
        let ([left, right, ..], below) = (SMALL_ENDS, 0.5 * HEIGHT - 8.0);
        let title = lines(&self.title, right - left, LETTER);
        let title = [15.0, 31.0].into_iter().zip(title);
        let title: String = title
            .map(|(y, line)| text("title", (left, y), "start", &line))
            .collect();
        let (class, verdict) = thumbnail.verdict;
        title
            + &text("note", (left, below), "start", &thumbnail.note)
            + &text(&format!("note {class}"), (right, below), "end", verdict)
    }

    /// The title, and axes with their scales.
    fn frame(&self) -> String {
        let [left, right, top, bottom] = ENDS;
        let mut out = text("title", (left, 17.0), "start", &self.title);
        for (value, label) in self.x.ticks(6.0) {
            let x = self.across(value);
            // A long label at the end would exceed the panel.
            let half = 3.4 * length_in_f64(label.chars().count());
            let (anchor, shown) = if x + half > WIDTH - 3.0 {
                ("end", WIDTH - 3.0)
            } else {
                ("middle", x)
            };
            let y = bottom + 15.0;
            out += &format!("<path class=\"grid\" d=\"M{x:.1} {bottom}V{top}\"/>");
            out += &text("label", (shown, y), anchor, &label);
        }
        for (value, label) in self.y.ticks(7.0) {
            let y = self.down(value);
            out += &format!("<path class=\"grid\" d=\"M{left} {y:.1}H{right}\"/>");
            out += &text("label", (left - 6.0, y + 4.0), "end", &label);
        }
        let middle = (f64::midpoint(left, right), HEIGHT - 10.0);
        out += &format!("<path class=\"frame\" d=\"M{left} {top}V{bottom}H{right}\"/>");
        out += &text("axis", middle, "middle", self.x.label);
        out + &format!(
            "<text class=\"axis\" transform=\"translate(13 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            f64::midpoint(top, bottom),
            self.y.label
        )
    }

    fn curve(&self, curve: &Curve) -> String {
        let Key {
            class,
            marker,
            dashed,
            ..
        } = curve.key;
        let dashed = if dashed { " dashed" } else { "" };
        let mut out = format!("<g class=\"series {class}{dashed}\">");
        if curve.has_line {
            let mut path = String::new();
            let mut letter = 'M';
            for point in &curve.points {
                // Lost points break the line: the curve is unknown between them and their neighbours.
                if point.y.is_finite() && self.x.holds(point.x) {
                    let (x, y) = (self.across(point.x), self.down(point.y));
                    path += &format!("{letter}{x:.1} {y:.1}");
                    letter = 'L';
                } else {
                    letter = 'M';
                }
            }
            for point in &curve.points {
                if let Some((low, high)) = point.spread.filter(|_| point.y.is_finite()) {
                    let (x, y) = (self.across(low), self.down(point.y));
                    path += &format!("M{x:.1} {y:.1}H{:.1}", self.across(high));
                }
            }
            out += &format!("<path class=\"line\" d=\"{path}\"/>");
        }
        // Many marks would hide their line. Some are drawn, for other shapes other ones.
        let is_long = curve.has_line && curve.points.len() > 30;
        let every = if is_long { curve.points.len() / 8 } else { 1 };
        let first = every * marker as usize / Marker::None as usize % every;
        let points = curve.points.iter().enumerate();
        let points = points.filter(|(at, it)| at % every == first || !it.y.is_finite());
        let points = points.map(|(_, it)| it).filter(|it| self.x.holds(it.x));
        if curve.has_tooltips {
            let name = self.name(curve);
            out.extend(points.map(|point| self.point(&name, marker, point)));
        } else {
            let marks = points.map(|point| marker.path(self.across(point.x), self.down(point.y)));
            let marks: String = marks.collect();
            out += &format!("<path class=\"marker\" d=\"{marks}\"/>");
        }
        out + "</g>"
    }

    /// A point's marker; its tooltip names the curve, both values, and the rest in words.
    fn point(&self, name: &str, marker: Marker, point: &Point) -> String {
        let (x, y) = (self.across(point.x), self.down(point.y));
        let is_lost = !point.y.is_finite();
        let (class, path) = if is_lost {
            let (x, y) = (x - 3.5, self.ends()[2] + 2.5);
            ("lost", format!("M{x:.1} {y:.1}l7 7m0 -7l-7 7"))
        } else {
            ("marker", marker.path(x, y))
        };
        if path.is_empty() {
            return path;
        }
        let value = if is_lost {
            "lost".to_owned()
        } else {
            self.y.told(point.y)
        };
        let words = [name, &value, &self.x.told(point.x), &point.note];
        let words = words.map(escape).join("; ");
        let tooltip = words.trim_end_matches("; ");
        format!("<path class=\"{class}\" d=\"{path}\"><title>{tooltip}</title></path>")
    }
}

fn text(class: &str, (x, y): (f64, f64), anchor: &str, words: &str) -> String {
    let words = escape(words);
    format!(
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>"
    )
}

/// The numbers of a figure as CSV: a column for each axis of its panels, with the axis' name and the values of its
/// panels.
pub fn csv(panels: &[Plot]) -> String {
    let mut axes: Vec<String> = Vec::new();
    for axis in panels
        .iter()
        .flat_map(|plot| [plot.x.name(), plot.y.name()])
    {
        if !axis.is_empty() && !axes.contains(&axis) {
            axes.push(axis);
        }
    }
    let line = |curve: &str, columns: Vec<String>, note: &str| {
        let columns = columns.join(",");
        format!("{},{columns},{}\n", quoted(curve), quoted(note))
    };
    let heads = axes.iter().map(|axis| quoted(axis)).collect();
    let mut out = line("curve", heads, "note");
    for plot in panels {
        let (x, y) = (plot.x.name(), plot.y.name());
        for curve in &plot.curves {
            let name = format!("{}: {}", plot.title, plot.name(curve));
            for point in &curve.points {
                let column = |axis: &String| match axis {
                    axis if *axis == x => spelled(point.x),
                    axis if *axis == y => spelled(point.y),
                    _ => String::new(),
                };
                out += &line(&name, axes.iter().map(column).collect(), &point.note);
            }
        }
    }
    out
}

/// A field of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        return format!("\"{}\"", text.replace('"', "\"\""));
    }
    text.to_owned()
}

/// A number that reads back to the same bits; empty if it is not finite.
fn spelled(value: f64) -> String {
    if value.is_finite() {
        format!("{value:e}")
    } else {
        String::new()
    }
}
