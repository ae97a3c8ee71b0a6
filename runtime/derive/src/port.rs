//! Reads the fields of a set of inputs or outputs.

use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use syn::{DeriveInput, Field, GenericArgument, Ident, LitStr, PathArguments, Type};

use crate::attributes::{Words, is_snake_case, list};
use crate::docs::text;
use crate::fault::Faults;

/// The arguments of ports, and what each says.
pub(crate) const ARGUMENTS: [&str; 4] = ["unit", "frame", "reference", "robot"];
/// The argument that every port may have.
pub(crate) const QUANTITY: &str = "quantity";
const INPUT_WORDS: &[&str] =
    &["unit", "frame", "reference", "robot", QUANTITY, "known", "optional", "present_if_wired", "sampled", "delayed"];
const OUTPUT_WORDS: &[&str] = &["unit", "frame", "reference", "robot", QUANTITY];
const INPUT_FORMS: &str = "an input is `In<'a, T>`, `Option<In<'a, T>>` or `Many<'a, T>`, where `T` is a signal";

/// The closed set of signals, and the types that the first two stand for.
const SIGNALS: [&str; 13] = [
    "Scalar",
    "Flag",
    "Features",
    "Image",
    "VectorImage",
    "Mask",
    "Regions",
    "Twist",
    "Pose",
    "Joints",
    "Jacobian",
    "f64",
    "bool",
];

/// How a port is declared.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    In,
    OptionIn,
    Many,
    Out,
}

/// One field.
pub(crate) struct Port {
    pub(crate) field: Field,
    pub(crate) name: Ident,
    pub(crate) form: Form,
    /// The type of its signal.
    pub(crate) signal: Type,
    /// Whether a type parameter decides the kind.
    pub(crate) is_generic: bool,
    pub(crate) arguments: Vec<(&'static str, LitStr)>,
    /// Whether all arguments could be read.
    pub(crate) is_complete: bool,
    pub(crate) is_optional: bool,
    pub(crate) is_present_if_wired: bool,
    pub(crate) is_sampled: bool,
    pub(crate) is_delayed: bool,
    pub(crate) must_be_known: bool,
}

/// Reads the fields.
pub(crate) fn ports(input: &DeriveInput, is_input: bool, faults: &mut Faults) -> Vec<Port> {
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
    let arguments: Vec<_> = ARGUMENTS.into_iter().chain([QUANTITY]).filter_map(argument).collect();
    let flag = |word: &str, words: &mut Words, faults: &mut Faults| {
        if is_input { words.flag(word, faults) } else { None }
    };
    let [optional, present_if_wired, sampled, delayed, known] =
        ["optional", "present_if_wired", "sampled", "delayed", "known"].map(|word| flag(word, &mut words, faults));
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
    if let Some(word) = known.as_ref().filter(|_| !arguments.iter().any(|(name, _)| *name == QUANTITY)) {
        faults.add(word, "`known` needs the quantity that the input accepts: add `quantity = \"…\"`");
    }
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
        must_be_known: known.is_some(),
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
    match name {
        "unit" => {}
        QUANTITY => quantity_is_sound(text, faults),
        _ => frame_is_sound(name, text, all, faults),
    }
}

fn is_frame(argument: &str) -> bool {
    !matches!(argument, "unit" | QUANTITY)
}

fn quantity_is_sound(text: &LitStr, faults: &mut Faults) {
    let value = text.value();
    if !(is_snake_case(&value) || is_letter(&value) || value == "$wire") {
        faults.add(text, "a quantity is a name in snake_case, a capital letter, or `$wire` for the name of the wire");
    }
}

fn frame_is_sound(name: &str, text: &LitStr, all: &[(&'static str, LitStr)], faults: &mut Faults) {
    let value = text.value();
    // The frame `base` of a robot is `R.base`.
    let (whole, part) = value.split_once('.').unwrap_or((&value, "part"));
    let plain = whole.strip_prefix('$').unwrap_or(whole);
    let is_name = !plain.is_empty() && plain.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let is_lowercase = !plain.starts_with(|c: char| c.is_ascii_uppercase());
    if !is_name || !is_snake_case(part) || !(is_lowercase || is_letter(whole)) {
        let message = "a frame is a capital letter, `_` for none, `self`, `$` with the name of a parameter, or a name; \
                       `.` with a name is a part of it, as in `R.base`";
        faults.add(text, message);
    }
    if name == "frame" && value == "_" && all.iter().any(|(name, text)| is_frame(name) && text.value() != "_") {
        faults.add(text, "a `reference` needs a `frame`: name the frame, or write `\"_\"` for both");
    }
}

/// Whether a text is a capital letter, which is a variable.
pub(crate) fn is_letter(text: &str) -> bool {
    text.len() == 1 && text.starts_with(|c: char| c.is_ascii_uppercase())
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
