//! Checks of ports that the compiler makes: which arguments a kind has, and which letters the inputs bind.

use proc_macro2::{Span, TokenStream};
use quote::{ToTokens, quote};
use syn::{DeriveInput, Ident, LitStr};

use crate::attributes::Words;
use crate::fault::{Faults, asserted, assertion};
use crate::port::{ARGUMENTS, Port, QUANTITY, is_letter};

/// What a letter stands for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum LetterKind {
    Unit,
    Frame,
    Quantity,
}

impl LetterKind {
    const ALL: [Self; 3] = [Self::Unit, Self::Frame, Self::Quantity];

    fn of(argument: &str) -> Self {
        match argument {
            "unit" => Self::Unit,
            QUANTITY => Self::Quantity,
            _ => Self::Frame,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Unit => "unit",
            Self::Frame => "frame",
            Self::Quantity => "quantity",
        }
    }
}

impl ToTokens for LetterKind {
    fn to_tokens(&self, tokens: &mut TokenStream) {
        let variant = match self {
            Self::Unit => quote!(Unit),
            Self::Frame => quote!(Frame),
            Self::Quantity => quote!(Quantity),
        };
        tokens.extend(quote!(::tactflow_runtime::node::LetterKind::#variant));
    }
}

/// The letters that a port binds, or uses, each with its place.
fn letters_of(port: &Port) -> impl Iterator<Item = (LetterKind, char, &LitStr)> {
    port.arguments.iter().filter_map(|(name, text)| {
        let (value, kind) = (text.value(), LetterKind::of(name));
        let letter = value.chars().next().filter(char::is_ascii_uppercase)?;
        let is_letter = match kind {
            LetterKind::Unit => is_unit_letter(&value),
            LetterKind::Frame => is_letter(value.split('.').next().unwrap_or_default()),
            LetterKind::Quantity => is_letter(&value),
        };
        is_letter.then_some((kind, letter, text))
    })
}

/// Whether a unit begins with a letter that stands for a unit: `N` is newton, `J` is joule.
pub(crate) fn is_unit_letter(atom: &str) -> bool {
    let mut letters = atom.chars();
    let first = letters.next().filter(|first| first.is_ascii_uppercase() && !['N', 'J'].contains(first));
    first.is_some() && matches!(letters.next(), None | Some('/'))
}

/// What the outputs and the parameters beside the inputs ask: which letters are bound. It has the name of the struct,
/// so that it is imported with it.
pub(crate) fn letters(input: &DeriveInput, ports: &[Port]) -> TokenStream {
    let (name, vis) = (&input.ident, &input.vis);
    let letters = LetterKind::ALL.map(|of| -> String {
        let all = ports.iter().flat_map(letters_of);
        all.filter(|(kind, ..)| *kind == of).map(|(_, letter, _)| letter).collect()
    });
    let has = |port: &Port, argument: &str| port.arguments.iter().any(|(name, _)| *name == argument);
    let says_all = |port: &Port| port.is_complete && (!port.is_generic || has(port, "unit") && has(port, "frame"));
    let is_complete = ports.iter().all(says_all);
    let conditions =
        ports.iter().filter(|port| !port.is_generic).flat_map(arguments).map(|(_, condition, _)| condition);
    quote! {
        #[doc(hidden)]
        #[allow(non_upper_case_globals, dead_code, unreachable_pub, reason = "it goes with the struct of that name")]
        #vis const #name: ::tactflow_runtime::node::Letters = ::tactflow_runtime::node::Letters::of([#(#letters),*], #is_complete #(&& #conditions)*);
    }
}

/// The struct of the inputs whose letters count: `Inputs`, or what `inputs = "…"` names among the words of a struct.
pub(crate) fn inputs_beside(mut words: Words, faults: &mut Faults) -> Ident {
    let named = words.text("inputs", faults);
    named.and_then(|name| faults.take(name.parse())).unwrap_or_else(|| Ident::new("Inputs", Span::call_site()))
}

/// Checks that an input binds each letter of an output.
pub(crate) fn bound(ports: &[Port], inputs: &Ident) -> TokenStream {
    ports.iter().flat_map(letters_of).map(|(kind, letter, text)| bound_letter(kind, letter, text, inputs)).collect()
}

/// Checks that the struct `inputs` binds a letter.
pub(crate) fn bound_letter(kind: LetterKind, letter: char, text: &LitStr, inputs: &Ident) -> TokenStream {
    let what = kind.name();
    let inputs = Ident::new(&inputs.to_string(), inputs.span().located_at(text.span()));
    let binds = quote!(#inputs.binds(#kind, #letter));
    asserted(text, &binds, &format!("no input has the {what} letter `{letter}`, so it is not defined"))
}

/// Checks the units, and what the type of a port decides: which arguments it takes.
pub(crate) fn checks(ports: &[Port]) -> TokenStream {
    let units =
        ports.iter().flat_map(|port| port.arguments.iter().filter(|(name, _)| *name == "unit")).map(|(_, text)| {
            let message =
                format!("`{}` is not the unit of a port: write a unit such as `m/s`, `_` (any), `_/s` (any per second), or a capital letter", text.value());
            asserted(text, &quote!(::tactflow_runtime::signal::Unit::is_port_unit(#text)), &message)
        });
    let concrete = ports.iter().filter(|port| !port.is_generic).flat_map(arguments);
    let arguments = concrete.map(|(at, condition, message)| asserted(&at, &condition, &message));
    units.chain(arguments).collect()
}

/// The same for a port whose kind a type parameter decides, checked for each type that a graph can use. An argument
/// that only some of them have is ignored by the others.
pub(crate) fn generic_checks(ports: &[Port]) -> TokenStream {
    let generic = ports.iter().filter(|port| port.is_generic).flat_map(arguments);
    let checks = generic.map(|(at, condition, message)| {
        let assertion = assertion(&at, &condition, &message);
        quote!(const { #assertion };)
    });
    checks.collect()
}

/// For each argument of a port: where a mistake is marked, what must hold, and what it means if it does not.
fn arguments(port: &Port) -> impl Iterator<Item = (TokenStream, TokenStream, String)> {
    let (signal, name) = (&port.signal, &port.name);
    ARGUMENTS.into_iter().filter(|_| port.is_complete).map(move |argument| {
        let takes = quote!(::tactflow_runtime::signal::Kind::takes(
            <#signal as ::tactflow_runtime::signal::Signal>::KIND, #argument));
        match port.arguments.iter().find(|(name, _)| *name == argument) {
            Some((_, text)) => {
                let is_generic = port.is_generic;
                (
                    quote!(#text),
                    quote!(#is_generic || #takes),
                    format!("the kind of `{name}` has no `{argument}`: remove it"),
                )
            }
            None => {
                let message = format!("`{name}` needs `#[port({argument} = \"…\")]`; `\"_\"` if there is none");
                (port.field.ty.to_token_stream(), quote!(!#takes), message)
            }
        }
    })
}
