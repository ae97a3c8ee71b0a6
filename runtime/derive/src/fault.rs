//! Mistakes in the author's code: collected, so that all of them show at once.

use std::fmt::Display;

use proc_macro2::TokenStream;
use quote::ToTokens;
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
