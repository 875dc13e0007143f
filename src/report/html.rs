//! The page: findings, numbered figures and tables, verdicts. One file, no script, no network.
//!
//! **Invariant:** text from a section is escaped where the section makes HTML of it, or here.

use super::machine::Machine;
use super::section::{Cell, NUMBER, Section, Table};
use super::svg::{escape, style};

const PAGE_STYLE: &str = include_str!("page.css");

/// The section for maintainers; it comes last.
const LAST: &str = "work";

const METHOD: &str = "Sections that measure times run one after the other, beside all others. \
     Times are processor times of one thread, the median of 31 runs after one untimed run. While the \
     clock runs nothing is counted, compared or written. Errors come from separate runs of the same steps. References \
     are Taylor series of order 30 in double-double arithmetic. They start from the Lagrangian and share no formula \
     with the arm's own kernel. Their uncertainty is the distance to a second series of other order and tolerance. The \
     reference of the stiff arms is Rodas3 with 32768 steps, checked against implicit midpoint with as many. Nothing \
     is tuned per method.";

/// The whole page.
pub(crate) fn page(sections: &[Section], machine: &Machine) -> String {
    let link = |section: &Section| {
        format!(
            "<a href=\"#{}\">{}</a>",
            section.name,
            escape(&section.title)
        )
    };
    let findings = sections.iter().flat_map(|section| &section.findings);
    let findings = findings.map(|finding| format!("<li>{}</li>", emphasised(finding)));
    let (others, last): (Vec<_>, Vec<_>) = sections.iter().partition(|it| it.name != LAST);
    let mut body: String = others.into_iter().map(section).collect();
    body += &verdicts(sections);
    body.extend(last.into_iter().map(section));
    let mut pieces = body.split(NUMBER);
    let first = pieces.next().unwrap_or_default().to_owned();
    let body = (1..).zip(pieces).fold(first, |out, (number, piece)| {
        format!("{out}Figure {number}.{piece}")
    });
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>pendularm: which method, at which timestep</title>\n<style>{}{PAGE_STYLE}</style></head>\n<body>\
         <header><h1>Which method, at which timestep, for which error, at what cost</h1>\
         <p>The arm of pendularm under each of its integrators. Version {}.</p></header><nav>{}\
         <a href=\"#verdicts\">Verdicts</a><a href=\"#making\">How this was made</a></nav><main>\
         <section><h2>Findings</h2><ul class=\"findings\">{}</ul></section>{body}{}</main></body></html>\n",
        style(),
        escape(&machine.version),
        sections.iter().map(link).collect::<String>(),
        findings.collect::<String>(),
        making(sections, machine)
    )
}

fn section(section: &Section) -> String {
    let Section { name, html, .. } = section;
    let title = escape(&section.title);
    format!("<section id=\"{name}\"><h2>{title}</h2>{html}</section>")
}

fn verdicts(sections: &[Section]) -> String {
    let all: Vec<_> = sections
        .iter()
        .flat_map(|section| &section.verdicts)
        .collect();
    let short = all.iter().filter(|verdict| !verdict.holds).count();
    let heading = match (all.len(), short) {
        (count, 0) => format!("Verdicts: all {count} hold"),
        (count, short) => format!(
            "Verdicts: {} of {count} hold, {short} do not",
            count - short
        ),
    };
    let mut table = Table::new("verdicts", heading, "", ["Claim", "Seen in this run", ""]);
    let row = |verdict: &&super::section::Verdict| {
        let words = [&verdict.claim, &verdict.seen].map(Cell::new);
        words
            .into_iter()
            .chain([Cell::verdict(Some(verdict.holds))])
            .collect()
    };
    table.rows.extend(all.iter().map(row));
    format!(
        "<section id=\"verdicts\" class=\"verdicts\">{}</section>",
        table.html("h2")
    )
}

fn making(sections: &[Section], machine: &Machine) -> String {
    let fact = |(name, value): &(String, String)| {
        format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value))
    };
    let made = |section: &Section| {
        let quick = if section.quick { ", quick" } else { "" };
        format!("<li>{}: {:.0} s{quick}</li>", section.name, section.seconds)
    };
    format!(
        "<section id=\"making\"><h2>How this was made</h2><dl>{}</dl><p>{METHOD}</p><ul class=\"sections\">{}</ul>\
         </section>",
        machine.facts.iter().map(fact).collect::<String>(),
        sections.iter().map(made).collect::<String>()
    )
}

/// Escaped, with `**words**` as `<strong>`.
fn emphasised(text: &str) -> String {
    let escaped = escape(text);
    let parts = escaped.split("**").enumerate();
    let emphasise = |(index, part): (usize, &str)| match index % 2 {
        1 => format!("<strong>{part}</strong>"),
        _ => part.to_owned(),
    };
    parts.map(emphasise).collect()
}
