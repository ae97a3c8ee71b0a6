//! `#[derive(Describe)]`.

use tactflow_runtime::node::Describe;

#[derive(Describe)]
#[describe(name = "no_docs")]
pub struct NoDocs;

/// Generic without an attribute.
#[derive(Describe)]
pub struct NoAttribute<T>(T);

/// Two names from one struct.
#[derive(Describe)]
#[describe(of = "NoName<f64>")]
#[describe(of = "NoName<bool>")]
pub struct NoName<T>(T);

/// Not snake_case.
#[derive(Describe)]
#[describe(name = "LowPass")]
pub struct NotSnakeCase;

/// A word that is not known.
#[derive(Describe)]
#[describe(name = "unknown", every_tck)]
pub struct Unknown;

/// A value where there is none.
#[derive(Describe)]
#[describe(name = "value", logs = true)]
pub struct Value;

/// A name that is no string.
#[derive(Describe)]
#[describe(name = value)]
pub struct NoString;

/// The same name twice.
#[derive(Describe)]
#[describe(name = "twice", of = "Twice<f64>")]
#[describe(name = "twice", of = "Twice<bool>")]
pub struct Twice<T>(T);

/// Generic, but of which type?
#[derive(Describe)]
#[describe(name = "generic")]
pub struct Generic<T>(T);

/// Not generic.
#[derive(Describe)]
#[describe(name = "plain", of = "Plain<f64>")]
pub struct Plain;

/// An example of something else.
///
/// ```toml
/// [nodes.example]
/// type = "exampel"
/// ```
#[derive(Describe)]
#[describe(name = "example")]
pub struct Example;

/// An example of something else than the struct.
///
/// ```toml
/// [nodes.example]
/// type = "unamed"
/// ```
#[derive(Describe)]
pub struct Unnamed;

fn main() {}
