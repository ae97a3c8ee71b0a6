//! Pages of text: made of a few sorts of blocks, shown on a terminal or as Markdown.

use std::fmt::Write;

use clap::builder::styling::{AnsiColor, Style};

/// A piece of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Block {
    /// What the page is about, and what sort of thing that is.
    Title(String, &'static str),
    /// Markdown.
    Prose(String),
    Heading(String),
    Items(Vec<Item>),
    /// TOML, to paste.
    Code(String),
}

/// A name and what there is to say of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) name: String,
    /// What it is, in a few words.
    pub(super) what: String,
    /// What it means, and more of that sort: a paragraph each.
    pub(super) more: Vec<String>,
}

/// As wide as a page gets.
const WIDEST: usize = 100;
/// On what is narrower nothing is drawn.
const NARROWEST: usize = 40;
/// As wide as the column of names gets.
const WIDEST_NAME: usize = 24;

/// How a page is shown on a terminal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) width: usize,
    pub(super) has_colour: bool,
}

impl Look {
    /// As the terminal is, if there is one.
    pub(super) fn new(has_colour: bool) -> Self {
        let width = terminal_size::terminal_size().map_or(WIDEST, |(width, _)| usize::from(width.0));
        Self { width: width.clamp(NARROWEST, WIDEST), has_colour }
    }

    /// On a terminal of that width, if it is wide enough.
    pub(super) fn of_width(width: usize, has_colour: bool) -> Option<Self> {
        (width >= NARROWEST).then_some(Self { width: width.min(WIDEST), has_colour })
    }

    /// The blocks as text.
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

    /// Paragraphs are wrapped; lists, tables and code stay as they are.
    fn prose(self, prose: &str) -> String {
        let is_kept = |text: &str| text.lines().any(|line| line.starts_with(['|', '-', '*', '`', ' ']));
        let paragraphs = prose.trim().split("\n\n").map(|paragraph| match is_kept(paragraph) {
            true => format!("{}\n", paragraph.trim_end()),
            false => wrapped(paragraph, self.width, 0).join("\n") + "\n",
        });
        paragraphs.collect::<Vec<_>>().join("\n")
    }

    fn items(self, items: &[Item]) -> String {
        let widest = items.iter().map(|item| item.name.chars().count()).filter(|width| *width <= WIDEST_NAME).max();
        let column = 2 + widest.unwrap_or(WIDEST_NAME) + 2;
        let mut text = String::new();
        for item in items {
            let used = 2 + item.name.chars().count();
            text.push_str("  ");
            text.push_str(&self.styled(AnsiColor::Cyan.on_default(), &item.name));
            let mut lines = wrapped(&item.what, self.width, column).into_iter();
            if used + 2 <= column {
                text.push_str(&" ".repeat(column - used));
                text.push_str(lines.next().unwrap_or_default().trim_start());
            }
            text.push('\n');
            let more = item.more.iter().flat_map(|more| wrapped(more, self.width, column));
            for line in lines.chain(more) {
                text.push_str(&line);
                text.push('\n');
            }
        }
        text
    }
}

/// Lines of at most `width` characters, each behind `indent` spaces.
fn wrapped(text: &str, width: usize, indent: usize) -> Vec<String> {
    let pad = " ".repeat(indent);
    let mut lines: Vec<String> = Vec::new();
    let mut length = usize::MAX;
    for word in text.split_whitespace() {
        let count = word.chars().count();
        match lines.last_mut() {
            Some(line) if length + 1 + count <= width => {
                line.push(' ');
                line.push_str(word);
                length += 1 + count;
            }
            _ => {
                lines.push(format!("{pad}{word}"));
                length = indent + count;
            }
        }
    }
    lines
}

/// The blocks as Markdown, with headings that start at `level`.
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
        let said: Vec<&str> =
            [what].into_iter().chain(more).map(|text| text.trim()).filter(|text| !text.is_empty()).collect();
        let _ = writeln!(text, "- **`{name}`**: {}", said.join("<br>\n  "));
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
    fn a_page_is_wrapped_and_in_line() {
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
