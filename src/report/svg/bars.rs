//! A panel of horizontal bars: one number per row, written beside it.
//!
//! **Invariant:** bars start at zero; a row without a number says so.

use std::fmt::Write;

use super::{HEIGHT, WIDTH, escape, number};
use crate::math::count::length_in_f64;

const LEFT: f64 = 176.0;
const RIGHT: f64 = 58.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 10.0;

/// One panel.
#[derive(Debug, Clone)]
pub(crate) struct Bars {
    pub(crate) title: String,
    /// CSS class that colours the bars.
    pub(crate) class: &'static str,
    /// Label, and the number if there is one.
    pub(crate) rows: Vec<(String, Option<f64>)>,
}

impl Bars {
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
             <text class=\"title\" x=\"14\" y=\"17\">{title}</text><g class=\"series {}\">",
            self.class
        )?;
        let largest = self
            .rows
            .iter()
            .filter_map(|row| row.1)
            .fold(f64::MIN_POSITIVE, f64::max);
        let pitch = (HEIGHT - TOP - BOTTOM) / length_in_f64(self.rows.len().max(1));
        let mut top = TOP;
        for (label, value) in &self.rows {
            let (middle, thick) = (top + 0.5 * pitch, (0.68 * pitch).min(26.0));
            let width = value.unwrap_or(0.0).max(0.0) / largest * (WIDTH - LEFT - RIGHT);
            let text = value.map_or_else(|| "not measured".to_owned(), number);
            write!(
                out,
                "<text class=\"label\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\
                 <rect class=\"bar\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{thick:.1}\"/>\
                 <text class=\"label\" x=\"{:.1}\" y=\"{:.1}\">{text}</text>",
                LEFT - 6.0,
                middle + 4.0,
                escape(label),
                middle - 0.5 * thick,
                LEFT + width + 5.0,
                middle + 4.0,
            )?;
            top += pitch;
        }
        out.push_str("</g></svg>");
        Ok(())
    }
}
