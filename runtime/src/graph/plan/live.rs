//! The parameters that may change while the graph runs, and how their nodes are built again with other values.

use std::sync::Arc;

use crate::node::{AnyNode, Components, Given, KnownUnits, NodeSpec, NodeType, Reader};
use crate::source::{Item, SourceMap, Value};

/// A parameter that the section [live] lists.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveParam {
    /// Its name: `node.param`.
    pub name: String,
    /// Its unit as declared, if it has one.
    pub unit: Option<String>,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Largest change in one second.
    pub rate: f64,
    /// Its value in the file.
    pub value: f64,
    /// Index of the recipe of its node.
    pub(crate) recipe: usize,
    /// The words behind the name of its node.
    pub(crate) path: Vec<String>,
}

/// The parameters that may change, and the recipes of their nodes.
#[derive(Clone, Default)]
pub(crate) struct LivePlan {
    pub(crate) params: Vec<LiveParam>,
    pub(crate) recipes: Vec<Recipe>,
    pub(crate) sources: SourceMap,
}

/// How a node is built again, in all its configurations.
#[derive(Clone)]
pub(crate) struct Recipe {
    /// Its place in step order.
    pub(crate) place: usize,
    pub(crate) kind: Arc<dyn NodeType>,
    pub(crate) spec: NodeSpec,
    pub(crate) given: Given,
    /// Period that its parameters are read with [s].
    pub(crate) period: f64,
    /// For each configuration its parameters, with all facts filled in, and the components that are read of its outputs.
    pub(crate) configurations: Vec<(Value, Vec<Components>)>,
}

impl LivePlan {
    /// Builds the node of a recipe again. `values` holds a value of each parameter.
    ///
    /// # Errors
    /// The mistakes of the node.
    pub(crate) fn build(&self, recipe: usize, values: &[f64]) -> Result<Box<dyn AnyNode>, String> {
        let own = self.params.iter().zip(values).filter(|(param, _)| param.recipe == recipe);
        let own: Vec<(&[String], f64)> = own.map(|(param, value)| (param.path.as_slice(), *value)).collect();
        self.recipes[recipe].build(&own, &self.sources)
    }
}

impl Recipe {
    /// Builds the node with other values at some paths.
    ///
    /// # Errors
    /// The mistakes of the node.
    pub(crate) fn build(&self, values: &[(&[String], f64)], sources: &SourceMap) -> Result<Box<dyn AnyNode>, String> {
        let mut all = self.configurations.iter().map(|(params, wanted)| {
            let mut params = params.clone();
            for (path, number) in values {
                if let Some(value) = params.at_mut(path) {
                    value.item = Item::Float(*number);
                }
            }
            let mut node = self.configure(&params, sources)?;
            node.want(wanted);
            Ok::<_, String>(node)
        });
        let mut node = all.next().expect("every node has a configuration")?;
        for other in all {
            node.adopt(other?).map_err(|_| "its type does not support modes".to_owned())?;
        }
        Ok(node)
    }

    fn configure(&self, params: &Value, sources: &SourceMap) -> Result<Box<dyn AnyNode>, String> {
        let units = KnownUnits::of_params(params, &self.spec.params);
        let units = units.with_wires(&self.spec.inputs, &self.given.inputs, false);
        let mut reader = Reader::new(sources).with_units(units).with_period(self.period);
        let configured = self.kind.configure(params, &mut reader);
        let mut mistakes = reader.mistakes;
        let built =
            match configured.filter(|_| mistakes.is_empty()).map(|configured| configured.build(self.given.clone())) {
                Some(Ok(built)) => return Ok(built.node),
                Some(Err(of_wires)) => of_wires,
                None => Vec::new(),
            };
        mistakes.extend(built);
        let messages: Vec<String> = mistakes.into_iter().map(|mistake| mistake.message).collect();
        Err(messages.join("; "))
    }
}
