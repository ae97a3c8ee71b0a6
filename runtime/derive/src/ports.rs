//! `#[derive(Inputs)]` and `#[derive(Outputs)]`.

use proc_macro2::{Span, TokenStream};
use quote::{quote, quote_spanned};
use syn::spanned::Spanned;
use syn::{DeriveInput, GenericParam, Generics, Ident, Lifetime, Type};

use crate::attributes::{Words, beside};
use crate::checks::{bound, checks, generic_checks, inputs_beside, letters};
use crate::docs::text;
use crate::fault::Faults;
use crate::port::{Form, Port, ports};

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

            #[inline(always)]
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
    let words = Words::new(&input.attrs, "port", &["inputs"], &mut faults);
    let (ports, inputs) = (ports(input, false, &mut faults), inputs_beside(words, &mut faults));
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

            #[inline(always)]
            fn take(
                bus: &mut ::tactflow_runtime::node::Bus,
                ports: &[::tactflow_runtime::node::PortId],
                tick: &::tactflow_runtime::node::Tick,
            ) -> Self {
                Self { #(#taken),* }
            }

            #[inline(always)]
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
    let must_be_known = port.must_be_known;
    let need = match port.form {
        Form::Out => quote!(::tactflow_runtime::node::Need::REQUIRED),
        _ => quote! {
            ::tactflow_runtime::node::Need {
                must_be_wired: #must_be_wired,
                must_be_present: #must_be_present,
                is_trigger: #is_trigger,
                is_many: #is_many,
                is_delayed: #is_delayed,
                must_be_known: #must_be_known,
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
