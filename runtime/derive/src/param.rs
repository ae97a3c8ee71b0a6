//! `#[derive(Param)]`.

use proc_macro2::TokenStream;
use quote::{quote, quote_spanned};
use syn::spanned::Spanned;
use syn::{
    Data, DataEnum, DeriveInput, Expr, ExprLit, ExprRange, Field, Ident, Lit, LitStr, RangeLimits, Type, Variant,
};

use crate::attributes::{Words, snake_case};
use crate::checks::{LetterKind, bound_letter, inputs_beside, is_unit_letter};
use crate::docs::text;
use crate::fault::{Faults, asserted};

const KNOWN: &[&str] = &["unit", "range", "above", "usual", "default", "live", "tunable", "from_bench", "flatten"];
const KNOWN_OF_TABLE: &[&str] = &["inputs", "default"];

/// One field of a table of parameters.
struct Parameter {
    field: Field,
    name: Ident,
    unit: Option<LitStr>,
    bounds: Option<TokenStream>,
    /// What stands in the attribute for the bounds: where a mistake is marked.
    bounds_at: Option<Expr>,
    /// The usual numbers, and the expression for them.
    usual: Option<(Expr, TokenStream)>,
    default: Option<Expr>,
    is_live: bool,
    is_tunable: bool,
    is_from_bench: bool,
    /// Whether it is a table whose fields are fields of the table around it.
    is_flat: bool,
}

pub(crate) fn derive(input: &DeriveInput) -> TokenStream {
    let mut faults = Faults::default();
    let implementation = match &input.data {
        Data::Enum(data) => words(input, data, &mut faults),
        _ => table(input, &mut faults),
    };
    faults.with(implementation)
}

fn table(input: &DeriveInput, faults: &mut Faults) -> TokenStream {
    let fields = faults.fields(input, "a table of parameters");
    let parameters: Vec<Parameter> = fields.into_iter().filter_map(|field| parameter(field, faults)).collect();
    let (ident, (generics, arguments, bounds)) = (&input.ident, input.generics.split_for_impl());
    let idents: Vec<&Ident> = parameters.iter().map(|parameter| &parameter.name).collect();
    let (flat, own): (Vec<&Parameter>, Vec<&Parameter>) = parameters.iter().partition(|parameter| parameter.is_flat);
    let names: Vec<String> = own.iter().map(|parameter| parameter.name.to_string()).collect();
    let (flat_idents, flat_types): (Vec<_>, Vec<_>) =
        flat.iter().map(|parameter| (&parameter.name, &parameter.field.ty)).unzip();
    let specs = parameters.iter().map(spec);
    let reads = parameters.iter().map(read);
    let written = own.iter().map(|parameter| {
        let (ty, ident, name) = (&parameter.field.ty, &parameter.name, parameter.name.to_string());
        quote_spanned!(ty.span()=> (#name, <#ty as ::tactflow_runtime::node::Param>::written(&self.#ident)))
    });
    let mut words = Words::new(&input.attrs, "param", KNOWN_OF_TABLE, faults);
    let defaults = words.flag("default", faults).map(|_| defaults(ident, &parameters, faults));
    let inputs = inputs_beside(words, faults);
    let checks: TokenStream = parameters.iter().map(|parameter| checks(parameter, input, &inputs)).collect();
    quote! {
        #checks
        #defaults

        #[automatically_derived]
        impl #generics ::tactflow_runtime::node::Param for #ident #arguments #bounds {
            const EXPECTS: &'static str = "a table";

            const CONTENTS: ::tactflow_runtime::node::Contents = ::tactflow_runtime::node::Contents {
                fields: || {
                    let specs: &[::std::vec::Vec<::tactflow_runtime::node::ParamSpec>] = &[#(#specs),*];
                    specs.concat()
                },
                ..::tactflow_runtime::node::Contents::OPAQUE
            };

            fn written(&self) -> ::core::option::Option<::tactflow_runtime::node::Written> {
                ::tactflow_runtime::node::written_table(
                    [#(#written),*],
                    [#(<#flat_types as ::tactflow_runtime::node::Param>::written(&self.#flat_idents)),*],
                )
            }

            fn read(
                value: &::tactflow_runtime::source::Value,
                reader: &mut ::tactflow_runtime::node::Reader<'_>,
            ) -> ::core::option::Option<Self> {
                reader.fields(value)
            }
        }

        #[automatically_derived]
        impl #generics ::tactflow_runtime::node::ParamTable for #ident #arguments #bounds {
            fn names() -> ::std::vec::Vec<&'static str> {
                let flat: &[::std::vec::Vec<&'static str>] =
                    &[#(<#flat_types as ::tactflow_runtime::node::ParamTable>::names()),*];
                [::std::vec![#(#names),*], flat.concat()].concat()
            }

            fn read_fields(
                table: &mut ::tactflow_runtime::node::OpenTable,
                reader: &mut ::tactflow_runtime::node::Reader<'_>,
            ) -> ::core::option::Option<Self> {
                #(#reads)*
                ::core::option::Option::Some(Self { #(#idents: #idents?),* })
            }
        }
    }
}

/// The descriptions of a field: its own, or those of the fields of a flat table.
fn spec(parameter: &Parameter) -> TokenStream {
    let (ty, declared, default) = (&parameter.field.ty, declared(parameter), default(parameter));
    match parameter.is_flat {
        true => quote_spanned!(ty.span()=> <#ty as ::tactflow_runtime::node::Param>::fields()),
        false => quote_spanned! {
            ty.span()=> ::std::vec![::tactflow_runtime::node::ParamSpec::of::<#ty>(&#declared, #default)]
        },
    }
}

fn read(parameter: &Parameter) -> TokenStream {
    let (ty, name, declared, default) = (&parameter.field.ty, &parameter.name, declared(parameter), default(parameter));
    match parameter.is_flat {
        true => quote_spanned! {
            ty.span()=> let #name = <#ty as ::tactflow_runtime::node::ParamTable>::read_fields(table, reader);
        },
        false => quote_spanned!(ty.span()=> let #name = reader.field::<#ty>(table, &#declared, #default);),
    }
}

/// Implements `Default` from the defaults of the fields.
fn defaults(ident: &Ident, parameters: &[Parameter], faults: &mut Faults) -> TokenStream {
    let values = parameters.iter().map(|parameter| {
        let Parameter { field, name, is_flat, .. } = parameter;
        let value = default_value(parameter);
        if value.is_none() && !is_flat && !is_called(&field.ty, "Option") {
            faults.add(name, format!("`{name}` needs a `default`, because the table has one"));
        }
        let value = value.unwrap_or_else(|| quote_spanned!(name.span()=> ::core::default::Default::default()));
        quote!(#name: #value)
    });
    let values: Vec<TokenStream> = values.collect();
    quote! {
        #[automatically_derived]
        impl ::core::default::Default for #ident {
            fn default() -> Self {
                Self { #(#values),* }
            }
        }
    }
}

fn parameter(field: Field, faults: &mut Faults) -> Option<Parameter> {
    let name = field.ident.clone()?;
    let mut words = Words::new(&field.attrs, "param", KNOWN, faults);
    let flat = words.flag("flatten", faults);
    let is_flat = flat.is_some();
    if let Some(flat) = flat.filter(|_| !words.are_all_taken()) {
        faults.add(flat, "`flatten` stands alone: the fields of the table have attributes of their own");
    }
    if text(&field.attrs).is_empty() && !is_flat {
        faults.add(&name, format!("`{name}` needs a doc comment: what it means"));
    }
    let (unit, is_live) = (words.text("unit", faults), words.flag("live", faults).is_some());
    let tunable = words.flag("tunable", faults);
    if let Some(tunable) = tunable.as_ref().filter(|_| !is_live) {
        faults.add(tunable, "`tunable` needs `live`: what changes while the graph runs can differ between modes");
    }
    let is_tunable = tunable.is_some();
    let is_from_bench = words.flag("from_bench", faults).is_some();
    let (range, above) = (words.value("range", faults), words.value("above", faults));
    let usual = words.value("usual", faults);
    let usual = usual.and_then(|(_, usual)| between(&usual, faults).map(|bounds| (usual, bounds)));
    let default = words.value("default", faults).map(|(_, value)| value);
    if let (Some(_), Some((above, _))) = (&range, &above) {
        faults.add(above, "`range` and `above` exclude each other");
    }
    let bounds = match (&range, &above) {
        (Some((_, range)), _) => between(range, faults),
        (None, Some((_, above))) => Some(quote!(::tactflow_runtime::node::Bounds::above((#above) as f64))),
        (None, None) => None,
    };
    let bounds_at = range.or(above).map(|(_, value)| value);
    Some(Parameter {
        field,
        name,
        unit,
        bounds,
        bounds_at,
        usual,
        default,
        is_live,
        is_tunable,
        is_from_bench,
        is_flat,
    })
}

/// The bounds that a range such as `0.0..=1.0` or `0.0..` says.
fn between(range: &Expr, faults: &mut Faults) -> Option<TokenStream> {
    let message = "a range is `a..=b`, `a..` or `..=b`; to exclude the lower end, write `above = a` instead of `range`";
    let Expr::Range(ExprRange { start, end, limits, .. }) = range else {
        faults.add(range, message);
        return None;
    };
    if (start.is_none() && end.is_none()) || (end.is_some() && !matches!(limits, RangeLimits::Closed(_))) {
        faults.add(range, message);
        return None;
    }
    let start = start.as_ref().map_or(quote!(f64::NEG_INFINITY), |start| quote!((#start) as f64));
    let end = end.as_ref().map_or(quote!(f64::INFINITY), |end| quote!((#end) as f64));
    Some(quote!(::tactflow_runtime::node::Bounds::between(#start, #end)))
}

/// What is declared of a parameter beside its type and its default.
fn declared(parameter: &Parameter) -> TokenStream {
    let Parameter { is_live, is_tunable, is_from_bench, .. } = *parameter;
    let (name, doc) = (parameter.name.to_string(), text(&parameter.field.attrs));
    let unit = option(parameter.unit.as_ref().map(|unit| quote!(#unit)));
    let (bounds, usual) =
        (option(parameter.bounds.clone()), option(parameter.usual.as_ref().map(|(_, usual)| usual.clone())));
    quote! {
        ::tactflow_runtime::node::Declared {
            name: #name, doc: #doc, unit: #unit, bounds: #bounds, usual: #usual, is_live: #is_live,
            is_tunable: #is_tunable, is_from_bench: #is_from_bench,
        }
    }
}

fn option(value: Option<TokenStream>) -> TokenStream {
    value.map_or(quote!(::core::option::Option::None), |value| quote!(::core::option::Option::Some(#value)))
}

/// The default as a function, if there is one.
fn default(parameter: &Parameter) -> TokenStream {
    let ty = &parameter.field.ty;
    let place = parameter.default.as_ref().map_or_else(|| ty.span(), Spanned::span);
    option(default_value(parameter).map(|value| quote_spanned!(place=> (|| -> #ty { #value }) as fn() -> #ty)))
}

fn default_value(parameter: &Parameter) -> Option<TokenStream> {
    let default = parameter.default.as_ref()?;
    let is_text = matches!(default, Expr::Lit(ExprLit { lit: Lit::Str(_), .. }));
    Some(match is_text && is_called(&parameter.field.ty, "String") {
        true => quote!(::core::convert::Into::into(#default)),
        false => quote!(#default),
    })
}

fn is_called(ty: &Type, name: &str) -> bool {
    matches!(ty, Type::Path(path) if path.path.segments.last().is_some_and(|last| last.ident == name))
}

/// Checks what needs the type, the list of units or the inputs.
fn checks(parameter: &Parameter, input: &DeriveInput, inputs: &Ident) -> TokenStream {
    let (ty, name) = (&parameter.field.ty, &parameter.name);
    let is_concrete = input.generics.type_params().next().is_none();
    let bounds = parameter.bounds_at.as_ref().zip(parameter.bounds.as_ref());
    let usual = parameter.usual.as_ref().map(|(at, usual)| (at, usual));
    let bounds = bounds.into_iter().chain(usual).filter(|_| is_concrete).map(|(at, bounds)| {
        let is_number = quote!(<#ty as ::tactflow_runtime::node::Param>::CONTENTS.is_number);
        let is_number = asserted(at, &is_number, &format!("`{name}` is not a number: remove its range"));
        let is_possible = asserted(at, &quote!(!#bounds.is_empty()), "no number is in this range");
        quote!(#is_number #is_possible)
    });
    let bounds: TokenStream = bounds.collect();
    let unit = parameter.unit.as_ref().map(|unit| {
        let text = unit.value();
        let message = format!(
            "`{text}` is not the unit of a parameter: write a unit such as `m/s2` or `N s/m`, a capital letter of an input, `$` with the \
             name of a parameter, or several as `m/s, rad/s`"
        );
        let is_unit = quote!(::tactflow_runtime::signal::Unit::is_param_unit(#unit));
        let letters = text.split(['/', ' ', ',']).filter(|atom| is_unit_letter(atom)).filter_map(|atom| atom.chars().next());
        let letters = letters.map(|letter| bound_letter(LetterKind::Unit, letter, unit, inputs));
        letters.chain([asserted(unit, &is_unit, &message)]).collect::<TokenStream>()
    });
    quote! { #bounds #unit }
}

/// An enum without data: one of a few words.
fn words(input: &DeriveInput, data: &DataEnum, faults: &mut Faults) -> TokenStream {
    if data.variants.is_empty() {
        faults.fatal(&input.ident, "an enum of words needs at least one variant");
    }
    let mut word = |variant: &Variant| {
        if !variant.fields.is_empty() {
            faults
                .fatal(&variant.fields, "a variant of a parameter cannot have fields: graph files write it as a word");
        }
        let doc = text(&variant.attrs);
        if doc.is_empty() {
            faults.add(&variant.ident, format!("`{}` needs a doc comment: what it means", variant.ident));
        }
        (snake_case(&variant.ident.to_string()), doc)
    };
    let (words, docs): (Vec<String>, Vec<String>) = data.variants.iter().map(&mut word).unzip();
    for (i, variant) in data.variants.iter().enumerate() {
        if words[..i].contains(&words[i]) {
            faults.add(&variant.ident, format!("two variants are the word `{}`", words[i]));
        }
    }
    let quoted: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
    let expects = format!("one of {}", quoted.join(", "));
    let (ident, variants) = (&input.ident, data.variants.iter().map(|variant| &variant.ident));
    let variants: Vec<_> = variants.collect();
    quote! {
        #[automatically_derived]
        impl ::tactflow_runtime::node::Param for #ident {
            const EXPECTS: &'static str = #expects;
            const CONTENTS: ::tactflow_runtime::node::Contents = ::tactflow_runtime::node::Contents {
                words: &[#((#words, #docs)),*],
                ..::tactflow_runtime::node::Contents::OPAQUE
            };

            fn written(&self) -> ::core::option::Option<::tactflow_runtime::node::Written> {
                let word = match self { #(Self::#variants => #words),* };
                ::core::option::Option::Some(::core::convert::Into::into(word))
            }

            fn read(
                value: &::tactflow_runtime::source::Value,
                reader: &mut ::tactflow_runtime::node::Reader<'_>,
            ) -> ::core::option::Option<Self> {
                [#(Self::#variants),*].into_iter().nth(reader.word::<Self>(value)?)
            }
        }
    }
}
