//! A page of HTML that loads nothing.

use std::fmt::Write;

use crate::cli::text::svg::escaped;

/// Colours follow the reader's choice of a light or a dark page. A wide picture scrolls on a screen and shrinks on paper,
/// where nothing is cut between two sheets.
const STYLE: &str = "
:root { color-scheme: light dark; }
body { font-family: sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; line-height: 1.4; }
pre { font-size: 0.8rem; line-height: 1.2; overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.85rem; }
th, td { text-align: left; padding: 0.15rem 0.7rem; border-bottom: 1px solid #8886; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
tr.failed td:last-child { font-weight: bold; color: #c8553d; }
figure { margin: 1rem 0; overflow-x: auto; }
svg { width: var(--width); height: auto; }
@media print { body { margin: 0; max-width: none; } svg { max-width: 100%; } figure, tr, pre { break-inside: avoid; } }
";

/// A page that grows from the top to the bottom.
pub(super) struct HtmlPage {
    text: String,
}

impl HtmlPage {
    /// Starts a page.
    pub(super) fn new(title: &str) -> Self {
        let title = escaped(title);
        let text = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
             content=\"width=device-width\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
             <h1>{title}</h1>\n"
        );
        Self { text }
    }

    /// Adds a heading.
    pub(super) fn heading(&mut self, text: &str) {
        self.put(format_args!("<h2>{}</h2>", escaped(text)));
    }

    /// Adds a paragraph.
    pub(super) fn paragraph(&mut self, text: &str) {
        self.put(format_args!("<p>{}</p>", escaped(text)));
    }

    /// Adds text as it stands, in a font whose characters have one width.
    pub(super) fn listing(&mut self, text: &str) {
        self.put(format_args!("<pre>{}</pre>", escaped(text.trim_end())));
    }

    /// Adds a picture with a caption.
    pub(super) fn picture(&mut self, svg: &str, caption: &str) {
        let width = svg.split_once("viewBox=\"0 0 ").and_then(|(_, rest)| rest.split_once(' ')).map(|(width, _)| width);
        let style = width.map_or_else(String::new, |width| format!(" style=\"--width: {width}px\""));
        self.put(format_args!("<figure{style}>\n{svg}<figcaption>{}</figcaption>\n</figure>", escaped(caption)));
    }

    /// Adds a table with a heading above and notes below. The first row is that of the titles.
    pub(super) fn table(&mut self, heading: &str, rows: &[Vec<String>], notes: &str) {
        self.heading(heading);
        self.text.push_str("<table>\n");
        for (i, row) in rows.iter().enumerate() {
            let class = if row.last().is_some_and(|mark| mark == "FAILED") { " class=\"failed\"" } else { "" };
            let cells = row.iter().map(|cell| match i {
                0 => format!("<th>{}</th>", escaped(cell)),
                _ if cell.parse::<f64>().is_ok() => format!("<td class=\"number\">{}</td>", escaped(cell)),
                _ => format!("<td>{}</td>", escaped(cell)),
            });
            let cells: String = cells.collect();
            self.put(format_args!("<tr{class}>{cells}</tr>"));
        }
        self.text.push_str("</table>\n");
        if !notes.trim().is_empty() {
            self.listing(notes);
        }
    }

    /// Ends the page.
    pub(super) fn finish(self) -> String {
        self.text + "</body>\n</html>\n"
    }

    fn put(&mut self, element: std::fmt::Arguments<'_>) {
        writeln!(self.text, "{element}").expect("writing to a string cannot fail");
    }
}
