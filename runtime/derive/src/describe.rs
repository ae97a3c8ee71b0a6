//! `#[derive(Describe)]`.

use proc_macro2::TokenStream;
use quote::{ToTokens, quote};
use syn::{Attribute, DeriveInput, LitStr, Type};

use crate::attributes::{Words, is_snake_case, snake_case};
use crate::docs::{Page, is_example_of, lines};
use crate::fault::Faults;

const KNOWN: &[&str] = &["name", "of", "every_tick", "logs"];

/// One name that the type has in a graph file.
struct Name {
    name: LitStr,
    /// The type, if the struct is generic.
    of: Option<Type>,
    every_tick: bool,
    logs: bool,
}

pub(crate) fn derive(input: &DeriveInput) -> TokenStream {
    let mut faults = Faults::default();
    let page = Page::new(&lines(&input.attrs));
    if page.summary.is_empty() {
        faults.add(&input.ident, format!("`{}` needs a doc comment: its first line is the summary", input.ident));
    }
    let mut attributes: Vec<Option<&Attribute>> =
        input.attrs.iter().filter(|attribute| attribute.path().is_ident("describe")).map(Some).collect();
    if attributes.is_empty() {
        attributes.push(None);
    }
    let names: Vec<Name> = attributes.iter().filter_map(|attribute| name(*attribute, input, &mut faults)).collect();
    for (i, Name { name, .. }) in names.iter().enumerate() {
        if names[..i].iter().any(|other| other.name.value() == name.value()) {
            faults.add(name, format!("the name `{}` is given twice: remove one", name.value()));
        }
    }
    for Name { name, .. } in names.iter().filter(|name| !page.blocks.is_empty() && is_snake_case(&name.name.value())) {
        if !page.blocks.iter().any(|block| is_example_of(block, &name.value())) {
            faults.add(name, format!("no `toml` block of the doc comment has `type = \"{}\"`", name.value()));
        }
    }
    let body = page.body(|block| names.iter().any(|name| is_example_of(block, &name.name.value())));
    let implementations: TokenStream = names.iter().map(|name| implementation(name, &page, &body, input)).collect();
    faults.with(implementations)
}

/// Reads one attribute, or none; without a name in it, the name is that of the struct in snake_case.
fn name(attribute: Option<&Attribute>, input: &DeriveInput, faults: &mut Faults) -> Option<Name> {
    let mut words = Words::new(attribute.map_or(&[], std::slice::from_ref), "describe", KNOWN, faults);
    let is_flag = |word: &str, words: &mut Words, faults: &mut Faults| words.flag(word, faults).is_some();
    let (every_tick, logs) = (is_flag("every_tick", &mut words, faults), is_flag("logs", &mut words, faults));
    let of = words.text("of", faults);
    let is_generic = input.generics.type_params().next().is_some();
    match &of {
        Some(of) if !is_generic => faults.add(of, format!("`{}` is not generic: leave `of` out", input.ident)),
        None if is_generic => {
            let message =
                format!("`{0}` is generic: add the concrete type of this name, `of = \"{0}<…>\"`", input.ident);
            let place: &dyn ToTokens = attribute.map_or(&input.ident, |attribute| attribute);
            faults.add(place, message);
            return None;
        }
        _ => {}
    }
    let of = of.and_then(|of| faults.take(of.parse::<Type>()));
    let of_struct = || LitStr::new(&snake_case(&input.ident.to_string()), input.ident.span());
    let name = words.text("name", faults).unwrap_or_else(of_struct);
    if !is_snake_case(&name.value()) {
        faults.add(&name, format!("`{}` is not snake_case, as every `type` in a graph file is", name.value()));
    }
    Some(Name { name, of, every_tick, logs })
}

fn implementation(name: &Name, page: &Page, body: &str, input: &DeriveInput) -> TokenStream {
    let Name { name, of, every_tick, logs } = name;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let (ident, summary) = (&input.ident, &page.summary);
    let example = page.blocks.iter().find(|block| is_example_of(block, &name.value())).map_or("", String::as_str);
    let head = match of {
        Some(of) => quote! { impl ::tactflow_runtime::node::Describe for #of },
        None => quote! { impl #generics ::tactflow_runtime::node::Describe for #ident #arguments #bounds },
    };
    quote! {
        #[automatically_derived]
        #head {
            const NAME: &'static str = #name;
            const SUMMARY: &'static str = #summary;
            const DOC: &'static str = #body;
            const EXAMPLE: &'static str = #example;
            const EVERY_TICK: bool = #every_tick;
            const LOGS: bool = #logs;
        }
    }
}
