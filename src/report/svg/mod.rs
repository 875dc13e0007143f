//! Small SVG plots: log axes, lines, markers, marks that explain, heat maps. No library, no script, no colour of its own.
//!
//! Colours are CSS classes ([`STYLE`]): one per method throughout, from a palette that survives colour blindness, with a marker
//! shape each, light and dark. A plot is drawn for a column of some 400 px; figures are grids of such panels.
//!
//! **Invariant:** whatever has no place on the axes is drawn at the edge as lost, never dropped in silence.

mod axis;
mod heat;

pub(crate) use axis::{Axis, Unit, number, power, scientific, seconds};
pub(crate) use heat::Heat;

use std::fmt::Write;

use crate::math::integrator::Method;

/// Classes that plots use, for the page and for files of their own.
pub(crate) const STYLE: &str = include_str!("style.css");

/// Paper of one panel.
pub(crate) const WIDTH: f64 = 420.0;
pub(crate) const HEIGHT: f64 = 336.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 42.0;
const BOTTOM: f64 = 46.0;

/// Shapes, so that colour is never alone in telling methods apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Marker {
    None,
    Circle,
    Square,
    Triangle,
    Diamond,
}

impl Marker {
    pub(crate) fn of(method: Method) -> Self {
        match method {
            Method::Euler => Self::Circle,
            Method::Midpoint => Self::Square,
            Method::Verlet => Self::Triangle,
            Method::Rk4 => Self::Diamond,
        }
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
    pub(crate) told: String,
}

impl Point {
    pub(crate) fn new(x: f64, y: f64, told: impl Into<String>) -> Self {
        Self {
            x,
            y,
            spread: None,
            told: told.into(),
        }
    }
}

/// A line, or marks, or both.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    /// CSS class: a method's name, or one of the style's others.
    pub(crate) class: &'static str,
    pub(crate) marker: Marker,
    pub(crate) line: bool,
    pub(crate) dashed: bool,
    pub(crate) points: Vec<Point>,
}

impl Series {
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
        told: String,
    },
    /// A line across at `y`, labelled.
    Horizontal {
        y: f64,
        class: &'static str,
        label: String,
    },
    /// Slopes of the given orders, from a corner at `(x, y)`, `decades` wide. Negative orders fall.
    Slopes {
        x: f64,
        y: f64,
        decades: f64,
        orders: Vec<f64>,
    },
}

/// One panel.
#[derive(Debug, Clone)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// A second scale above: `self / x`, as a label and the number divided.
    pub(crate) above: Option<(&'static str, f64)>,
    pub(crate) heat: Option<Heat>,
    pub(crate) marks: Vec<Mark>,
    pub(crate) series: Vec<Series>,
}

impl Plot {
    pub(crate) fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            above: None,
            heat: None,
            marks: Vec::new(),
            series: Vec::new(),
        }
    }

    fn across(&self, value: f64) -> f64 {
        LEFT + self.x.place(value).clamp(0.0, 1.0) * (WIDTH - LEFT - RIGHT)
    }

    fn down(&self, value: f64) -> f64 {
        HEIGHT - BOTTOM - self.y.place(value).clamp(0.0, 1.0) * (HEIGHT - TOP - BOTTOM)
    }

    /// The panel as an `<svg>` element without style.
    pub(crate) fn render(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let title = escape(&self.title);
        write!(
            out,
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\
             <text class=\"title\" x=\"{LEFT}\" y=\"17\">{title}</text>"
        )?;
        if let Some(heat) = &self.heat {
            heat.write(out, |x| self.across(x), |y| self.down(y))?;
        }
        self.frame(out)?;
        for mark in &self.marks {
            self.mark(out, mark)?;
        }
        for series in &self.series {
            self.series(out, series)?;
        }
        out.push_str("</svg>");
        Ok(())
    }

    fn frame(&self, out: &mut String) -> std::fmt::Result {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        let grid = if self.heat.is_some() { "tick" } else { "grid" };
        for (value, label) in self.x.ticks(6.0) {
            let x = self.across(value);
            // A label at the very end would leave the paper.
            let anchor = if x > right - 12.0 { "end" } else { "middle" };
            let shown = if x > right - 12.0 {
                right + RIGHT - 3.0
            } else {
                x
            };
            write!(
                out,
                "<path class=\"{grid}\" d=\"M{x:.1} {bottom}V{TOP}\"/>\
                 <text class=\"label\" x=\"{shown:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{label}</text>",
                bottom + 15.0
            )?;
        }
        for (value, label) in self.y.ticks(7.0) {
            let y = self.down(value);
            write!(
                out,
                "<path class=\"{grid}\" d=\"M{LEFT} {y:.1}H{right}\"/>\
                 <text class=\"label\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 6.0,
                y + 4.0
            )?;
        }
        self.above(out)?;
        let (middle_x, middle_y) = (f64::midpoint(LEFT, right), f64::midpoint(TOP, bottom));
        write!(
            out,
            "<path class=\"frame\" d=\"M{LEFT} {TOP}V{bottom}H{right}\"/>\
             <text class=\"axis\" x=\"{middle_x}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text class=\"axis\" transform=\"translate(13 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            HEIGHT - 10.0,
            self.x.label,
            self.y.label
        )
    }

    fn above(&self, out: &mut String) -> std::fmt::Result {
        let Some((label, factor)) = self.above else {
            return Ok(());
        };
        let other = Axis::log_between(
            label,
            Unit::Number,
            factor / self.x.max,
            factor / self.x.min,
        );
        for (value, label) in other.ticks(5.0) {
            let x = self.across(factor / value);
            write!(
                out,
                "<path class=\"frame\" d=\"M{x:.1} {TOP}v-4\"/>\
                 <text class=\"note\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}×</text>",
                TOP - 7.0
            )?;
        }
        Ok(())
    }

    fn mark(&self, out: &mut String, mark: &Mark) -> std::fmt::Result {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        match mark {
            Mark::Vertical { x, class, told } if self.x.holds(*x) => {
                let x = self.across(*x);
                write!(
                    out,
                    "<path class=\"edge {class}\" d=\"M{x:.1} {bottom}V{TOP}\"><title>{}</title></path>",
                    escape(told)
                )
            }
            Mark::Horizontal { y, class, label } if self.y.holds(*y) => {
                let y = self.down(*y);
                write!(
                    out,
                    "<path class=\"edge {class}\" d=\"M{LEFT} {y:.1}H{right}\"/>\
                     <text class=\"note\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                    right - 4.0,
                    y - 4.0,
                    escape(label)
                )
            }
            Mark::Slopes {
                x,
                y,
                decades,
                orders,
            } => self.slopes(out, (*x, *y), *decades, orders),
            Mark::Vertical { .. } | Mark::Horizontal { .. } => Ok(()),
        }
    }

    fn slopes(
        &self,
        out: &mut String,
        corner: (f64, f64),
        decades: f64,
        orders: &[f64],
    ) -> std::fmt::Result {
        let (x0, y0) = (self.across(corner.0), self.down(corner.1));
        for order in orders {
            let end = (
                corner.0 * 10_f64.powf(decades),
                corner.1 * 10_f64.powf(decades * order),
            );
            let (x1, y1) = (self.across(end.0), self.down(end.1));
            write!(
                out,
                "<path class=\"slope\" d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\"/>\
                 <text class=\"note\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                x1 + 3.0,
                y1 + 4.0,
                number(order.abs())
            )?;
        }
        Ok(())
    }

    fn series(&self, out: &mut String, series: &Series) -> std::fmt::Result {
        let dashed = if series.dashed { " dashed" } else { "" };
        write!(out, "<g class=\"series {}{dashed}\">", series.class)?;
        if series.line {
            let mut path = String::new();
            let mut pen_down = false;
            for point in &series.points {
                // Lost points break the line: nothing is known between them and their neighbours.
                if self.lost(point) || !self.x.holds(point.x) {
                    pen_down = false;
                    continue;
                }
                let letter = if pen_down { 'L' } else { 'M' };
                write!(
                    path,
                    "{letter}{:.1} {:.1}",
                    self.across(point.x),
                    self.down(point.y)
                )?;
                pen_down = true;
            }
            write!(out, "<path class=\"line\" d=\"{path}\"/>")?;
        }
        for point in series.points.iter().filter(|p| self.x.holds(p.x)) {
            self.point(out, series.marker, point)?;
        }
        out.push_str("</g>");
        Ok(())
    }

    fn lost(&self, point: &Point) -> bool {
        !point.y.is_finite()
    }

    fn point(&self, out: &mut String, marker: Marker, point: &Point) -> std::fmt::Result {
        let told = escape(&point.told);
        let x = self.across(point.x);
        if self.lost(point) {
            return write!(
                out,
                "<path class=\"lost\" d=\"M{:.1} {:.1}l7 7m0 -7l-7 7\"><title>{told}</title></path>",
                x - 3.5,
                TOP + 2.5
            );
        }
        let y = self.down(point.y);
        if let Some((from, to)) = point.spread {
            let (from, to) = (self.across(from), self.across(to));
            write!(
                out,
                "<path class=\"spread\" d=\"M{from:.1} {y:.1}H{to:.1}\"/>"
            )?;
        }
        if marker == Marker::None {
            return Ok(());
        }
        write!(
            out,
            "<path class=\"marker\" d=\"{}\"><title>{told}</title></path>",
            marker.path(x, y)
        )
    }
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

    /// The four methods.
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
             <g class=\"series {}{dashed}\"><path class=\"line\" d=\"M1 6H27\"/><path class=\"marker\" d=\"{}\"/></g></svg>",
            self.class,
            self.marker.path(14.0, 6.0)
        )
    }
}

/// Panels and legend as one file: a grid `columns` wide, with its style inside.
pub(crate) fn sheet(title: &str, legend: &[Key], panels: &[String]) -> String {
    let columns = match panels.len() {
        few @ 0..=2 => few.max(1),
        many if many % 4 == 0 => 4,
        _ => 3,
    };
    let rows = panels.len().div_ceil(columns);
    let header = 62.0;
    let (width, height) = (WIDTH * in_f64(columns), HEIGHT * in_f64(rows) + header);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\">\
         <style>{STYLE}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>\
         <text class=\"heading\" x=\"14\" y=\"26\">{}</text>",
        escape(title)
    );
    let mut x = 14.0;
    for key in legend {
        let swatch = key.swatch();
        let _ = write!(
            out,
            "<g transform=\"translate({x} 40)\">{swatch}<text class=\"label\" x=\"34\" y=\"10\">{}</text></g>",
            escape(&key.label)
        );
        x += 52.0 + 6.6 * in_f64(key.label.chars().count());
    }
    for (index, panel) in panels.iter().enumerate() {
        let (x, y) = (
            WIDTH * in_f64(index % columns),
            header + HEIGHT * in_f64(index / columns),
        );
        let placed = panel.replacen(
            "<svg ",
            &format!("<svg x=\"{x}\" y=\"{y}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" "),
            1,
        );
        out.push_str(&placed);
    }
    out.push_str("</svg>\n");
    out
}

/// Text for use between tags and in attributes.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of panels and letters are far below 2^53"
)]
fn in_f64(count: usize) -> f64 {
    count as f64
}
