//! A single node in a test: set its inputs, step, read its outputs.

use super::params::with_params;
use crate::engine::NodeRunner;
use crate::node::{At, Bus, Components, Given, Mistake, Mistakes, Need, Node, NodeSpec, PortId, Tick, of};
use crate::signal::{Features, Freshness, Mark, Shape, Signal, Stamp};

/// Returns the code and the place of each mistake or warning of a node, for tests of bad parameters: ``bad-value: `-1` `` for a
/// value in the text `params`, ``unknown-key: `threshold` `` for a parameter, ``shape-mismatch: `in.image` `` for an
/// input.
#[must_use]
pub fn places(params: &str, made: &Result<NodeRig, Mistakes>) -> Vec<String> {
    let describe = |Mistake { code, at, .. }: &Mistake| {
        let place = match at {
            At::Span(span) if span.is_empty() => "the node".to_owned(),
            At::Span(span) => params.get(span.clone()).unwrap_or_default().to_owned(),
            At::Param(path) | At::Key(path) => path.clone(),
            At::Input(name) => format!("in.{name}"),
            At::Data { text, span, .. } => text.get(span.clone()).unwrap_or_default().to_owned(),
            At::Node => "the node".to_owned(),
        };
        format!("{}: `{place}`", code.name())
    };
    let found = made.as_ref().map_or_else(|mistakes| mistakes, |rig| &rig.warnings);
    found.iter().map(describe).collect()
}

/// A single node in a test. It steps as in a graph: when a trigger is new or lost.
///
/// By default, each tick is 1 ms after the last. A value that the test sets is a new sample with the time of the tick.
pub struct NodeRig {
    runner: NodeRunner,
    spec: NodeSpec,
    bus: Bus,
    inputs: Vec<(String, PortId)>,
    outputs: Vec<PortId>,
    shapes: Vec<Shape>,
    /// The warnings of the node.
    pub warnings: Mistakes,
    /// The tick of the next step.
    pub tick: Tick,
}

impl NodeRig {
    /// Builds a node with the parameters of a TOML text, and with wires of the given shapes. The names are those of a
    /// graph file: `x` for `in.x`.
    ///
    /// # Errors
    /// The mistakes that the node finds.
    ///
    /// # Panics
    /// If the text is not TOML, or if a name is not an input.
    pub fn new<N: Node>(params: &str, wires: &[(&str, Shape)]) -> Result<Self, Mistakes> {
        let node_type = of::<N>();
        let spec = node_type.spec();
        let configured = with_params(params, |table, reader| node_type.configure(table, reader))?;
        let mut bus = Bus::default();
        let mut given = vec![Vec::new(); spec.inputs.len()];
        let mut wired: Vec<(Need, Vec<PortId>)> = spec.inputs.iter().map(|input| (input.need, Vec::new())).collect();
        let mut inputs = Vec::new();
        for (name, shape) in wires {
            let named = spec.inputs.iter().position(|input| input.name == *name && !input.need.is_many);
            let i = named.or_else(|| spec.inputs.iter().position(|input| input.need.is_many));
            let i = i.unwrap_or_else(|| panic!("`{}` has no input `{name}`", N::NAME));
            assert_eq!(shape.kind(), spec.inputs[i].kind, "input `{name}`");
            let port = bus.add(shape);
            given[i].push(((*name).to_owned(), shape.clone()));
            wired[i].1.push(port);
            inputs.push(((*name).to_owned(), port));
        }
        let sample_periods = vec![0.001; spec.inputs.len()];
        let built = configured.build(Given { inputs: given, period: 0.001, sample_periods })?;
        let outputs: Vec<PortId> = built.outputs.iter().map(|shape| bus.add(shape)).collect();
        let runner = NodeRunner::new(built.node, &wired, outputs.clone(), N::EVERY_TICK);
        let (shapes, warnings) = (built.outputs, built.warnings);
        Ok(Self { runner, spec, bus, inputs, outputs, shapes, warnings, tick: Tick::first() })
    }

    fn input(&self, name: &str) -> PortId {
        let found = self.inputs.iter().find(|(input, _)| input == name);
        found.unwrap_or_else(|| panic!("no wire is called `{name}`")).1
    }

    fn output(&self, name: &str) -> usize {
        let found = self.spec.outputs.iter().position(|output| output.name == name);
        found.unwrap_or_else(|| panic!("no output is called `{name}`"))
    }

    /// Sets which components of the outputs are read, as a mode does.
    pub fn want(&mut self, wanted: &[Components]) {
        self.runner.want(wanted);
    }

    /// Sets an input to a new sample with the time of the tick.
    ///
    /// # Panics
    /// If there is no such wire.
    pub fn set<T: Signal>(&mut self, input: &str, value: T) {
        let stamp = Stamp { nanos: self.tick.now, device: 0 };
        self.edit(input, stamp, |old: &mut T| *old = value);
    }

    /// Changes the value of an input in place, as a new sample with the given stamp.
    ///
    /// # Panics
    /// If there is no such wire.
    pub fn edit<T: Signal>(&mut self, input: &str, stamp: Stamp, change: impl FnOnce(&mut T)) {
        let port = self.input(input);
        change(self.bus.slot_mut(port));
        self.bus.mark_mut(port).renew(self.tick.index, stamp);
        *self.bus.mark_mut(port) = self.bus.slot::<T>(port).mark(*self.bus.mark(port), self.tick.index);
    }

    /// Sets an input of features to a new sample with the time of the tick: a value for each feature, `None` for an
    /// absent one.
    ///
    /// # Panics
    /// If there is no such wire, or if it has fewer components.
    pub fn set_features(&mut self, input: &str, values: &[Option<f64>]) {
        let (tick, stamp) = (self.tick.index, Stamp { nanos: self.tick.now, device: 0 });
        self.edit(input, stamp, |features: &mut Features| {
            for (i, value) in values.iter().enumerate() {
                match value {
                    Some(value) => features.set(i, *value, tick, stamp),
                    None => features.lose(i, tick),
                }
            }
        });
    }

    /// Makes an input absent.
    ///
    /// # Panics
    /// If there is no such wire.
    pub fn lose(&mut self, input: &str) {
        let port = self.input(input);
        self.bus.mark_mut(port).lose(self.tick.index);
    }

    /// Runs the tick, then lets `ms` milliseconds pass.
    pub fn step_ms(&mut self, ms: f64) {
        self.runner.is_overruled = self.tick.is_overruled;
        self.runner.visit(&mut self.tick, &mut self.bus);
        let nanos = (ms * 1e6) as i64;
        self.tick =
            Tick { index: self.tick.index + 1, now: self.tick.now + nanos, dt: nanos as f64 * 1e-9, ..self.tick };
    }

    /// Runs the tick, then lets a millisecond pass.
    pub fn step(&mut self) {
        self.step_ms(1.0);
    }

    /// Returns the value of an output after the last step, or `None` if it is absent.
    ///
    /// # Panics
    /// If there is no such output of that kind.
    #[must_use]
    pub fn get<T: Signal>(&self, output: &str) -> Option<&T> {
        let i = self.output(output);
        assert_eq!(self.shapes[i].kind(), T::KIND, "output `{output}`");
        let port = self.outputs[i];
        self.bus.get(port)
    }

    /// Returns what the node has found out so far; see [`Node::found`].
    #[must_use]
    pub fn found(&self) -> Option<String> {
        self.runner.found()
    }

    /// Whether the node can take its zero anew, by its inputs as of now; see [`Node::can_tare`].
    #[must_use]
    pub fn can_tare(&self) -> Option<Result<(), String>> {
        self.runner.can_tare(&self.tick, &self.bus)
    }

    /// Makes the node take its zero anew; see [`Node::tare`].
    pub fn tare(&mut self) {
        self.runner.tare();
    }

    /// Returns the mark of an output.
    ///
    /// # Panics
    /// If there is no such output.
    #[must_use]
    pub fn mark(&self, output: &str) -> Mark {
        *self.bus.mark(self.outputs[self.output(output)])
    }

    /// Returns the freshness of an output in the tick of the last step.
    ///
    /// # Panics
    /// If there is no such output.
    pub fn freshness(&self, output: &str) -> Freshness {
        self.mark(output).freshness(self.tick.index - 1)
    }

    /// Returns the shape that the node has set for an output.
    ///
    /// # Panics
    /// If there is no such output.
    #[must_use]
    pub fn shape(&self, output: &str) -> &Shape {
        &self.shapes[self.output(output)]
    }
}
