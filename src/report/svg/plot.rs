//! One panel: axes, cells, marks and curves on paper; or horizontal bars.
//!
//! **Invariant:** lines end where points are lost; the lost ones are drawn at the upper edge.

use super::{Axis, Curve, HEIGHT, Marker, Panel, Point, Unit, WIDTH, escape, number};
use crate::math::count::length_in_f64;

const LEFT: f64 = 58.0;
const RIGHT: f64 = WIDTH - 14.0;
const TOP: f64 = 42.0;
const BOTTOM: f64 = HEIGHT - 46.0;

/// Coloured cells between edges, row by row from the bottom; neighbours of one class are one rectangle.
#[derive(Debug, Clone)]
pub(crate) struct Heat {
    /// Edges along x and along y, one more than cells.
    pub(crate) edges: [Vec<f64>; 2],
    /// One class per cell.
    pub(crate) rows: Vec<Vec<&'static str>>,
}

/// Something that explains.
#[derive(Debug, Clone)]
pub(crate) enum Mark {
    /// A line up from an x, its class and its tooltip.
    Vertical(f64, &'static str, String),
    /// A line across at a y, its class and its label.
    Horizontal(f64, &'static str, &'static str),
    /// Slopes of these orders over a decade, from a corner.
    Slopes((f64, f64), [f64; 3]),
}

/// A panel with axes.
#[derive(Debug, Clone)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// A second scale above: its unit on x, and its name.
    pub(crate) above: Option<(f64, &'static str)>,
    pub(crate) heat: Option<Heat>,
    pub(crate) marks: Vec<Mark>,
    pub(crate) curves: Vec<Curve>,
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
            curves: Vec::new(),
        }
    }

    fn across(&self, value: f64) -> f64 {
        LEFT + self.x.place(value).clamp(0.0, 1.0) * (RIGHT - LEFT)
    }

    fn down(&self, value: f64) -> f64 {
        BOTTOM - self.y.place(value).clamp(0.0, 1.0) * (BOTTOM - TOP)
    }

    /// The panel as it is shown, and its numbers.
    pub(crate) fn draw(&self) -> Panel {
        let title = escape(&self.title);
        let heat = self.heat.as_ref().map(|heat| self.cells(heat));
        let marks = self.marks.iter().map(|mark| self.mark(mark));
        let curves = self.curves.iter().map(|curve| self.curve(curve));
        let drawn: String = marks.chain(curves).collect();
        let rows = self.curves.iter().flat_map(|curve| {
            let name = format!("{}: {}", self.title, self.name(curve));
            let points = curve.points.iter();
            points.map(move |it| (name.clone(), it.x, it.y, it.tooltip.clone()))
        });
        Panel {
            svg: format!(
                "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\
                 <text class=\"title\" x=\"{LEFT}\" y=\"17\">{title}</text>{}{}{drawn}</svg>",
                heat.unwrap_or_default(),
                self.frame()
            ),
            keys: self.curves.iter().map(|curve| curve.key.clone()).collect(),
            axes: [self.x.name(), self.y.name()],
            rows: rows.chain(self.heat_rows()).collect(),
        }
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

    fn cells(&self, heat: &Heat) -> String {
        let mut out = String::new();
        let [columns, rows] = &heat.edges;
        for (row, edges) in heat.rows.iter().zip(rows.windows(2)) {
            let mut from = 0;
            for cells in row.chunk_by(|one, other| one == other) {
                let to = from + cells.len();
                let ends = (columns.get(from), columns.get(to), cells.first());
                if let ([low, high], (Some(left), Some(right), Some(class))) = (edges, ends) {
                    let (x, y) = (self.across(*left), self.down(*high));
                    out += &format!(
                        "<rect shape-rendering=\"crispEdges\" class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" \
                         width=\"{:.1}\" height=\"{:.1}\"/>",
                        self.across(*right) - x,
                        self.down(*low) - y
                    );
                }
                from = to;
            }
        }
        out
    }

    fn heat_rows(&self) -> impl Iterator<Item = super::PlotNumber> {
        let cells = self.heat.iter().flat_map(|heat| {
            let [columns, rows] = &heat.edges;
            let row = move |(cells, y): (&Vec<&'static str>, &f64)| {
                let (cells, y) = (cells.clone(), *y);
                let cells = cells.into_iter().zip(columns.clone());
                cells
                    .map(move |(class, x)| (x, y, class))
                    .collect::<Vec<_>>()
            };
            heat.rows.iter().zip(rows).flat_map(row).collect::<Vec<_>>()
        });
        let name = format!("{}: cell from", self.title);
        cells.map(move |(x, y, class)| (name.clone(), x, y, class.to_owned()))
    }

    fn frame(&self) -> String {
        let mut out = String::new();
        let grid = if self.heat.is_some() { "tick" } else { "grid" };
        for (value, label) in self.x.ticks(6.0) {
            let x = self.across(value);
            // A long label at the very end would leave the paper.
            let half = 3.4 * length_in_f64(label.chars().count());
            let (anchor, shown) = if x + half > WIDTH - 3.0 {
                ("end", WIDTH - 3.0)
            } else {
                ("middle", x)
            };
            let y = BOTTOM + 15.0;
            out += &format!("<path class=\"{grid}\" d=\"M{x:.1} {BOTTOM}V{TOP}\"/>");
            out += &text("label", (shown, y), anchor, &label);
        }
        for (value, label) in self.y.ticks(7.0) {
            let y = self.down(value);
            out += &format!("<path class=\"{grid}\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/>");
            out += &text("label", (LEFT - 6.0, y + 4.0), "end", &label);
        }
        if let Some((unit, name)) = self.above {
            out += &text("note", (WIDTH - 3.0, 17.0), "end", name);
            let other = Axis::log("", Unit::Number, (self.x.min / unit, self.x.max / unit));
            for (value, label) in other.ticks(5.0) {
                let x = self.across(value * unit);
                out += &format!("<path class=\"frame\" d=\"M{x:.1} {TOP}v-4\"/>");
                out += &text("note", (x, TOP - 7.0), "middle", &label);
            }
        }
        let middle = (f64::midpoint(LEFT, RIGHT), HEIGHT - 10.0);
        out += &format!("<path class=\"frame\" d=\"M{LEFT} {TOP}V{BOTTOM}H{RIGHT}\"/>");
        out += &text("axis", middle, "middle", self.x.label);
        out + &format!(
            "<text class=\"axis\" transform=\"translate(13 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            f64::midpoint(TOP, BOTTOM),
            self.y.label
        )
    }

    fn mark(&self, mark: &Mark) -> String {
        match mark {
            Mark::Vertical(x, class, tooltip) if self.x.holds(*x) => format!(
                "<path class=\"edge {class}\" d=\"M{:.1} {BOTTOM}V{TOP}\"><title>{}</title></path>",
                self.across(*x),
                escape(tooltip)
            ),
            Mark::Horizontal(y, class, label) if self.y.holds(*y) => {
                let y = self.down(*y);
                format!("<path class=\"edge {class}\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/>")
                    + &text("note", (LEFT + 6.0, y - 4.0), "start", label)
            }
            Mark::Slopes((x, y), orders) => {
                let slope = |order: f64| {
                    let (x1, y1) = (self.across(x * 10.0), self.down(y * 10_f64.powf(order)));
                    let (x0, y0) = (self.across(*x), self.down(*y));
                    format!("<path class=\"slope\" d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\"/>")
                        + &text("note", (x1 + 3.0, y1 + 4.0), "start", &number(order))
                };
                orders.map(slope).concat()
            }
            Mark::Vertical(..) | Mark::Horizontal(..) => String::new(),
        }
    }

    fn curve(&self, curve: &Curve) -> String {
        let dashed = if curve.key.dashed { " dashed" } else { "" };
        let mut out = format!("<g class=\"series {}{dashed}\">", curve.key.class);
        if curve.has_line {
            let mut path = String::new();
            let mut letter = 'M';
            for point in &curve.points {
                // Lost points break the line: nothing is known between them and their neighbours.
                if point.y.is_finite() && self.x.holds(point.x) {
                    let (x, y) = (self.across(point.x), self.down(point.y));
                    path += &format!("{letter}{x:.1} {y:.1}");
                    letter = 'L';
                } else {
                    letter = 'M';
                }
            }
            out += &format!("<path class=\"line\" d=\"{path}\"/>");
        }
        let points = curve.points.iter().filter(|point| self.x.holds(point.x));
        out.extend(points.map(|point| self.point(curve.key.marker, point)));
        out + "</g>"
    }

    fn point(&self, marker: Marker, point: &Point) -> String {
        let tooltip = escape(&point.tooltip);
        let (x, y) = (self.across(point.x), self.down(point.y));
        if !point.y.is_finite() {
            let (x, y) = (x - 3.5, TOP + 2.5);
            return format!(
                "<path class=\"lost\" d=\"M{x:.1} {y:.1}l7 7m0 -7l-7 7\"><title>{tooltip}</title></path>"
            );
        }
        let spread = point.spread.map(|(from, to)| {
            let (from, to) = (self.across(from), self.across(to));
            format!("<path class=\"spread\" d=\"M{from:.1} {y:.1}H{to:.1}\"/>")
        });
        let marker = match marker.path(x, y).as_str() {
            "" => String::new(),
            path => format!("<path class=\"marker\" d=\"{path}\"><title>{tooltip}</title></path>"),
        };
        spread.unwrap_or_default() + &marker
    }
}

fn text(class: &str, (x, y): (f64, f64), anchor: &str, words: &str) -> String {
    let words = escape(words);
    format!(
        "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>"
    )
}

/// A panel of horizontal bars from zero, each with its number; a row without one says so.
pub(crate) fn bars(title: &str, class: &str, rows: &[(&str, Option<f64>)]) -> Panel {
    const LEFT: f64 = 176.0;
    const TOP: f64 = 34.0;
    let numbers = rows.iter().filter_map(|row| row.1);
    let largest = numbers.fold(f64::MIN_POSITIVE, f64::max);
    let pitch = (HEIGHT - TOP - 10.0) / length_in_f64(rows.len().max(1));
    let thick = (0.68 * pitch).min(26.0);
    let mut middle = TOP + 0.5 * pitch;
    let mut out = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\">\
         <text class=\"title\" x=\"14\" y=\"17\">{title}</text><g class=\"series {class}\">"
    );
    for (label, value) in rows {
        let width = value.unwrap_or(0.0).max(0.0) / largest * (WIDTH - LEFT - 58.0);
        let said = value.map_or_else(|| "not measured".to_owned(), number);
        out += &text("label", (LEFT - 6.0, middle + 4.0), "end", label);
        out += &format!(
            "<rect class=\"bar\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{thick:.1}\"/>",
            middle - 0.5 * thick
        );
        out += &text("label", (LEFT + width + 5.0, middle + 4.0), "start", &said);
        middle += pitch;
    }
    let row = |(label, value): &(&str, Option<f64>)| {
        (
            format!("{title}: {label}"),
            value.unwrap_or(f64::NAN),
            f64::NAN,
            String::new(),
        )
    };
    Panel {
        svg: out + "</g></svg>",
        keys: Vec::new(),
        axes: [title.to_owned(), String::new()],
        rows: rows.iter().map(row).collect(),
    }
}

/// The numbers of a figure as CSV: a column for each axis of its panels, named by it, and filled by the panels that
/// have it.
pub(crate) fn csv(panels: &[Panel]) -> String {
    let mut axes: Vec<&str> = Vec::new();
    for axis in panels.iter().flat_map(|panel| &panel.axes) {
        if !axis.is_empty() && !axes.contains(&axis.as_str()) {
            axes.push(axis);
        }
    }
    let line = |curve: &str, columns: Vec<String>, note: &str| {
        let columns = columns.join(",");
        format!("{},{columns},{}\n", quoted(curve), quoted(note))
    };
    let mut out = line(
        "curve",
        axes.iter().map(|axis| quoted(axis)).collect(),
        "note",
    );
    for panel in panels {
        let [x_axis, y_axis] = &panel.axes;
        for (curve, x, y, note) in &panel.rows {
            let column = |axis: &&str| match *axis {
                axis if axis == x_axis => spelled(*x),
                axis if axis == y_axis => spelled(*y),
                _ => String::new(),
            };
            out += &line(curve, axes.iter().map(column).collect(), note);
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

/// A number that reads back to the same bits; nothing where there is none.
fn spelled(value: f64) -> String {
    if value.is_finite() {
        format!("{value:e}")
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::svg::Key;
    use std::collections::BTreeSet;

    #[test]
    fn curves_that_look_different_have_different_names() {
        let axis = || Axis::linear("x", (0.0, 1.0));
        let mut plot = Plot::new("panel", axis(), axis());
        let key = || Key::line("euler", "Euler");
        let points = [(0.0, 1.0)];
        let unnamed = Key::line("rk4", "").dashed();
        plot.curves = vec![
            Curve::line(key(), points),
            Curve::line(key().dashed(), points),
            Curve::dots(key(), points),
            Curve::line(Key::line("rk4", "rk4"), points),
            Curve::line(unnamed, points),
        ];
        let names: BTreeSet<String> = plot.draw().rows.into_iter().map(|row| row.0).collect();
        assert_eq!(names.len(), plot.curves.len(), "{names:?}");
    }

    #[test]
    fn a_column_is_named_by_its_axis_with_the_unit() {
        let draw = |y| {
            let x = Axis::log("timestep", Unit::Seconds, (1e-3, 1.0));
            let mut plot = Plot::new("panel", x, y);
            let key = Key::line("rk4", "rk4");
            plot.curves = vec![Curve::line(key, [(0.5, 2.0)])];
            plot.draw()
        };
        let panels = [
            draw(Axis::linear("largest error [rad]", (0.0, 3.0))),
            draw(Axis::linear("growth, per period", (0.0, 3.0))),
            bars("Time per step [ns]", "c1", &[("one", Some(7.0))]),
        ];
        assert_eq!(
            csv(&panels),
            "curve,timestep [s],largest error [rad],\"growth, per period\",Time per step [ns],note\n\
             panel: rk4,5e-1,2e0,,,\n\
             panel: rk4,5e-1,,2e0,,\n\
             Time per step [ns]: one,,,,7e0,\n"
        );
    }
}
