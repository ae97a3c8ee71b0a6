//! Mistakes in the author's code: collected, so that all of them show at once.

use std::fmt::Display;

use proc_macro2::{Delimiter, Group, Span, TokenStream};
use quote::{ToTokens, quote, quote_spanned};
use syn::{Data, DeriveInput, Field, Fields};

/// The mistakes found so far.
#[derive(Default)]
pub(crate) struct Faults {
    errors: Vec<syn::Error>,
    /// Whether the declaration makes no sense at all, so that generated code would only repeat that.
    is_fatal: bool,
}

impl Faults {
    /// Adds a mistake, marked at `at`.
    pub(crate) fn add(&mut self, at: impl ToTokens, message: impl Display) {
        self.errors.push(syn::Error::new_spanned(at, message));
    }

    /// Adds a mistake that leaves nothing to generate.
    pub(crate) fn fatal(&mut self, at: impl ToTokens, message: impl Display) {
        self.add(at, message);
        self.is_fatal = true;
    }

    /// Adds the mistake of a result and returns its value, if it has one.
    pub(crate) fn take<T>(&mut self, result: syn::Result<T>) -> Option<T> {
        result.map_err(|error| self.errors.push(error)).ok()
    }

    /// The code that shows the mistakes, and the generated code if that makes sense: without it every use of the type
    /// would be a mistake too.
    pub(crate) fn with(self, generated: TokenStream) -> TokenStream {
        let errors = self.errors.iter().map(syn::Error::to_compile_error);
        errors.chain((!self.is_fatal).then_some(generated)).collect()
    }

    /// The fields of a struct with names; anything else is a mistake.
    pub(crate) fn fields(&mut self, input: &DeriveInput, what: &str) -> Vec<Field> {
        match &input.data {
            Data::Struct(data) if !matches!(data.fields, Fields::Unnamed(_)) => data.fields.iter().cloned().collect(),
            _ => {
                self.fatal(&input.ident, format!("{what} is a struct with named fields"));
                Vec::new()
            }
        }
    }
}

/// A constant assertion. If it fails, the compiler marks all of `at`: from its first token, which has the span of the
/// macro's name, to its last, which has that of its parentheses.
pub(crate) fn asserted(at: &impl ToTokens, condition: &TokenStream, message: &str) -> TokenStream {
    let assertion = assertion(at, condition, message);
    quote!(const _: () = #assertion;)
}

/// The assertion alone, for a block of constants in a function.
pub(crate) fn assertion(at: &impl ToTokens, condition: &TokenStream, message: &str) -> TokenStream {
    let tokens: Vec<_> = at.to_token_stream().into_iter().collect();
    let here =
        |token: Option<&proc_macro2::TokenTree>| token.map_or_else(Span::call_site, proc_macro2::TokenTree::span);
    let (start, end) = (here(tokens.first()), here(tokens.last()));
    let mut arguments = Group::new(Delimiter::Parenthesis, quote!(#condition, #message));
    arguments.set_span(end);
    quote_spanned!(start=> ::core::assert! #arguments)
}
