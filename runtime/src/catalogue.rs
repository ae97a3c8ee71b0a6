//! What a graph may be made of: a plain list of node types, device types and roles.

mod checks;

use std::collections::BTreeMap;

use crate::device::{Device, DeviceType, RoleType, device_type};
use crate::node::{Node, NodeSpec, NodeType, of};
use crate::source::BuiltinFile;

/// A list of node types, device types and roles. Several can be joined: somebody else's crate adds its own.
#[derive(Default)]
pub struct Catalogue {
    /// What each name is of.
    names: BTreeMap<String, &'static str>,
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
    /// If something has that name already, or if the declaration is wrong: a unit, a default that is not in its own
    /// range, an example that is not of this type or names what the node does not have, or a node that logs without a
    /// flag to say when.
    #[must_use]
    pub fn node_type(mut self, node: Box<dyn NodeType>) -> Self {
        let spec = node.spec();
        self.claim(&spec.name, "node");
        checks::node(&spec);
        self.nodes.push(node);
        self.specs.push(spec);
        self
    }

    /// Takes a name, which describes one thing only.
    fn claim(&mut self, name: &str, what: &'static str) {
        if let Some(other) = self.names.insert(name.to_owned(), what) {
            panic!("a {other} and a {what} are both called `{name}`");
        }
    }

    /// With one more device.
    #[must_use]
    pub fn device<D: Device>(self) -> Self {
        self.device_type(device_type::<D>())
    }

    /// With one more device that is known only at run time.
    ///
    /// # Panics
    /// As [`node_type`](Self::node_type).
    #[must_use]
    pub fn device_type(mut self, device: Box<dyn DeviceType>) -> Self {
        self.claim(&device.name(), "device");
        checks::device(&device.name(), &device.params(), &device.example());
        self.devices.push(device);
        self
    }

    /// With one more role.
    ///
    /// # Panics
    /// If something has that name already.
    #[must_use]
    pub fn role(mut self, role: RoleType) -> Self {
        self.claim(&role.name, "role");
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
        self = other.devices.into_iter().fold(self, Self::device_type);
        self = other.roles.into_iter().fold(self, Self::role);
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

    /// The declarations of the node types in groups, each with its title; those of no group have an empty one.
    pub fn groups(&self) -> impl Iterator<Item = (&'static str, &[NodeSpec])> {
        let first = self.groups.first().map_or(self.specs.len(), |(at, _)| *at);
        let ends = self.groups.iter().skip(1).map(|(at, _)| *at).chain([self.specs.len()]);
        let titled = self.groups.iter().zip(ends).map(|((start, title), end)| (*title, &self.specs[*start..end]));
        [("", &self.specs[..first])].into_iter().chain(titled).filter(|(_, specs)| !specs.is_empty())
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
    use crate::node::{Bounds, Configured, Declared, Need, ParamSpec, PortSpec, Reader};
    use crate::signal::Scalar;
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

    /// A node whose declaration is as wrong as `spec` makes it.
    struct Wrong(Change);

    type Change = fn(&mut NodeSpec);

    impl NodeType for Wrong {
        fn spec(&self) -> NodeSpec {
            let mut spec = Named("wrong").spec();
            let port = PortSpec::of::<Scalar>("x", "", &[("unit", "U"), ("frame", "A")], Need::REQUIRED);
            (spec.inputs, spec.outputs) = (vec![port.clone()], vec![port]);
            (self.0)(&mut spec);
            spec
        }

        fn configure(&self, _: &Value, _: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
            None
        }
    }

    /// What the panic says that `make` ends in.
    fn panic_message(make: impl FnOnce() -> Catalogue + std::panic::UnwindSafe) -> String {
        let panic = std::panic::catch_unwind(make).err().expect("it panics");
        panic.downcast_ref::<String>().cloned().expect("a message with names in it")
    }

    #[test]
    fn a_wrong_declaration_is_one_message_that_names_the_node_and_the_field() {
        let bounded = |default: fn() -> f64| {
            let declared = Declared { bounds: Some(Bounds::above(0.0)), ..Declared::new("gain") };
            ParamSpec::of::<f64>(&declared, Some(default))
        };
        assert_eq!(bounded(|| 1.0).fault, None);
        let cases: [(Change, &str); 10] = [
            (
                |spec| spec.outputs[0].args = vec!["newton".into()].into(),
                "`wrong.x` declares the unit Some(\"newton\")",
            ),
            (|spec| spec.inputs.push(spec.inputs[0].clone()), "two inputs of `wrong` are called `x`"),
            (|spec| spec.logs = true, "the first output of `wrong` is no flag that says when to log"),
            (
                |spec| spec.outputs[0].args = vec!["U".into(), "$frame".into()].into(),
                "`wrong.x` names the parameter `frame`, which `wrong` does not have",
            ),
            (
                |spec| {
                    let declared = Declared { bounds: Some(Bounds::above(0.0)), ..Declared::new("gain") };
                    spec.params.push(ParamSpec::of::<f64>(&declared, Some(|| -1.0)));
                },
                "the default of parameter `gain` of `wrong` is refused: expected a number greater than 0, found -1",
            ),
            (
                |spec| {
                    let declared = Declared { unit: Some("$unit/s"), ..Declared::new("gain") };
                    spec.params.push(ParamSpec::of::<f64>(&declared, None));
                },
                "the unit of parameter `gain` of `wrong` is `$unit`, but there is no parameter `unit`",
            ),
            (
                |spec| spec.example = "[nodes.a]\ntype = \"other\"".into(),
                "the example of `wrong` has no block in `[nodes]` with `type = \"wrong\"`",
            ),
            (
                |spec| spec.example = "[nodes.a]\ntype = \"wrong\"\nin.x = \"b.c\"\ngian = 1".into(),
                "the example of `wrong` sets `gian`, which is no parameter of it",
            ),
            (
                |spec| spec.example = "[nodes.a]\ntype = \"wrong\"\nin.y = \"b.c\"".into(),
                "the example of `wrong` wires `in.y`, which it does not have",
            ),
            (|spec| spec.example = "[nodes.a]\ntype = \"wrong\"".into(), "the example of `wrong` does not wire `in.x`"),
        ];
        for (change, expected) in cases {
            assert_eq!(panic_message(move || Catalogue::new().node_type(Box::new(Wrong(change)))), expected);
        }
        let text = panic_message(|| Catalogue::new().node_type(Box::new(Wrong(|spec| spec.example = "[nodes".into()))));
        assert!(text.starts_with("the example of `wrong` is no TOML: "), "{text}");
    }

    #[test]
    fn a_name_describes_one_thing_only() {
        let twice = |make: fn() -> Catalogue| panic_message(make);
        assert_eq!(twice(|| named(named(Catalogue::new(), "a"), "a")), "a node and a node are both called `a`");
        let role = || RoleType { name: "a".into(), ..RoleType::default() };
        assert_eq!(
            panic_message(|| named(Catalogue::new().role(role()), "a")),
            "a role and a node are both called `a`"
        );
        let join = || Catalogue::new().role(role()).join(Catalogue::new().role(role()));
        assert_eq!(panic_message(join), "a role and a role are both called `a`");
    }

    #[test]
    fn a_group_goes_to_the_next_and_a_joined_catalogue_keeps_its_own() {
        let first = named(named(Catalogue::new(), "a").group("one"), "b");
        let second = named(named(Catalogue::new(), "c").group("two").group("empty").group("three"), "d");
        let all = first.join(second).join(named(Catalogue::new().group("four"), "e"));
        let groups: Vec<(&str, String)> =
            all.groups().map(|(title, specs)| (title, specs.iter().map(|spec| &*spec.name).collect())).collect();
        let expected = [("", "a"), ("one", "b"), ("", "c"), ("three", "d"), ("four", "e")];
        assert_eq!(groups, expected.map(|(title, names)| (title, names.to_owned())));
    }
}
