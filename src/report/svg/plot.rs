//! One panel: axes, marks and series on paper.
//!
//! **Invariant:** lines end where points are lost; the lost ones are drawn at the upper edge.

use std::fmt::Write;

use super::{Axis, Curve, HEIGHT, Heat, Mark, Marker, Point, Unit, WIDTH, escape, number};

const LEFT: f64 = 58.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 42.0;
const BOTTOM: f64 = 46.0;

/// One panel.
#[derive(Debug, Clone)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// A second scale above: `x` in this unit.
    pub(crate) above: Option<f64>,
    pub(crate) heat: Option<Heat>,
    pub(crate) marks: Vec<Mark>,
    pub(crate) series: Vec<Curve>,
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
        let Some(unit) = self.above else {
            return Ok(());
        };
        let other = Axis::log_between("", Unit::Number, self.x.min / unit, self.x.max / unit);
        for (value, label) in other.ticks(5.0) {
            let x = self.across(value * unit);
            write!(
                out,
                "<path class=\"frame\" d=\"M{x:.1} {TOP}v-4\"/>\
                 <text class=\"note\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                TOP - 7.0
            )?;
        }
        Ok(())
    }

    fn mark(&self, out: &mut String, mark: &Mark) -> std::fmt::Result {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        match mark {
            Mark::Vertical { x, class, tooltip } if self.x.holds(*x) => {
                let x = self.across(*x);
                write!(
                    out,
                    "<path class=\"edge {class}\" d=\"M{x:.1} {bottom}V{TOP}\"><title>{}</title></path>",
                    escape(tooltip)
                )
            }
            Mark::Horizontal {
                y,
                class,
                label,
                right: at_right,
            } if self.y.holds(*y) => {
                let y = self.down(*y);
                let (x, anchor) = if *at_right {
                    (right - 4.0, "end")
                } else {
                    (LEFT + 6.0, "start")
                };
                write!(
                    out,
                    "<path class=\"edge {class}\" d=\"M{LEFT} {y:.1}H{right}\"/>\
                     <text class=\"note\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
                    x,
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

    fn series(&self, out: &mut String, series: &Curve) -> std::fmt::Result {
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
        let tooltip = escape(&point.tooltip);
        let x = self.across(point.x);
        if self.lost(point) {
            return write!(
                out,
                "<path class=\"lost\" d=\"M{:.1} {:.1}l7 7m0 -7l-7 7\"><title>{tooltip}</title></path>",
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
            "<path class=\"marker\" d=\"{}\"><title>{tooltip}</title></path>",
            marker.path(x, y)
        )
    }
}
