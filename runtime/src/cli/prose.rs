//! Pages of text: a list of blocks, rendered for a terminal or as Markdown.

use std::borrow::Cow;
use std::fmt::Write;

use clap::builder::styling::{AnsiColor, Style};
use textwrap::{Options, WordSplitter};

/// A part of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Block {
    /// Name of the thing that the page describes, and its category.
    Title(String, &'static str),
    /// Markdown.
    Prose(String),
    Heading(String),
    Items(Vec<Item>),
    /// TOML, to paste.
    Code(String),
}

/// An entry of a list: a name and its description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) name: String,
    /// Summary in a few words.
    pub(super) what: String,
    /// Further paragraphs.
    pub(super) more: Vec<String>,
}

/// Maximum width of a page [columns].
const MAX_WIDTH: usize = 100;
/// Minimum width of a page [columns]: on a narrower terminal nothing is drawn.
const MIN_WIDTH: usize = 40;
/// Maximum width of the column of names [columns].
const MAX_NAME_WIDTH: usize = 24;

/// How a page is rendered on a terminal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) width: usize,
    pub(super) has_colour: bool,
}

impl Look {
    /// Returns a look of the width of the terminal, or of the maximum width if there is no terminal.
    pub(super) fn new(has_colour: bool) -> Self {
        let width = terminal_size::terminal_size().map_or(MAX_WIDTH, |(width, _)| usize::from(width.0));
        Self { width: width.clamp(MIN_WIDTH, MAX_WIDTH), has_colour }
    }

    /// Returns a look of that width, or `None` if it is too narrow.
    pub(super) fn of_width(width: usize, has_colour: bool) -> Option<Self> {
        (width >= MIN_WIDTH).then_some(Self { width: width.min(MAX_WIDTH), has_colour })
    }

    /// Renders the blocks as text.
    pub(super) fn render(self, blocks: &[Block]) -> String {
        let mut text = String::new();
        let mut is_close = true;
        for block in blocks {
            if !is_close {
                text.push('\n');
            }
            is_close = matches!(block, Block::Heading(_));
            // Writing to a string cannot fail.
            let _ = match block {
                Block::Title(name, sort) => writeln!(text, "{} ({sort})", self.bold(name)),
                Block::Heading(heading) => writeln!(text, "{}", self.bold(heading)),
                Block::Prose(prose) => write!(text, "{}", self.prose(prose)),
                Block::Items(items) => write!(text, "{}", self.items(items)),
                Block::Code(code) => writeln!(text, "{}", code.trim_end()),
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

    /// Wraps paragraphs; lists, tables and code stay unchanged.
    fn prose(self, prose: &str) -> String {
        let is_kept = |text: &str| text.lines().any(|line| line.starts_with(['|', '-', '*', '`', ' ']));
        let paragraphs = prose.trim().split("\n\n").map(|paragraph| match is_kept(paragraph) {
            true => format!("{}\n", paragraph.trim_end()),
            false => wrap(paragraph, self.width, 0).join("\n") + "\n",
        });
        paragraphs.collect::<Vec<_>>().join("\n")
    }

    fn items(self, items: &[Item]) -> String {
        let widest = items.iter().map(|item| item.name.chars().count()).filter(|width| *width <= MAX_NAME_WIDTH).max();
        let column = 2 + widest.unwrap_or(MAX_NAME_WIDTH) + 2;
        let mut text = String::new();
        for item in items {
            let used = 2 + item.name.chars().count();
            text.push_str("  ");
            text.push_str(&self.styled(AnsiColor::Cyan.on_default(), &item.name));
            let mut lines = wrap(&item.what, self.width, column).into_iter();
            if used + 2 <= column {
                text.push_str(&" ".repeat(column - used));
                text.push_str(lines.next().unwrap_or_default().trim_start());
            }
            text.push('\n');
            let more = item.more.iter().flat_map(|more| wrap(more, self.width, column));
            for line in lines.chain(more) {
                text.push_str(&line);
                text.push('\n');
            }
        }
        text
    }
}

/// Wraps a text into lines of at most `width` columns, each indented by `indent` spaces. A longer word has its own line.
fn wrap(text: &str, width: usize, indent: usize) -> Vec<String> {
    let (text, pad) = (text.split_whitespace().collect::<Vec<_>>().join(" "), " ".repeat(indent));
    if text.is_empty() {
        return Vec::new();
    }
    let options = Options::new(width).initial_indent(&pad).subsequent_indent(&pad).break_words(false);
    let options = options.word_splitter(WordSplitter::NoHyphenation);
    textwrap::wrap(&text, options).into_iter().map(Cow::into_owned).collect()
}

/// Renders the blocks as Markdown, with headings that start at `level`.
pub(super) fn markdown(blocks: &[Block], level: usize) -> String {
    let mut text = String::new();
    for block in blocks {
        let _ = match block {
            Block::Title(name, _) => writeln!(text, "{} `{name}`\n", "#".repeat(level)),
            Block::Heading(heading) => writeln!(text, "{} {heading}\n", "#".repeat(level + 1)),
            Block::Prose(prose) => writeln!(text, "{}\n", prose.trim()),
            Block::Items(items) => writeln!(text, "{}", list(items)),
            Block::Code(code) => writeln!(text, "```toml\n{}\n```\n", code.trim_end()),
        };
    }
    text
}

fn list(items: &[Item]) -> String {
    let mut text = String::new();
    for Item { name, what, more } in items {
        let texts: Vec<&str> =
            [what].into_iter().chain(more).map(|text| text.trim()).filter(|text| !text.is_empty()).collect();
        let _ = writeln!(text, "- **`{name}`**: {}", texts.join("<br>\n  "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Vec<Block> {
        let more = vec!["Proportional gain [1/s].".to_owned()];
        let long = Item { name: "a_name_that_is_too_long_for_it".into(), what: "a number".into(), more: vec![] };
        vec![
            Block::Title("pid".into(), "node"),
            Block::Prose(
                "one two three four five six seven eight nine ten\n\n- a list stays as it is, however long it may be"
                    .into(),
            ),
            Block::Items(vec![Item { name: "kp".into(), what: "a number; required".into(), more }, long]),
        ]
    }

    #[test]
    fn a_page_is_wrapped_and_aligned() {
        let text = Look { width: 40, has_colour: false }.render(&page());
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
        let coloured = Look { width: 40, has_colour: true }.render(&page());
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
