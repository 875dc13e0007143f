//! The page: abstract, findings, numbered figures and tables, verdicts. One file, no script, no network.
//!
//! **Invariant:** everything that comes from a section is escaped, but for the panels, which are SVG of our own making.

use std::fmt::{self, Write};

use super::machine::Machine;
use super::section::{Block, Cell, Figure, Section, Table};
use super::svg::{SMALL, STYLE, escape};

const PAGE_STYLE: &str = include_str!("page.css");

/// The section that only a maintainer asks for.
const LAST: &str = "work";

/// The sections whose first claims make the abstract, in this order.
const ABSTRACT: [&str; 5] = ["error", "budget", "stability", "stiff", "scenarios"];

/// Rows of a table beyond which it is folded.
const FOLDED: usize = 8;

/// The whole page.
pub(crate) fn page(sections: &[Section], machine: &Machine) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>pendularm: which method, at which timestep</title>\n<style>{STYLE}{PAGE_STYLE}</style></head>\n<body>"
    );
    header(&mut out, sections, machine);
    out.push_str("<main>");
    summary(&mut out, sections);
    findings(&mut out, sections);
    let mut figures = 0;
    // A maintainer's sections come last.
    let (others, last): (Vec<_>, Vec<_>) = sections.iter().partition(|it| it.name != LAST);
    for section in others {
        body(&mut out, section, &mut figures);
    }
    verdicts(&mut out, sections);
    for section in last {
        body(&mut out, section, &mut figures);
    }
    making(&mut out, sections, machine);
    out.push_str("</main></body></html>\n");
    out
}

fn header(out: &mut String, sections: &[Section], machine: &Machine) {
    out.push_str("<header><h1>Which method, at which timestep, for which error, at what cost</h1>");
    append(
        out,
        format_args!(
            "<p>The arm of pendularm under each of its integrators. Version {}.</p></header><nav>",
            escape(&machine.version)
        ),
    );
    for section in sections {
        append(
            out,
            format_args!(
                "<a href=\"#{}\">{}</a>",
                escape(&section.name),
                escape(&section.title)
            ),
        );
    }
    out.push_str(
        "<a href=\"#verdicts\">Verdicts</a><a href=\"#making\">How this was made</a></nav>",
    );
}

/// The abstract: the claim of the first finding of each of these sections.
fn summary(out: &mut String, sections: &[Section]) {
    out.push_str("<section id=\"abstract\"><h2>Abstract</h2><p>");
    for name in ABSTRACT {
        let section = sections.iter().find(|section| section.name == name);
        let finding = section.and_then(|section| section.findings.first());
        if let Some(claim) = finding.and_then(|finding| finding.split("**").nth(1)) {
            append(
                out,
                format_args!("{}. ", escape(claim.trim_end_matches('.'))),
            );
        }
    }
    out.push_str("</p></section>");
}

fn findings(out: &mut String, sections: &[Section]) {
    out.push_str("<section><h2>Findings</h2><ul class=\"findings\">");
    for finding in sections.iter().flat_map(|section| &section.findings) {
        append(out, format_args!("<li>{}</li>", emphasised(finding)));
    }
    out.push_str("</ul></section>");
}

fn verdicts(out: &mut String, sections: &[Section]) {
    let all = || sections.iter().flat_map(|section| &section.verdicts);
    let short = all().filter(|verdict| !verdict.holds).count();
    let count = all().count();
    let heading = if short == 0 {
        format!("Verdicts: all {count} hold")
    } else {
        format!(
            "Verdicts: {} of {count} hold, {short} fall short",
            count - short
        )
    };
    let mut table = Table::new("verdicts", heading, "", &["Claim", "Seen in this run", ""]);
    for verdict in all() {
        table.rows.push(vec![
            Cell::new(&verdict.claim),
            Cell::new(&verdict.seen),
            Cell::verdict(verdict.holds),
        ]);
    }
    out.push_str("<section id=\"verdicts\" class=\"verdicts\">");
    self::table(out, &table, "h2");
    out.push_str("</section>");
}

fn body(out: &mut String, section: &Section, figures: &mut usize) {
    append(
        out,
        format_args!(
            "<section id=\"{}\"><h2>{}</h2>",
            escape(&section.name),
            escape(&section.title)
        ),
    );
    for block in &section.blocks {
        match block {
            Block::Text(text) => append(out, format_args!("<p>{}</p>", emphasised(text))),
            Block::Figure(figure) => {
                *figures += 1;
                self::figure(out, figure, *figures);
            }
            Block::Table(table) => self::table(out, table, "h3"),
        }
    }
    out.push_str("</section>");
}

fn figure(out: &mut String, figure: &Figure, number: usize) {
    append(
        out,
        format_args!(
            "<figure id=\"{}\"><h3>Figure {number}. {}</h3><p class=\"legend\">",
            escape(&figure.name),
            escape(&figure.title)
        ),
    );
    for (swatch, label) in &figure.legend {
        append(out, format_args!("<span>{swatch} {}</span>", escape(label)));
    }
    let few = match figure.panels.len() {
        0..=2 => " few",
        SMALL.. => " many",
        many if many % 4 == 0 => " four",
        _ => "",
    };
    append(out, format_args!("</p><div class=\"panels{few}\">"));
    for panel in &figure.panels {
        out.push_str(panel);
    }
    append(
        out,
        format_args!(
            "</div><figcaption>{} <a href=\"{name}.svg\">{name}.svg</a>, <a \
             href=\"{name}.csv\">{name}.csv</a></figcaption></figure>",
            escape(&figure.caption),
            name = escape(&figure.name)
        ),
    );
}

fn table(out: &mut String, table: &Table, heading: &str) {
    append(
        out,
        format_args!("<{heading}>{}</{heading}>", escape(&table.title)),
    );
    if !table.caption.is_empty() {
        append(
            out,
            format_args!("<p class=\"caption\">{}</p>", escape(&table.caption)),
        );
    }
    let folded = table.rows.len() > FOLDED;
    if folded {
        let rows = table.rows.len();
        append(out, format_args!("<details><summary>{rows} rows</summary>"));
    }
    out.push_str("<div class=\"scroll\"><table><thead><tr>");
    for head in &table.head {
        let tag = if head.is_empty() { "td" } else { "th" };
        append(out, format_args!("<{tag}>{}</{tag}>", escape(head)));
    }
    out.push_str("</tr></thead><tbody>");
    for row in &table.rows {
        out.push_str("<tr>");
        for cell in row {
            let class = if cell.class.is_empty() {
                String::new()
            } else {
                format!(" class=\"{}\"", escape(&cell.class))
            };
            append(out, format_args!("<td{class}>{}", escape(&cell.text)));
            if !cell.detail.is_empty() {
                append(out, format_args!("<small>{}</small>", escape(&cell.detail)));
            }
            out.push_str("</td>");
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>");
    if folded {
        out.push_str("</details>");
    }
}

fn making(out: &mut String, sections: &[Section], machine: &Machine) {
    out.push_str("<section id=\"making\"><h2>How this was made</h2><dl>");
    for (name, value) in &machine.facts {
        append(
            out,
            format_args!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)),
        );
    }
    out.push_str("</dl><p>Sections are made side by side on the cores there are, those that measure times one after \
         the other. Times are the minimum of repeats after one untimed run, on one thread; whiskers are the \
         quartiles. While the clock runs nothing is counted, compared or written. Errors come from separate runs of \
         the same steps. References are Taylor series of order 30 in double-double arithmetic, from the Lagrangian and \
         not from the arm's own kernel; their own uncertainty is the distance to a second series of other order and \
         tolerance. Nothing is tuned per method.</p><ul class=\"sections\">");
    for section in sections {
        let quick = if section.quick { ", quick" } else { "" };
        append(
            out,
            format_args!(
                "<li>{}: {:.0} s at {}{quick}</li>",
                escape(&section.name),
                section.seconds,
                escape(&section.version)
            ),
        );
    }
    out.push_str("</ul></section>");
}

/// Escaped, with `**words**` set off.
fn emphasised(text: &str) -> String {
    let escaped = escape(text);
    let mut out = String::new();
    for (index, part) in escaped.split("**").enumerate() {
        if index % 2 == 1 {
            append(&mut out, format_args!("<strong>{part}</strong>"));
        } else {
            out.push_str(part);
        }
    }
    out
}

fn append(out: &mut String, text: fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = out.write_fmt(text);
}
