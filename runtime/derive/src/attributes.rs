//! The attributes of the derives: a list of words, some with a value.

use proc_macro2::Span;
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{Attribute, Expr, ExprLit, Ident, Lit, LitStr, Token};

use crate::fault::Faults;

/// One word of an attribute with its value, if it has one.
pub(crate) struct Word {
    pub(crate) name: Ident,
    pub(crate) value: Option<Expr>,
}

impl Parse for Word {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let name: Ident = input.parse()?;
        let value = if input.peek(Token![=]) {
            input.parse::<Token![=]>()?;
            Some(input.parse()?)
        } else {
            None
        };
        Ok(Self { name, value })
    }
}

/// The words of all attributes called `name` of one field. What is left over at the end is a mistake.
pub(crate) struct Words {
    words: Vec<Word>,
    known: &'static [&'static str],
    /// Whether all of them could be read. Otherwise what seems to be missing may be there.
    pub(crate) are_complete: bool,
}

impl Words {
    /// Reads them; a word that is not `known` or stands twice is a mistake.
    pub(crate) fn new(
        attributes: &[Attribute],
        name: &str,
        known: &'static [&'static str],
        faults: &mut Faults,
    ) -> Self {
        let mut words: Vec<Word> = Vec::new();
        let mut are_complete = true;
        for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident(name)) {
            let parsed = attribute.parse_args_with(Punctuated::<Word, Token![,]>::parse_terminated);
            are_complete &= parsed.is_ok();
            for word in faults.take(parsed).into_iter().flatten() {
                if !known.iter().any(|known| word.name == known) {
                    faults.add(&word.name, format!("`{}` is not known here; write {}", word.name, list(known)));
                } else if words.iter().any(|other| other.name == word.name) {
                    faults.add(&word.name, format!("`{}` is given twice: remove one", word.name));
                } else {
                    words.push(word);
                }
            }
        }
        Self { words, known, are_complete }
    }

    /// Whether no word is left.
    pub(crate) fn are_all_taken(&self) -> bool {
        self.words.is_empty()
    }

    /// Takes a word out.
    fn take(&mut self, name: &str) -> Option<Word> {
        debug_assert!(self.known.contains(&name), "`{name}` is asked for but not known");
        let i = self.words.iter().position(|word| word.name == name)?;
        Some(self.words.remove(i))
    }

    /// The place of a word without a value, if it is there.
    pub(crate) fn flag(&mut self, name: &str, faults: &mut Faults) -> Option<Ident> {
        let Word { name, value } = self.take(name)?;
        if let Some(value) = value {
            faults.add(value, format!("`{name}` takes no value"));
        }
        Some(name)
    }

    /// The value of a word, if it is there.
    pub(crate) fn value(&mut self, name: &str, faults: &mut Faults) -> Option<(Ident, Expr)> {
        let Word { name, value } = self.take(name)?;
        if value.is_none() {
            faults.add(&name, format!("`{name}` needs a value: `{name} = …`"));
        }
        Some((name, value?))
    }

    /// The text of a word, if it is there.
    pub(crate) fn text(&mut self, name: &str, faults: &mut Faults) -> Option<LitStr> {
        match self.value(name, faults)? {
            (_, Expr::Lit(ExprLit { lit: Lit::Str(text), .. })) => Some(text),
            (name, value) => {
                faults.add(value, format!("`{name}` takes a string: `{name} = \"…\"`"));
                None
            }
        }
    }
}

/// `a`, `b` or `c`.
pub(crate) fn list(words: &[&str]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
    match quoted.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => quoted.concat(),
    }
}

/// `LastSeen` or `lastSeen` as `last_seen`.
pub(crate) fn snake_case(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push('_');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

/// Whether `name` is snake_case and begins with a letter.
pub(crate) fn is_snake_case(name: &str) -> bool {
    let is_part = |part: &str| part.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit()) && !part.is_empty();
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.split('_').all(is_part)
}

/// An identifier beside another, with the author's place.
pub(crate) fn beside(name: &Ident, ending: &str) -> Ident {
    Ident::new(&format!("{name}{ending}"), Span::call_site().located_at(name.span()))
}
