//! Mistakes in the author's code: collected, so that all of them show at once.

use std::fmt::Display;

use proc_macro2::TokenStream;
use quote::ToTokens;
use syn::{Data, DeriveInput, Field, Fields};

/// The mistakes found so far.
#[derive(Default)]
pub(crate) struct Faults(Vec<syn::Error>);

impl Faults {
    /// Adds a mistake, marked at `at`.
    pub(crate) fn add(&mut self, at: impl ToTokens, message: impl Display) {
        self.0.push(syn::Error::new_spanned(at, message));
    }

    /// Adds the mistake of a result and returns its value, if it has one.
    pub(crate) fn take<T>(&mut self, result: syn::Result<T>) -> Option<T> {
        result.map_err(|error| self.0.push(error)).ok()
    }

    /// The code that shows the mistakes.
    pub(crate) fn into_tokens(self) -> TokenStream {
        self.0.iter().map(syn::Error::to_compile_error).collect()
    }

    /// The fields of a struct with names; anything else is a mistake.
    pub(crate) fn fields(&mut self, input: &DeriveInput, what: &str) -> Vec<Field> {
        match &input.data {
            Data::Struct(data) if !matches!(data.fields, Fields::Unnamed(_)) => data.fields.iter().cloned().collect(),
            _ => {
                self.add(&input.ident, format!("{what} is a struct with named fields"));
                Vec::new()
            }
        }
    }
}
