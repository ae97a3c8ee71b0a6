//! What a graph may be made of: a plain list of node types, device types and roles.

use crate::device::{Device, DeviceType, RoleType, device_type};
use crate::graph::{BuiltinFile, declares_a_unit};
use crate::node::{Node, NodeType, of};
use crate::signal::Kind;

/// A list of node types, device types and roles. Several can be joined: somebody else's crate adds its own.
#[derive(Default)]
pub struct Catalogue {
    nodes: Vec<Box<dyn NodeType>>,
    devices: Vec<Box<dyn DeviceType>>,
    roles: Vec<RoleType>,
    files: Vec<BuiltinFile>,
}

impl Catalogue {
    /// An empty list.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// With one more node.
    #[must_use]
    pub fn node<N: Node>(self) -> Self {
        self.node_type(of::<N>())
    }

    /// With one more node that is known only at run time.
    ///
    /// # Panics
    /// If there is a node of that name already, if a port declares a unit that is neither one nor a variable, or if a
    /// node logs and has no flag to say when.
    #[must_use]
    pub fn node_type(mut self, node: Box<dyn NodeType>) -> Self {
        let spec = node.spec();
        let is_taken = self.nodes.iter().any(|other| other.spec().name == spec.name);
        assert!(!is_taken, "two nodes are called `{}`", spec.name);
        for port in spec.inputs.iter().chain(&spec.outputs) {
            assert!(declares_a_unit(port), "`{}.{}` declares the unit {:?}", spec.name, port.name, port.args.first());
        }
        let says_when = spec.outputs.first().is_some_and(|port| port.kind == Kind::Flag);
        assert!(!spec.logs || says_when, "the first output of `{}` is no flag that says when to log", spec.name);
        self.nodes.push(node);
        self
    }

    /// With one more device.
    #[must_use]
    pub fn device<D: Device>(self) -> Self {
        self.device_type(device_type::<D>())
    }

    /// With one more device that is known only at run time.
    #[must_use]
    pub fn device_type(mut self, device: Box<dyn DeviceType>) -> Self {
        self.devices.push(device);
        self
    }

    /// With one more role.
    #[must_use]
    pub fn role(mut self, role: RoleType) -> Self {
        self.roles.push(role);
        self
    }

    /// With files that `builtin:NAME` stands for, wherever a file is named.
    #[must_use]
    pub fn files(mut self, files: &[BuiltinFile]) -> Self {
        self.files.extend(files);
        self
    }

    /// With all that is in another list.
    #[must_use]
    pub fn join(mut self, other: Self) -> Self {
        self = other.nodes.into_iter().fold(self, Self::node_type);
        self.devices.extend(other.devices);
        self.roles.extend(other.roles);
        self.files.extend(other.files);
        self
    }

    /// The node types.
    #[must_use]
    pub fn nodes(&self) -> &[Box<dyn NodeType>] {
        &self.nodes
    }

    /// The device types.
    #[must_use]
    pub fn devices(&self) -> &[Box<dyn DeviceType>] {
        &self.devices
    }

    /// The files that `builtin:NAME` stands for.
    #[must_use]
    pub fn builtin_files(&self) -> &[BuiltinFile] {
        &self.files
    }

    /// The roles.
    #[must_use]
    pub fn roles(&self) -> &[RoleType] {
        &self.roles
    }
}
