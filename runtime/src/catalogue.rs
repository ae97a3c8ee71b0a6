//! What a graph may be made of: a plain list of node types, device types and roles.

use crate::device::{Device, DeviceType, RoleType, device_type};
use crate::node::{Node, NodeSpec, NodeType, declares_a_unit, of};
use crate::signal::Kind;
use crate::source::BuiltinFile;

/// A list of node types, device types and roles. Several can be joined: somebody else's crate adds its own.
#[derive(Default)]
pub struct Catalogue {
    nodes: Vec<Box<dyn NodeType>>,
    /// The declaration of each node type.
    specs: Vec<NodeSpec>,
    /// Titles of groups, and with which node each starts.
    groups: Vec<(usize, &'static str)>,
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

    /// The nodes that follow belong together: what they are for, in a line, for lists and the reference.
    #[must_use]
    pub fn group(mut self, title: &'static str) -> Self {
        self.groups.push((self.nodes.len(), title));
        self
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
        assert!(self.find_node(&spec.name).is_none(), "two nodes are called `{}`", spec.name);
        for port in spec.inputs.iter().chain(&spec.outputs) {
            assert!(declares_a_unit(port), "`{}.{}` declares the unit {:?}", spec.name, port.name, port.args.first());
        }
        let says_when = spec.outputs.first().is_some_and(|port| port.kind == Kind::Flag);
        assert!(!spec.logs || says_when, "the first output of `{}` is no flag that says when to log", spec.name);
        self.nodes.push(node);
        self.specs.push(spec);
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
        let before = self.nodes.len();
        // What belongs to no group there does not fall into the last one here.
        let start = (!self.groups.is_empty()).then_some((before, ""));
        self.groups.extend(start.filter(|_| other.groups.first().is_none_or(|(at, _)| *at > 0)));
        self.groups.extend(other.groups.iter().map(|(at, title)| (before + at, *title)));
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

    /// The declarations of the node types, in their order.
    pub fn specs(&self) -> impl Iterator<Item = &NodeSpec> + Clone {
        self.specs.iter()
    }

    /// Finds a node type by its name: its number and its declaration.
    #[must_use]
    pub fn find_node(&self, name: &str) -> Option<(usize, &NodeSpec)> {
        self.specs.iter().enumerate().find(|(_, spec)| spec.name == name)
    }

    /// Finds a device type by its name.
    #[must_use]
    pub fn find_device(&self, name: &str) -> Option<&dyn DeviceType> {
        self.devices.iter().find(|device| device.name() == name).map(|device| &**device)
    }

    /// Finds a role by its name.
    #[must_use]
    pub fn role_type(&self, name: &str) -> Option<&RoleType> {
        self.roles.iter().find(|role| role.name == name)
    }

    /// The groups of node types in reading order, each with its title; those of no group have an empty one.
    pub fn groups(&self) -> impl Iterator<Item = (&'static str, &[Box<dyn NodeType>])> {
        let first = self.groups.first().map_or(self.nodes.len(), |(at, _)| *at);
        let ends = self.groups.iter().skip(1).map(|(at, _)| *at).chain([self.nodes.len()]);
        let titled = self.groups.iter().zip(ends).map(|((start, title), end)| (*title, &self.nodes[*start..end]));
        [("", &self.nodes[..first])].into_iter().chain(titled).filter(|(_, nodes)| !nodes.is_empty())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{Configured, NodeSpec, Reader};
    use crate::source::Value;

    /// A node of which only the name matters.
    struct Named(&'static str);

    impl NodeType for Named {
        fn spec(&self) -> NodeSpec {
            let (name, none) = (self.0.into(), || "".into());
            let ports = (Vec::new(), Vec::new());
            NodeSpec {
                name,
                summary: none(),
                doc: none(),
                example: none(),
                params: Vec::new(),
                inputs: ports.0,
                outputs: ports.1,
                every_tick: false,
                logs: false,
                limits: crate::node::Limits::NONE,
            }
        }

        fn configure(&self, _: &Value, _: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
            None
        }
    }

    fn named(catalogue: Catalogue, name: &'static str) -> Catalogue {
        catalogue.node_type(Box::new(Named(name)))
    }

    #[test]
    fn a_group_goes_to_the_next_and_a_joined_catalogue_keeps_its_own() {
        let first = named(named(Catalogue::new(), "a").group("one"), "b");
        let second = named(named(Catalogue::new(), "c").group("two").group("empty").group("three"), "d");
        let all = first.join(second).join(named(Catalogue::new().group("four"), "e"));
        let groups: Vec<(&str, Vec<String>)> = all
            .groups()
            .map(|(title, nodes)| (title, nodes.iter().map(|node| node.spec().name.into_owned()).collect()))
            .collect();
        let groups: Vec<(&str, String)> = groups.into_iter().map(|(title, names)| (title, names.concat())).collect();
        let expected = [("", "a"), ("one", "b"), ("", "c"), ("three", "d"), ("four", "e")];
        assert_eq!(groups, expected.map(|(title, names)| (title, names.to_owned())));
    }
}
