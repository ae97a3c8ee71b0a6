//! Catalogues: lists of the node types, device types and roles that graphs can use.

mod checks;
mod limit_readers;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use crate::device::{Device, DeviceType, RoleType, device_type};
use crate::node::{Node, NodeSpec, NodeType, of};
use crate::outline::Outline;
use crate::source::{BuiltinFile, Diagnostics};

pub(crate) use limit_readers::LimitReaders;

/// A check of whole graphs that knows what the nodes of a catalogue do: from the outline of a graph without mistakes, and
/// the facts of its roles (`role.fact`), to warnings.
pub type Lint = fn(&Outline, &[(String, toml::Value)]) -> Diagnostics;

/// A list of node types, device types and roles. Catalogues can be joined, so that a crate can add its own to the
/// shipped one.
#[derive(Default)]
#[must_use]
pub struct Catalogue {
    /// The sort of entry behind each name.
    names: BTreeMap<String, &'static str>,
    nodes: Vec<Arc<dyn NodeType>>,
    /// The declaration of each node type.
    specs: Vec<NodeSpec>,
    /// Titles of groups, each with the number of its first node.
    groups: Vec<(usize, &'static str)>,
    devices: Vec<Box<dyn DeviceType>>,
    /// Device types that this build leaves out, each with how to get it.
    left_out: Vec<(&'static str, &'static str)>,
    roles: Vec<RoleType>,
    files: Vec<BuiltinFile>,
    lints: Vec<Lint>,
    limit_readers: OnceLock<LimitReaders>,
}

impl Catalogue {
    /// Creates an empty catalogue.
    pub fn new() -> Self {
        Self::default()
    }

    /// Starts a group of nodes. Lists and the reference show its title above the nodes that follow.
    pub fn group(mut self, title: &'static str) -> Self {
        self.groups.push((self.nodes.len(), title));
        self
    }

    /// Adds a node.
    ///
    /// # Panics
    /// As [`node_type`](Self::node_type).
    #[track_caller]
    pub fn node<N: Node>(self) -> Self {
        self.node_type(of::<N>())
    }

    /// Adds a node that is known only at run time.
    ///
    /// # Panics
    /// If the name is taken, or if the declaration is wrong: an unknown unit, a default outside its own range, two ports
    /// of one name, or an example that is of another type, sets an unknown parameter or leaves a required input unwired.
    /// The message lists everything that is wrong.
    #[track_caller]
    pub fn node_type(self, node: Box<dyn NodeType>) -> Self {
        self.shared_node_type(node.into())
    }

    #[track_caller]
    fn shared_node_type(mut self, node: Arc<dyn NodeType>) -> Self {
        let spec = node.spec();
        self.claim(&spec.name, "node");
        refuse(&checks::node(&spec));
        self.nodes.push(node);
        self.specs.push(spec);
        self
    }

    /// Reserves a name.
    #[track_caller]
    fn claim(&mut self, name: &str, what: &'static str) {
        if let Some(other) = self.names.insert(name.to_owned(), what) {
            panic!("the {what} `{name}` cannot be added: a {other} has that name already");
        }
    }

    /// Adds a device.
    ///
    /// # Panics
    /// As [`node_type`](Self::node_type).
    #[track_caller]
    pub fn device<D: Device>(self) -> Self {
        self.device_type(device_type::<D>())
    }

    /// Adds a device that is known only at run time.
    ///
    /// # Panics
    /// As [`node_type`](Self::node_type).
    #[track_caller]
    pub fn device_type(mut self, device: Box<dyn DeviceType>) -> Self {
        self.claim(&device.name(), "device");
        refuse(&checks::device(&device.name(), &device.params(), &device.example()));
        self.devices.push(device);
        self
    }

    /// Adds a type of role.
    ///
    /// # Panics
    /// If the name is taken.
    #[track_caller]
    pub fn role(mut self, role: RoleType) -> Self {
        self.claim(&role.name, "role");
        self.roles.push(role);
        self
    }

    /// Adds files that graphs can name as `builtin:NAME`.
    pub fn files(mut self, files: &[BuiltinFile]) -> Self {
        self.files.extend(files);
        self
    }

    /// Adds a check of whole graphs.
    pub fn lint(mut self, lint: Lint) -> Self {
        self.lints.push(lint);
        self
    }

    /// States device types that this build leaves out. `how` says how to get them, in the message about a graph that uses
    /// one.
    pub fn left_out(mut self, names: &[&'static str], how: &'static str) -> Self {
        self.left_out.extend(names.iter().map(|name| (*name, how)));
        self
    }

    /// Adds all entries of another catalogue.
    ///
    /// # Panics
    /// If a name is in both.
    #[track_caller]
    pub fn join(mut self, other: Self) -> Self {
        let before = self.nodes.len();
        // Nodes without a group there must not fall into the last group here.
        let start = (!self.groups.is_empty()).then_some((before, ""));
        self.groups.extend(start.filter(|_| other.groups.first().is_none_or(|(at, _)| *at > 0)));
        self.groups.extend(other.groups.iter().map(|(at, title)| (before + at, *title)));
        for node in other.nodes {
            self = self.shared_node_type(node);
        }
        for device in other.devices {
            self = self.device_type(device);
        }
        for role in other.roles {
            self = self.role(role);
        }
        self.left_out.extend(other.left_out);
        self.files.extend(other.files);
        self.lints.extend(other.lints);
        self
    }

    /// Returns the node types.
    #[must_use]
    pub fn nodes(&self) -> &[Arc<dyn NodeType>] {
        &self.nodes
    }

    /// Returns the declarations of the node types, in their order.
    pub fn specs(&self) -> impl Iterator<Item = &NodeSpec> + Clone {
        self.specs.iter()
    }

    /// Returns the number and the declaration of a node type, by its name.
    #[must_use]
    pub fn find_node(&self, name: &str) -> Option<(usize, &NodeSpec)> {
        self.specs.iter().enumerate().find(|(_, spec)| spec.name == name)
    }

    /// Returns a device type by its name.
    #[must_use]
    pub fn find_device(&self, name: &str) -> Option<&dyn DeviceType> {
        self.devices.iter().find(|device| device.name() == name).map(|device| &**device)
    }

    /// Returns how to get a device type that this build leaves out.
    #[must_use]
    pub fn how_to_get(&self, device: &str) -> Option<&'static str> {
        self.left_out.iter().find(|(name, _)| *name == device).map(|(_, how)| *how)
    }

    /// Returns a type of role by its name.
    #[must_use]
    pub fn role_type(&self, name: &str) -> Option<&RoleType> {
        self.roles.iter().find(|role| role.name == name)
    }

    /// Returns the declarations of the node types in groups. The title of nodes without a group is empty.
    pub fn groups(&self) -> impl Iterator<Item = (&'static str, &[NodeSpec])> {
        let first = self.groups.first().map_or(self.specs.len(), |(at, _)| *at);
        let ends = self.groups.iter().skip(1).map(|(at, _)| *at).chain([self.specs.len()]);
        let titled = self.groups.iter().zip(ends).map(|((start, title), end)| (*title, &self.specs[*start..end]));
        [("", &self.specs[..first])].into_iter().chain(titled).filter(|(_, specs)| !specs.is_empty())
    }

    /// Returns the device types.
    #[must_use]
    pub fn devices(&self) -> &[Box<dyn DeviceType>] {
        &self.devices
    }

    /// Returns the files that graphs can name as `builtin:NAME`.
    #[must_use]
    pub fn builtin_files(&self) -> &[BuiltinFile] {
        &self.files
    }

    /// Returns the checks of whole graphs.
    pub(crate) fn lints(&self) -> &[Lint] {
        &self.lints
    }

    /// Returns which parameters of limiters read which limits, as the built-in parts wire them.
    pub(crate) fn limit_readers(&self) -> &LimitReaders {
        self.limit_readers.get_or_init(|| LimitReaders::new(&self.files))
    }

    /// Returns the types of roles.
    pub fn roles(&self) -> &[RoleType] {
        &self.roles
    }
}

/// Panics if anything is wrong with a declaration.
#[track_caller]
fn refuse(wrong: &[String]) {
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
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
                "`wrong.x` declares `newton`, which is not a unit",
            ),
            (|spec| spec.inputs.push(spec.inputs[0].clone()), "two inputs of `wrong` are called `x`"),
            (|spec| spec.logs = true, "`wrong` logs, so its first output must be a flag"),
            (
                |spec| spec.outputs[0].args = vec!["U".into(), "$frame".into()].into(),
                "`wrong.x` uses `$frame`, but there is no parameter `frame`",
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
                "the example of `wrong` sets `gian`, which is not a parameter of it",
            ),
            (
                |spec| spec.example = "[nodes.a]\ntype = \"wrong\"\nin.y = \"b.c\"".into(),
                "the example of `wrong` wires `in.y`, which is not an input of it\nthe example of `wrong` does not wire `in.x`",
            ),
            (|spec| spec.example = "[nodes.a]\ntype = \"wrong\"".into(), "the example of `wrong` does not wire `in.x`"),
        ];
        for (change, expected) in cases {
            assert_eq!(panic_message(move || Catalogue::new().node_type(Box::new(Wrong(change)))), expected);
        }
        let text = panic_message(|| Catalogue::new().node_type(Box::new(Wrong(|spec| spec.example = "[nodes".into()))));
        assert!(text.starts_with("the example of `wrong` is not valid TOML: "), "{text}");
    }

    #[test]
    fn a_name_describes_one_thing_only() {
        let twice = |make: fn() -> Catalogue| panic_message(make);
        assert_eq!(
            twice(|| named(named(Catalogue::new(), "a"), "a")),
            "the node `a` cannot be added: a node has that name already"
        );
        let role = || RoleType { name: "a".into(), ..RoleType::default() };
        assert_eq!(
            panic_message(|| named(Catalogue::new().role(role()), "a")),
            "the node `a` cannot be added: a role has that name already"
        );
        let join = || Catalogue::new().role(role()).join(Catalogue::new().role(role()));
        assert_eq!(panic_message(join), "the role `a` cannot be added: a role has that name already");
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
