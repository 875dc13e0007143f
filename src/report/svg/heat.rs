//! A coloured grid: the stability map.
//!
//! **Invariant:** colours are classes `h0` to `h8`, `h4` in the middle; neighbours of one colour are one rectangle.

use std::fmt::Write;

/// Levels from -4 (shrinks fast) to 4 (grows fast).
pub(crate) const LEVELS: i8 = 4;

/// Cells between edges, row by row from the bottom.
#[derive(Debug, Clone)]
pub(crate) struct Heat {
    /// Edges along x, one more than columns.
    pub(crate) x: Vec<f64>,
    /// Edges along y, one more than rows.
    pub(crate) y: Vec<f64>,
    /// One level per cell, each row as long as the columns.
    pub(crate) rows: Vec<Vec<i8>>,
}

impl Heat {
    pub(super) fn write(
        &self,
        out: &mut String,
        across: impl Fn(f64) -> f64,
        down: impl Fn(f64) -> f64,
    ) -> std::fmt::Result {
        for (row, edges) in self.rows.iter().zip(self.y.windows(2)) {
            let [low, high] = edges else { continue };
            let (top, bottom) = (down(*high), down(*low));
            let mut column = 0;
            while let Some(level) = row.get(column) {
                let run = row
                    .iter()
                    .skip(column)
                    .take_while(|next| *next == level)
                    .count();
                if let (Some(from), Some(to)) = (self.x.get(column), self.x.get(column + run)) {
                    let (from, to) = (across(*from), across(*to));
                    write!(
                        out,
                        "<rect shape-rendering=\"crispEdges\" class=\"h{}\" x=\"{from:.1}\" y=\"{top:.1}\" \
                         width=\"{:.1}\" height=\"{:.1}\"/>",
                        level.clamp(&-LEVELS, &LEVELS) + LEVELS,
                        to - from,
                        bottom - top
                    )?;
                }
                column += run;
            }
        }
        Ok(())
    }
}
