//! Pages of text built from a few kinds of elements, rendered for a terminal or as Markdown.

use std::borrow::Cow;
use std::fmt::Write;

use clap::builder::styling::{AnsiColor, Style};
use textwrap::{Options, WordSplitter};

/// One element of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Element {
    /// The subject of the page and its category.
    Title(String, &'static str),
    /// Paragraphs of Markdown.
    Prose(String),
    /// The heading of a section.
    Heading(String),
    /// A list of definitions.
    Definitions(Vec<Definition>),
    /// TOML to paste.
    Code(String),
}

/// A name and its explanation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Definition {
    /// The name.
    pub(crate) name: String,
    /// A few words beside the name.
    pub(crate) summary: String,
    /// Paragraphs below the summary.
    pub(crate) details: Vec<String>,
}

/// Maximum width of a page [characters].
const MAX_WIDTH: usize = 100;
/// Minimum width of a page [characters]; narrower terminals show no live view.
const MIN_WIDTH: usize = 40;
/// Maximum width of the column of names [characters].
const MAX_NAME_WIDTH: usize = 24;

/// Width and colour of a page on a terminal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PageStyle {
    /// Width [characters].
    pub(crate) width: usize,
    /// Whether the page may use escape codes for colours.
    pub(crate) has_colour: bool,
}

impl PageStyle {
    /// Returns a style with the width of the terminal, or the maximum width without one.
    pub(crate) fn new(has_colour: bool) -> Self {
        let width = terminal_size::terminal_size().map_or(MAX_WIDTH, |(width, _)| usize::from(width.0));
        Self { width: width.clamp(MIN_WIDTH, MAX_WIDTH), has_colour }
    }

    /// Returns a style for a terminal of that width, or `None` if it is too narrow.
    pub(crate) fn of_width(width: usize, has_colour: bool) -> Option<Self> {
        (width >= MIN_WIDTH).then_some(Self { width: width.min(MAX_WIDTH), has_colour })
    }

    /// Renders the elements as text.
    pub(crate) fn render(self, elements: &[Element]) -> String {
        let mut text = String::new();
        let mut follows_heading = true;
        for element in elements {
            if !follows_heading {
                text.push('\n');
            }
            follows_heading = matches!(element, Element::Heading(_));
            // Writing to a string cannot fail.
            let _ = match element {
                Element::Title(name, category) => writeln!(text, "{} ({category})", self.bold(name)),
                Element::Heading(heading) => writeln!(text, "{}", self.bold(heading)),
                Element::Prose(prose) => write!(text, "{}", self.prose(prose)),
                Element::Definitions(definitions) => write!(text, "{}", self.definitions(definitions)),
                Element::Code(code) => writeln!(text, "{}", code.trim_end()),
            };
        }
        text.truncate(text.trim_end().len());
        text
    }

    fn styled(self, style: Style, text: &str) -> String {
        if self.has_colour { format!("{style}{text}{style:#}") } else { text.to_owned() }
    }

    fn bold(self, text: &str) -> String {
        self.styled(Style::new().bold(), text)
    }

    /// Wraps paragraphs; lists, tables and code stay as they are.
    fn prose(self, prose: &str) -> String {
        let is_preformatted = |text: &str| text.lines().any(|line| line.starts_with(['|', '-', '*', '`', ' ']));
        let paragraphs = prose.trim().split("\n\n").map(|paragraph| match is_preformatted(paragraph) {
            true => format!("{}\n", paragraph.trim_end()),
            false => wrap(paragraph, self.width, 0).join("\n") + "\n",
        });
        paragraphs.collect::<Vec<_>>().join("\n")
    }

    fn definitions(self, definitions: &[Definition]) -> String {
        let widest =
            definitions.iter().map(|item| item.name.chars().count()).filter(|width| *width <= MAX_NAME_WIDTH).max();
        let column = 2 + widest.unwrap_or(MAX_NAME_WIDTH) + 2;
        let mut text = String::new();
        for item in definitions {
            let used = 2 + item.name.chars().count();
            let mut lines = wrap(&item.summary, self.width, column).into_iter();
            let beside = match used + 2 <= column {
                true => " ".repeat(column - used) + lines.next().unwrap_or_default().trim_start(),
                false => String::new(),
            };
            let name = self.styled(AnsiColor::Cyan.on_default(), &item.name);
            let details = item.details.iter().flat_map(|text| wrap(text, self.width, column));
            let lines = [format!("  {name}{beside}")].into_iter().chain(lines).chain(details);
            text.extend(lines.map(|line| line + "\n"));
        }
        text
    }
}

/// Wraps a text into lines of at most `width` characters, each indented by `indent` spaces. A longer word has its own
/// line.
fn wrap(text: &str, width: usize, indent: usize) -> Vec<String> {
    let (text, pad) = (text.split_whitespace().collect::<Vec<_>>().join(" "), " ".repeat(indent));
    if text.is_empty() {
        return Vec::new();
    }
    let options = Options::new(width).initial_indent(&pad).subsequent_indent(&pad).break_words(false);
    let options = options.word_splitter(WordSplitter::NoHyphenation);
    textwrap::wrap(&text, options).into_iter().map(Cow::into_owned).collect()
}

/// Breaks a text into lines of at most `width` characters, only after `;`.
pub(crate) fn break_at_semicolons(text: &str, width: usize) -> String {
    let (mut lines, mut room) = (String::new(), width);
    for (i, part) in text.split("; ").enumerate() {
        let length = part.chars().count() + 2;
        let (between, indent) = match i {
            0 => ("", 0),
            _ if length <= room => ("; ", 0),
            _ => (";\n  ", 2),
        };
        room = if indent > 0 { width } else { room };
        room = room.saturating_sub(length + indent);
        lines.push_str(between);
        lines.push_str(part);
    }
    lines
}

/// Renders the elements as Markdown, with headings that start at `level`.
pub(crate) fn markdown(elements: &[Element], level: usize) -> String {
    let mut text = String::new();
    for element in elements {
        let _ = match element {
            Element::Title(name, _) => writeln!(text, "{} `{name}`\n", "#".repeat(level)),
            Element::Heading(heading) => writeln!(text, "{} {heading}\n", "#".repeat(level + 1)),
            Element::Prose(prose) => writeln!(text, "{}\n", prose.trim()),
            Element::Definitions(definitions) => writeln!(text, "{}", list(definitions)),
            Element::Code(code) => writeln!(text, "```toml\n{}\n```\n", code.trim_end()),
        };
    }
    text
}

fn list(definitions: &[Definition]) -> String {
    let item = |Definition { name, summary, details }: &Definition| {
        let lines = [summary].into_iter().chain(details).map(|text| text.trim()).filter(|text| !text.is_empty());
        format!("- **`{name}`**: {}\n", lines.collect::<Vec<_>>().join("<br>\n  "))
    };
    definitions.iter().map(item).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Vec<Element> {
        let details = vec!["Proportional gain [1/s].".to_owned()];
        let long =
            Definition { name: "a_name_that_is_too_long_for_it".into(), summary: "a number".into(), details: vec![] };
        vec![
            Element::Title("pid".into(), "node"),
            Element::Prose(
                "one two three four five six seven eight nine ten\n\n- a list stays as it is, however long it may be"
                    .into(),
            ),
            Element::Definitions(vec![
                Definition { name: "kp".into(), summary: "a number; required".into(), details },
                long,
            ]),
        ]
    }

    #[test]
    fn paragraphs_are_wrapped_and_definitions_are_aligned() {
        let text = PageStyle { width: 40, has_colour: false }.render(&page());
        let expected = "\
pid (node)

one two three four five six seven eight
nine ten

- a list stays as it is, however long it may be

  kp  a number; required
      Proportional gain [1/s].
  a_name_that_is_too_long_for_it
      a number";
        assert_eq!(text, expected);
        let coloured = PageStyle { width: 40, has_colour: true }.render(&page());
        assert!(coloured.starts_with("\u{1b}[1mpid\u{1b}[0m (node)\n"), "{coloured:?}");
    }

    #[test]
    fn a_page_as_markdown() {
        let expected = "\
## `pid`

one two three four five six seven eight nine ten

- a list stays as it is, however long it may be

- **`kp`**: a number; required<br>
  Proportional gain [1/s].
- **`a_name_that_is_too_long_for_it`**: a number

";
        assert_eq!(markdown(&page(), 2), expected);
    }
}
