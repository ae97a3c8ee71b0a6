//! Documentation comments: the text of a field, and the summary, body and examples of a whole node.

use syn::{Attribute, Expr, ExprLit, Lit, Meta};

/// The lines of the documentation comment among `attributes`, without the space after `///`.
pub(crate) fn lines(attributes: &[Attribute]) -> Vec<String> {
    let text = |attribute: &Attribute| match &attribute.meta {
        Meta::NameValue(meta) if meta.path.is_ident("doc") => match &meta.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    };
    let texts: Vec<String> = attributes.iter().filter_map(text).collect();
    texts
        .iter()
        .flat_map(|text| text.split('\n'))
        .map(|line| line.strip_prefix(' ').unwrap_or(line).to_owned())
        .collect()
}

/// The documentation comment of a field in one line; empty if there is none.
pub(crate) fn text(attributes: &[Attribute]) -> String {
    let lines = lines(attributes);
    lines.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The documentation comment of a node or a device.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Page {
    /// The first paragraph, as it stands in a list: without its full stop, and without a capital letter that only
    /// begins the sentence.
    pub(crate) summary: String,
    /// The blocks of TOML, in their order.
    pub(crate) blocks: Vec<String>,
    /// Everything else, each paragraph in one line. `Err` is the place of a block.
    body: Vec<Result<String, usize>>,
}

impl Page {
    /// Takes the lines of a documentation comment apart.
    pub(crate) fn new(lines: &[String]) -> Self {
        let mut page = Self::default();
        let start = lines.iter().position(|line| !line.trim().is_empty()).unwrap_or(lines.len());
        let end = lines[start..].iter().position(|line| line.trim().is_empty()).map_or(lines.len(), |i| start + i);
        page.summary = plain(&lines[start..end].iter().map(|line| line.trim()).collect::<Vec<_>>().join(" "));
        let mut rest = lines[end..].iter().map(|line| line.trim_end());
        while let Some(line) = rest.next() {
            if let Some(fence) = line.strip_prefix("```") {
                let inner: Vec<&str> = rest.by_ref().take_while(|line| !line.starts_with("```")).collect();
                page.fence(fence, &inner.join("\n"));
            } else {
                page.line(line);
            }
        }
        page
    }

    fn fence(&mut self, language: &str, inner: &str) {
        if language.trim() == "toml" {
            self.body.push(Err(self.blocks.len()));
            self.blocks.push(format!("\n{inner}\n"));
        } else {
            self.body.push(Ok(format!("```{language}\n{inner}\n```")));
        }
    }

    /// Joins a line to the paragraph it belongs to.
    fn line(&mut self, line: &str) {
        let begins = |text: &str| ["- ", "* ", "|", "#", ">", "    "].iter().any(|mark| text.starts_with(mark));
        match self.body.last_mut() {
            Some(Ok(last)) if !last.is_empty() && !line.is_empty() && !last.starts_with("```") => {
                let glue = if begins(line) || last.starts_with('#') || last.ends_with('|') { '\n' } else { ' ' };
                last.push(glue);
                last.push_str(if glue == ' ' { line.trim_start() } else { line });
            }
            _ => self.body.push(Ok(line.to_owned())),
        }
    }

    /// The body without the blocks that are examples.
    pub(crate) fn body(&self, is_example: impl Fn(&str) -> bool) -> String {
        let shown = |part: &Result<String, usize>| match part {
            Ok(text) => Some(text.clone()).filter(|text| !text.is_empty()),
            Err(i) => (!is_example(&self.blocks[*i])).then(|| format!("```toml{}```", self.blocks[*i])),
        };
        self.body.iter().filter_map(shown).collect::<Vec<_>>().join("\n\n")
    }
}

/// Whether a block of TOML is the example of what is called `name`: whether that is a `type` in it.
pub(crate) fn is_example_of(block: &str, name: &str) -> bool {
    let value = |(at, key): (usize, &str)| block[at + key.len()..].trim_start().strip_prefix('=').map(str::trim_start);
    let mut values = block.match_indices("type").filter_map(value);
    values.any(|value| value.starts_with(&format!("\"{name}\"")))
}

/// A first sentence as it stands in a list.
fn plain(summary: &str) -> String {
    let summary = summary.strip_suffix('.').unwrap_or(summary);
    let mut letters = summary.chars();
    match (letters.next(), letters.clone().next()) {
        (Some(first), Some(second)) if !second.is_uppercase() => first.to_lowercase().chain(letters).collect(),
        _ => summary.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(text: &str) -> Page {
        Page::new(&text.lines().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn a_comment_is_summary_body_and_example() {
        let page = page(
            "Adds two\nnumbers.\n\nOne\nparagraph.\n\n- a\n- b\n\n```toml\ntype = \"sum\"\n```\n\n```text\nx\n```",
        );
        assert_eq!(page.summary, "adds two numbers");
        assert_eq!(page.blocks, ["\ntype = \"sum\"\n"]);
        assert_eq!(page.body(|block| is_example_of(block, "sum")), "One paragraph.\n\n- a\n- b\n\n```text\nx\n```");
        assert!(page.body(|_| false).contains("```toml\ntype = \"sum\"\n```"));
    }

    #[test]
    fn a_capital_that_is_a_name_stays() {
        assert_eq!(page("PID control.").summary, "PID control");
        assert_eq!(page("A gate").summary, "a gate");
    }
}
