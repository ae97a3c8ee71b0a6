//! The derives of the contract for nodes and devices. Authors use them through `tactflow_runtime::node`, which
//! documents them beside the traits that they implement.
//!
//! Every mistake is reported on the field or on the attribute that causes it. What a type decides (which arguments a
//! port takes, whether a unit exists) is a constant assertion in the generated code, with the span of the field.

mod attributes;
mod checks;
mod describe;
mod docs;
mod fault;
mod param;
mod port;
mod ports;
mod state;

use proc_macro::TokenStream;
use syn::{DeriveInput, parse_macro_input};

/// Implements `Describe`: the name, the summary, the documentation and the example of a node or a device.
#[proc_macro_derive(Describe, attributes(describe))]
pub fn derive_describe(input: TokenStream) -> TokenStream {
    describe::derive(&parse_macro_input!(input as DeriveInput)).into()
}

/// Implements `Param` for a struct (a table) or for an enum without data (one of a few words).
#[proc_macro_derive(Param, attributes(param))]
pub fn derive_param(input: TokenStream) -> TokenStream {
    param::derive(&parse_macro_input!(input as DeriveInput)).into()
}

/// Implements `InputSet` for the struct of a node's inputs.
#[proc_macro_derive(Inputs, attributes(port))]
pub fn derive_inputs(input: TokenStream) -> TokenStream {
    ports::inputs(&parse_macro_input!(input as DeriveInput)).into()
}

/// Implements `OutputSet` for the struct of a node's outputs.
#[proc_macro_derive(Outputs, attributes(port))]
pub fn derive_outputs(input: TokenStream) -> TokenStream {
    ports::outputs(&parse_macro_input!(input as DeriveInput)).into()
}

/// Implements `Default` for a node's state, and `Clone` with a `clone_from` that goes field by field and so does not
/// allocate.
#[proc_macro_derive(State)]
pub fn derive_state(input: TokenStream) -> TokenStream {
    state::derive(&parse_macro_input!(input as DeriveInput)).into()
}
