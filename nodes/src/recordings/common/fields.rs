//! Rows of a table with optionally quoted fields.

use super::text::Piece;

/// The fields of a line, without surrounding blanks and quotes.
#[derive(Debug, Clone)]
pub(crate) struct Fields<'t> {
    rest: Option<Piece<'t>>,
    separator: char,
}

impl<'t> Fields<'t> {
    /// Splits a line at a separator.
    pub(crate) const fn new(line: Piece<'t>, separator: char) -> Self {
        Self { rest: Some(line), separator }
    }
}

impl<'t> Iterator for Fields<'t> {
    type Item = Piece<'t>;

    fn next(&mut self) -> Option<Piece<'t>> {
        let rest = self.rest.take()?;
        let start = rest.text.len() - rest.text.trim_start_matches(' ').len() + 1;
        let is_quoted = rest.text[start - 1..].starts_with('"');
        let close = if is_quoted { rest.text[start..].find('"').map(|end| start + end) } else { None };
        let from = close.unwrap_or(0);
        let end = rest.text[from..].find(self.separator).map(|end| from + end);
        self.rest = end.map(|end| rest.part(&rest.text[end + self.separator.len_utf8()..]));
        let field = match close {
            Some(close) => &rest.text[start..close],
            None => &rest.text[..end.unwrap_or(rest.text.len())],
        };
        let field = rest.part(field);
        Some(field.trimmed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_split_into_fields() {
        let cases: [(&str, char, &[&str]); 9] = [
            ("1,2,3", ',', &["1", "2", "3"]),
            ("1;2,5;3;", ';', &["1", "2,5", "3", ""]),
            ("1\t2\t\t", '\t', &["1", "2", "", ""]),
            (" 1 , 2", ',', &["1", "2"]),
            (r#""0,35","1,5", x"#, ',', &["0,35", "1,5", "x"]),
            (r#"a,"b,c" ,"#, ',', &["a", "b,c", ""]),
            (r#""open,1"#, ',', &[r#""open"#, "1"]),
            (r#""""#, ',', &[""]),
            ("", ',', &[""]),
        ];
        for (line, separator, expected) in cases {
            let fields: Vec<Piece<'_>> = Fields::new(Piece { text: line, start: 7 }, separator).collect();
            let texts: Vec<&str> = fields.iter().map(|field| field.text).collect();
            assert_eq!(texts, expected, "{line}");
            for field in fields {
                assert_eq!(&line[field.start - 7..][..field.text.len()], field.text, "{line}");
            }
        }
    }
}
