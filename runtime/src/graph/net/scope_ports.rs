//! The ports that the wires of a scope can read, found by port and by name.

use std::collections::BTreeMap;

use crate::graph::plan::{PortRef, Producer};
use crate::node::PortSpec;
use crate::signal::Kind;

/// The ports of one scope.
pub(super) struct ScopePorts {
    /// The first name of each port.
    names: BTreeMap<PortRef, String>,
    /// For each name without its owner and each kind: the first ports of two different producers, with their names.
    alike: BTreeMap<(String, Kind), Vec<(Producer, String)>>,
}

impl ScopePorts {
    /// Collects the ports of a scope from their names `node.port`, in the order in which they are searched.
    pub(super) fn new(ports: impl Iterator<Item = (String, PortRef)>, kind: impl Fn(PortRef) -> Kind) -> Self {
        let mut scope = Self { names: BTreeMap::new(), alike: BTreeMap::new() };
        for (name, port) in ports {
            let own = name.rsplit('.').next().unwrap_or_default().to_owned();
            let alike = scope.alike.entry((own, kind(port))).or_default();
            if alike.len() < 2 && alike.iter().all(|(producer, _)| *producer != port.producer) {
                alike.push((port.producer, name.clone()));
            }
            scope.names.entry(port).or_insert(name);
        }
        scope
    }

    /// Returns the name by which the wires of the scope refer to a port, or `None` if they cannot.
    pub(super) fn name(&self, port: PortRef) -> Option<&str> {
        self.names.get(&port).map(String::as_str)
    }

    /// Returns the name of the first port for which `fits` holds.
    pub(super) fn find(&self, fits: impl Fn(PortRef) -> bool) -> Option<&str> {
        self.names.iter().find(|(port, _)| fits(**port)).map(|(_, name)| name.as_str())
    }

    /// Returns the name of a port that has the name and the kind of an input, and whose producer fits.
    pub(super) fn candidate(&self, input: &PortSpec, fits: impl Fn(Producer) -> bool) -> Option<&str> {
        let alike = self.alike.get(&(input.name.to_string(), input.kind))?;
        alike.iter().find(|(producer, _)| fits(*producer)).map(|(_, name)| name.as_str())
    }
}
