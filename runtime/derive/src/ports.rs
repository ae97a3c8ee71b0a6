//! `#[derive(Inputs)]` and `#[derive(Outputs)]`.

use proc_macro2::{Span, TokenStream, TokenTree};
use quote::{ToTokens, quote, quote_spanned};
use syn::spanned::Spanned;
use syn::{
    Attribute, DeriveInput, Field, GenericArgument, GenericParam, Generics, Ident, Lifetime, LitStr, PathArguments,
    Type,
};

use crate::attributes::{Words, beside, list};
use crate::docs::text;
use crate::fault::{Faults, asserted, assertion};

/// The arguments of ports, and what each says.
const ARGUMENTS: [&str; 4] = ["unit", "frame", "reference", "robot"];
const INPUT_WORDS: &[&str] =
    &["unit", "frame", "reference", "robot", "optional", "present_if_wired", "sampled", "delayed"];
const OUTPUT_WORDS: &[&str] = &["unit", "frame", "reference", "robot"];
const INPUT_FORMS: &str = "an input is `In<'a, T>`, `Option<In<'a, T>>` or `Many<'a, T>`, where `T` is a signal";

/// The closed set of signals, and the types that the first two stand for.
const SIGNALS: [&str; 12] =
    ["Scalar", "Flag", "Features", "Image", "Mask", "Regions", "Twist", "Pose", "Joints", "Jacobian", "f64", "bool"];

/// How a port is declared.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    In,
    OptionIn,
    Many,
    Out,
}

/// One field.
struct Port {
    field: Field,
    name: Ident,
    form: Form,
    /// The type of its signal.
    signal: Type,
    /// Whether a type parameter decides the kind.
    is_generic: bool,
    arguments: Vec<(&'static str, LitStr)>,
    /// Whether all arguments could be read.
    is_complete: bool,
    is_optional: bool,
    is_present_if_wired: bool,
    is_sampled: bool,
    is_delayed: bool,
}

pub(crate) fn inputs(input: &DeriveInput) -> TokenStream {
    let mut faults = Faults::default();
    let ports = ports(input, true, &mut faults);
    let (name, shapes) = (&input.ident, shapes(input, &ports));
    let lifetime = input.generics.lifetimes().next().map(|parameter| parameter.lifetime.clone());
    let mut generics = input.generics.clone();
    let lifetime = lifetime.unwrap_or_else(|| {
        let lifetime = Lifetime::new("'tactflow", Span::call_site());
        generics.params.insert(0, GenericParam::Lifetime(syn::LifetimeParam::new(lifetime.clone())));
        lifetime
    });
    let (head, _, bounds) = generics.split_for_impl();
    let (_, arguments, _) = input.generics.split_for_impl();
    let plain = without_lifetimes(&input.generics);
    let (_, shape_arguments, _) = plain.split_for_impl();
    let shapes_name = beside(name, "Shapes");
    let specs = ports.iter().map(spec);
    let shapes_of = ports.iter().map(|port| {
        let (name, view) = (&port.name, view(port, &lifetime));
        quote_spanned!(port.signal.span()=> #name: #view::shape(wires.next().unwrap_or_default()))
    });
    let fetched = ports.iter().enumerate().map(|(i, port)| {
        let (name, view) = (&port.name, view(port, &lifetime));
        let tick = if port.is_delayed { quote!(tick.wrapping_sub(1)) } else { quote!(tick) };
        quote_spanned!(port.signal.span()=> #name: #view::fetch(bus, wires, #i, #tick))
    });
    let (letters, checks, generic_checks) = (letters(input, &ports), checks(&ports), generic_checks(&ports));
    faults.with(quote! {
        #checks
        #shapes
        #letters

        #[automatically_derived]
        impl #head ::tactflow_runtime::node::InputSet<#lifetime> for #name #arguments #bounds {
            type Shapes = #shapes_name #shape_arguments;

            fn specs() -> ::std::vec::Vec<::tactflow_runtime::node::PortSpec> {
                #generic_checks
                ::std::vec![#(#specs),*]
            }

            fn shapes(
                wires: ::std::vec::Vec<::std::vec::Vec<(::std::string::String, ::tactflow_runtime::signal::Shape)>>,
            ) -> Self::Shapes {
                let mut wires = wires.into_iter();
                #shapes_name { #(#shapes_of),* }
            }

            #[inline]
            fn fetch(
                bus: &#lifetime ::tactflow_runtime::node::Bus,
                wires: &#lifetime ::tactflow_runtime::node::Wires,
                tick: u64,
            ) -> Self {
                Self { #(#fetched),* }
            }
        }
    })
}

pub(crate) fn outputs(input: &DeriveInput) -> TokenStream {
    let mut faults = Faults::default();
    let (ports, inputs) = (ports(input, false, &mut faults), inputs_beside(&input.attrs, "port", &mut faults));
    let (name, shapes, shapes_name) = (&input.ident, shapes(input, &ports), beside(&input.ident, "Shapes"));
    let (head, arguments, bounds) = input.generics.split_for_impl();
    let (names, specs) = (names(&ports), ports.iter().map(spec));
    let each = |step: fn(&Ident, &Type, usize, Span) -> TokenStream| -> Vec<TokenStream> {
        let numbered = ports.iter().enumerate();
        numbered.map(|(i, port)| step(&port.name, &port.signal, i, port.signal.span())).collect()
    };
    let taken = each(
        |name, signal, i, span| quote_spanned!(span=> #name: ::tactflow_runtime::node::Out::<#signal>::take(bus, ports[#i], tick)),
    );
    let put = each(
        |name, signal, i, span| quote_spanned!(span=> ::tactflow_runtime::node::Out::<#signal>::put(self.#name, bus, ports[#i], tick);),
    );
    let lost = each(
        |_, signal, i, span| quote_spanned!(span=> ::tactflow_runtime::node::Out::<#signal>::lose_port(bus, ports[#i], tick);),
    );
    let (bound, checks, generic_checks) = (bound(&ports, &inputs), checks(&ports), generic_checks(&ports));
    faults.with(quote! {
        #checks
        #bound
        #shapes

        #[automatically_derived]
        impl #head ::tactflow_runtime::node::OutputSet for #name #arguments #bounds {
            type Shapes = #shapes_name #arguments;

            fn specs() -> ::std::vec::Vec<::tactflow_runtime::node::PortSpec> {
                #generic_checks
                ::std::vec![#(#specs),*]
            }

            fn into_shapes(shapes: Self::Shapes) -> ::std::vec::Vec<::tactflow_runtime::signal::Shape> {
                ::std::vec![#(::core::convert::Into::into(shapes.#names)),*]
            }

            #[inline]
            fn take(
                bus: &mut ::tactflow_runtime::node::Bus,
                ports: &[::tactflow_runtime::node::PortId],
                tick: &::tactflow_runtime::node::Tick,
            ) -> Self {
                Self { #(#taken),* }
            }

            #[inline]
            fn put(
                self,
                bus: &mut ::tactflow_runtime::node::Bus,
                ports: &[::tactflow_runtime::node::PortId],
                tick: &::tactflow_runtime::node::Tick,
            ) {
                #(#put)*
            }

            fn lose(
                bus: &mut ::tactflow_runtime::node::Bus,
                ports: &[::tactflow_runtime::node::PortId],
                tick: u64,
            ) {
                #(#lost)*
            }
        }
    })
}

fn names(ports: &[Port]) -> Vec<&Ident> {
    ports.iter().map(|port| &port.name).collect()
}

/// Reads the fields.
fn ports(input: &DeriveInput, is_input: bool, faults: &mut Faults) -> Vec<Port> {
    let what = if is_input { "a set of inputs" } else { "a set of outputs" };
    let fields = faults.fields(input, what);
    let type_parameters: Vec<&Ident> = input.generics.type_params().map(|parameter| &parameter.ident).collect();
    fields.into_iter().filter_map(|field| port(field, is_input, &type_parameters, faults)).collect()
}

fn port(field: Field, is_input: bool, type_parameters: &[&Ident], faults: &mut Faults) -> Option<Port> {
    let name = field.ident.clone()?;
    if text(&field.attrs).is_empty() {
        faults.add(&name, format!("`{name}` needs a doc comment: what it carries"));
    }
    let known = if is_input { INPUT_WORDS } else { OUTPUT_WORDS };
    let mut words = Words::new(&field.attrs, "port", known, faults);
    let argument = |name: &'static str| Some((name, words.text(name, faults)?));
    let arguments: Vec<_> = ARGUMENTS.into_iter().filter_map(argument).collect();
    let flag = |word: &str, words: &mut Words, faults: &mut Faults| {
        if is_input { words.flag(word, faults) } else { None }
    };
    let [optional, present_if_wired, sampled, delayed] =
        ["optional", "present_if_wired", "sampled", "delayed"].map(|word| flag(word, &mut words, faults));
    let Some((form, signal)) = form(&field.ty).filter(|(form, _)| (*form == Form::Out) != is_input) else {
        let expected = if is_input { INPUT_FORMS } else { "an output is `Out<T>`, where `T` is a signal" };
        faults.fatal(&field.ty, expected);
        return None;
    };
    if !is_signal(&signal, type_parameters) {
        let signals = list(&SIGNALS[..SIGNALS.len() - 2]);
        faults.fatal(
            &signal,
            format!(
                "`{}` is not a signal; signals are {signals}",
                signal.to_token_stream().to_string().replace(' ', "")
            ),
        );
        return None;
    }
    combination(form, [&optional, &present_if_wired, &sampled, &delayed], faults);
    arguments.iter().for_each(|(name, text)| argument_is_sound(name, text, &arguments, faults));
    Some(Port {
        is_generic: mentions(&signal.to_token_stream(), type_parameters),
        name,
        form,
        signal,
        arguments,
        is_complete: words.are_complete,
        is_optional: optional.is_some(),
        is_present_if_wired: present_if_wired.is_some(),
        is_sampled: sampled.is_some(),
        is_delayed: delayed.is_some(),
        field,
    })
}

/// Refuses words that make no sense together.
fn combination(form: Form, words: [&Option<Ident>; 4], faults: &mut Faults) {
    let [optional, present_if_wired, sampled, delayed] = words;
    let mut refuse = |word: &Option<Ident>, message: &str| {
        if let Some(word) = word {
            faults.add(word, message);
        }
    };
    match form {
        Form::In => {
            let message = "without a wire there is no value: write `Option<In<'a, T>>`";
            refuse(optional, message);
            refuse(present_if_wired, message);
            refuse(delayed, "in the first tick there is no value yet: write `Option<In<'a, T>>`");
        }
        Form::Many => {
            refuse(optional, "`Many` already allows no wire: remove `optional`");
            refuse(present_if_wired, "each wire of `Many` may be absent: leave `present_if_wired` out");
            refuse(delayed, "`delayed` is for a single wire: write `Option<In<'a, T>>`");
        }
        Form::OptionIn => {
            if optional.is_some() {
                refuse(present_if_wired, "`present_if_wired` already makes the wire optional: remove `optional`");
            }
            if delayed.is_some() {
                refuse(present_if_wired, "in the first tick a delayed input is absent: leave `present_if_wired` out");
                refuse(sampled, "a delayed input wakes the node only if no other input does: leave `sampled` out");
            }
        }
        Form::Out => {}
    }
}

/// Checks what needs no type: the frames, and two that only make sense together.
fn argument_is_sound(name: &str, text: &LitStr, all: &[(&'static str, LitStr)], faults: &mut Faults) {
    let value = text.value();
    if name == "unit" {
        return;
    }
    let plain = value.strip_prefix('$').unwrap_or(&value);
    let is_name = !plain.is_empty() && plain.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let is_letter = plain.len() == 1 && !value.starts_with('$');
    if !is_name || (plain.starts_with(|c: char| c.is_ascii_uppercase()) && !is_letter) {
        let message = "a frame is a capital letter, `_` for none, `self`, `$` with the name of a parameter, or a name";
        faults.add(text, message);
    }
    if name == "frame" && value == "_" && all.iter().any(|(name, text)| *name != "unit" && text.value() != "_") {
        faults.add(text, "a `reference` needs a `frame`: name the frame, or write `\"_\"` for both");
    }
}

/// How the type of a field declares a port, and the type of its signal.
fn form(ty: &Type) -> Option<(Form, Type)> {
    let (name, inner) = last_segment(ty)?;
    match name.as_str() {
        "In" => Some((Form::In, inner)),
        "Many" => Some((Form::Many, inner)),
        "Out" => Some((Form::Out, inner)),
        "Option" => form(&inner).filter(|(form, _)| *form == Form::In).map(|(_, signal)| (Form::OptionIn, signal)),
        _ => None,
    }
}

/// Whether a type is a signal, as far as its name shows. The compiler would say the same once for each use that the
/// generated code makes of it.
fn is_signal(ty: &Type, type_parameters: &[&Ident]) -> bool {
    let name = match ty {
        Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()),
        _ => None,
    };
    name.is_some_and(|name| SIGNALS.contains(&name.as_str())) || mentions(&ty.to_token_stream(), type_parameters)
}

/// The name of a generic type and its last type argument.
fn last_segment(ty: &Type) -> Option<(String, Type)> {
    let Type::Path(path) = ty else { return None };
    let segment = path.path.segments.last()?;
    let PathArguments::AngleBracketed(arguments) = &segment.arguments else { return None };
    let types = arguments.args.iter().filter_map(|argument| match argument {
        GenericArgument::Type(ty) => Some(ty.clone()),
        _ => None,
    });
    Some((segment.ident.to_string(), types.last()?))
}

/// Whether one of the names stands in the code.
fn mentions(code: &TokenStream, names: &[&Ident]) -> bool {
    code.clone().into_iter().any(|token| match token {
        TokenTree::Ident(ident) => names.iter().any(|name| **name == ident),
        TokenTree::Group(group) => mentions(&group.stream(), names),
        _ => false,
    })
}

/// The view of an input, for a call of one of its functions.
fn view(port: &Port, lifetime: &Lifetime) -> TokenStream {
    let (signal, span) = (&port.signal, port.signal.span());
    let view = match port.form {
        Form::In | Form::Out => quote_spanned!(span=> ::tactflow_runtime::node::In<#lifetime, #signal>),
        Form::OptionIn => {
            quote_spanned!(span=> ::core::option::Option<::tactflow_runtime::node::In<#lifetime, #signal>>)
        }
        Form::Many => quote_spanned!(span=> ::tactflow_runtime::node::Many<#lifetime, #signal>),
    };
    quote_spanned!(span=> <#view as ::tactflow_runtime::node::View<#lifetime>>)
}

/// The declaration as data.
fn spec(port: &Port) -> TokenStream {
    let (name, doc, signal) = (port.name.to_string(), text(&port.field.attrs), &port.signal);
    let arguments = port.arguments.iter().map(|(name, text)| quote!((#name, #text)));
    let must_be_wired =
        matches!(port.form, Form::In | Form::OptionIn) && !port.is_optional && !port.is_present_if_wired;
    let must_be_present = port.form == Form::In || port.is_present_if_wired;
    let (is_trigger, is_many, is_delayed) = (!port.is_sampled, port.form == Form::Many, port.is_delayed);
    let need = match port.form {
        Form::Out => quote!(::tactflow_runtime::node::Need::REQUIRED),
        _ => quote! {
            ::tactflow_runtime::node::Need {
                must_be_wired: #must_be_wired,
                must_be_present: #must_be_present,
                is_trigger: #is_trigger,
                is_many: #is_many,
                is_delayed: #is_delayed,
            }
        },
    };
    quote_spanned!(signal.span()=>
        ::tactflow_runtime::node::PortSpec::of::<#signal>(#name, #doc, &[#(#arguments),*], #need))
}

fn without_lifetimes(generics: &Generics) -> Generics {
    let mut generics = generics.clone();
    generics.params = generics.params.into_iter().filter(|p| !matches!(p, GenericParam::Lifetime(_))).collect();
    generics
}

/// The struct of the shapes.
fn shapes(input: &DeriveInput, ports: &[Port]) -> TokenStream {
    let (name, vis, generics) = (beside(&input.ident, "Shapes"), &input.vis, without_lifetimes(&input.generics));
    let (doc, bounds) = (format!("Shapes of the ports of `{}`.", input.ident), &generics.where_clause);
    let fields = ports.iter().map(|port| {
        let (name, vis, doc, signal) = (&port.name, &port.field.vis, text(&port.field.attrs), &port.signal);
        let shape = quote_spanned!(signal.span()=> <#signal as ::tactflow_runtime::signal::Signal>::Shape);
        let shape = match port.form {
            Form::In | Form::Out => shape,
            Form::OptionIn => quote!(::core::option::Option<#shape>),
            Form::Many => quote!(::std::vec::Vec<(::std::string::String, #shape)>),
        };
        quote!(#[doc = #doc] #vis #name: #shape)
    });
    // A derived `Default` would ask `Default` of the signal's type and not of its shape.
    let default = ports.iter().any(|port| port.form == Form::Out).then(|| {
        let ((head, arguments, _), names) = (generics.split_for_impl(), names(ports));
        quote! {
            impl #head ::core::default::Default for #name #arguments #bounds {
                fn default() -> Self {
                    Self { #(#names: ::core::default::Default::default()),* }
                }
            }
        }
    });
    quote! {
        #[doc = #doc]
        #[allow(dead_code, unreachable_pub, reason = "the shape of a port may not matter, and a node's module may be private")]
        #vis struct #name #generics #bounds { #(#fields),* }
        #default
    }
}

/// The letters that a port binds, or uses: of its unit and of its frames, each with its place.
fn letters_of(port: &Port) -> impl Iterator<Item = (bool, char, &LitStr)> {
    port.arguments.iter().filter_map(|(name, text)| {
        let value = text.value();
        let letter = value.chars().next().filter(char::is_ascii_uppercase)?;
        let is_unit = *name == "unit";
        let is_letter = if is_unit { is_unit_letter(&value) } else { value.len() == 1 };
        is_letter.then_some((is_unit, letter, text))
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
fn letters(input: &DeriveInput, ports: &[Port]) -> TokenStream {
    let (name, vis) = (&input.ident, &input.vis);
    let of = |units: bool| -> String {
        ports
            .iter()
            .flat_map(letters_of)
            .filter(|(is_unit, ..)| *is_unit == units)
            .map(|(_, letter, _)| letter)
            .collect()
    };
    let (units, frames) = (of(true), of(false));
    let has = |port: &Port, argument: &str| port.arguments.iter().any(|(name, _)| *name == argument);
    let says_all = |port: &Port| port.is_complete && (!port.is_generic || has(port, "unit") && has(port, "frame"));
    let is_complete = ports.iter().all(says_all);
    let conditions =
        ports.iter().filter(|port| !port.is_generic).flat_map(arguments).map(|(_, condition, _)| condition);
    quote! {
        #[doc(hidden)]
        #[allow(non_upper_case_globals, dead_code, unreachable_pub, reason = "it goes with the struct of that name")]
        #vis const #name: ::tactflow_runtime::node::Letters = ::tactflow_runtime::node::Letters::of(#units, #frames, #is_complete #(&& #conditions)*);
    }
}

/// The struct of the inputs whose letters count: `Inputs`, or what `inputs = "…"` names.
pub(crate) fn inputs_beside(attributes: &[Attribute], attribute: &str, faults: &mut Faults) -> Ident {
    let named = Words::new(attributes, attribute, &["inputs"], faults).text("inputs", faults);
    named.and_then(|name| faults.take(name.parse())).unwrap_or_else(|| Ident::new("Inputs", Span::call_site()))
}

/// Checks that an input binds each letter of an output.
fn bound(ports: &[Port], inputs: &Ident) -> TokenStream {
    ports
        .iter()
        .flat_map(letters_of)
        .map(|(is_unit, letter, text)| bound_letter(is_unit, letter, text, inputs))
        .collect()
}

/// Checks that the struct `inputs` binds a letter.
pub(crate) fn bound_letter(is_unit: bool, letter: char, text: &LitStr, inputs: &Ident) -> TokenStream {
    let what = if is_unit { "unit" } else { "frame" };
    let inputs = Ident::new(&inputs.to_string(), inputs.span().located_at(text.span()));
    let binds = quote!(#inputs.binds(#is_unit, #letter));
    asserted(text, &binds, &format!("no input has the {what} letter `{letter}`, so it is not defined"))
}

/// Checks the units, and what the type of a port decides: which arguments it takes.
fn checks(ports: &[Port]) -> TokenStream {
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
fn generic_checks(ports: &[Port]) -> TokenStream {
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
