//! `#[derive(State)]`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::DeriveInput;

use crate::fault::Faults;

pub(crate) fn derive(input: &DeriveInput) -> TokenStream {
    let mut faults = Faults::default();
    let fields = faults.fields(input, "a node's state");
    let names: Vec<_> = fields.iter().filter_map(|field| field.ident.as_ref()).collect();
    let (name, (generics, arguments, bounds)) = (&input.ident, input.generics.split_for_impl());
    faults.with(quote! {
        #[automatically_derived]
        impl #generics ::core::default::Default for #name #arguments #bounds {
            fn default() -> Self {
                Self { #(#names: ::core::default::Default::default()),* }
            }
        }

        #[automatically_derived]
        impl #generics ::core::clone::Clone for #name #arguments #bounds {
            fn clone(&self) -> Self {
                Self { #(#names: ::core::clone::Clone::clone(&self.#names)),* }
            }
            fn clone_from(&mut self, from: &Self) {
                let _ = from;
                #(::core::clone::Clone::clone_from(&mut self.#names, &from.#names);)*
            }
        }
    })
}
