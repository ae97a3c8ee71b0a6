//! `deadband`: an error that is small rests, with two widths.
//!
//! Each feature has a flag of its own: it rests once |e| < inner, and no longer rests once |e| > outer. A fresh feature
//! does not rest, so an error first decreases to the inner width. A number that is not finite never rests.

use tactflow_runtime::node::{
    Absence, At, Components, Describe, In, Inputs, Map, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State,
    Tick, refuse_any,
};
use tactflow_runtime::signal::{Features, Freshness};
use tactflow_runtime::source::Code;

/// Lets a small error rest, so that a controller does not hunt around its target.
///
/// Friction makes a controller with an integral hunt. The arm sticks near the target, and the integral of the error
/// that is left grows until the arm breaks away. It then moves too far, sticks again on the other side, and so on: a
/// slow oscillation that never ends. A controller that accepts a small error comes to rest.
///
/// An error passes unchanged until it is within `inner`. From then on the feature rests, until its error is greater
/// than `outer`. Two widths keep noise at a bound from switching it: choose `outer` above the noise and the error at
/// which the arm sticks, and `inner` about half as large. Features without a width pass unchanged.
///
/// Wire it between `feature_error` and `pid`. What the controller does while a feature rests depends on `inside`:
///
/// - `"absent"`: the feature is absent. `pid` contributes nothing for it, and after the graph's `reset_after_ms` it
///   resets the integral of the feature: the feature stands still until its error is greater than `outer`. Do not list
///   such a feature in `requires` or in a condition of a mode.
/// - `"zero"`: the error is 0, for a controller without an integral. The integral of a `pid` would stay, move the
///   feature through the band and out at the other side, and hunt in larger steps than without the band.
///
/// An absent feature stays absent. After the graph's `reset_after_ms` it no longer rests when it returns.
///
/// ```toml
/// [nodes.deadband]
/// type = "deadband"
/// in.error = "error.error"
/// width.pressure = { inner = 0.001, outer = 0.003 }   # [N per tactel]
/// ```
#[derive(Describe)]
pub struct Deadband {
    /// The widths of each feature, if it has any.
    widths: Box<[Option<Width>]>,
    inside: Inside,
}

/// Parameters of `deadband`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Widths of the features that rest.
    #[param(live)]
    width: Map<Width>,
    /// What a feature is while it rests.
    #[param(default = Inside::Absent)]
    inside: Inside,
}

/// The two widths of a feature.
#[derive(Debug, Clone, Param)]
struct Width {
    /// Error below which the feature begins to rest.
    #[param(unit = "E", above = 0.0)]
    inner: f64,
    /// Error above which the feature no longer rests.
    #[param(unit = "E", above = 0.0)]
    outer: f64,
}

/// What a feature is while it rests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Inside {
    /// Its error is 0.
    Zero,
    /// It is absent.
    Absent,
}

/// What `deadband` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Error of each feature.
    #[port(unit = "E", frame = "A")]
    error: In<'a, Features>,
}

/// What `deadband` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same; a feature that rests is 0 or absent.
    #[port(unit = "E", frame = "A")]
    error: Out<Features>,
}

/// What `deadband` remembers.
#[derive(State)]
pub struct State {
    /// For each feature.
    memories: Vec<Memory>,
    /// Time of the last step [ns].
    stepped: i64,
}

/// What is remembered of one feature.
#[derive(Debug, Clone, Copy, Default)]
struct Memory {
    is_resting: bool,
    absence: Absence,
}

impl Node for Deadband {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.error;
        check(&params.width, shape.names())?;
        let widths = shape.names().map(|name| params.width.0.get(name).cloned()).collect();
        setup.outputs.error = shape.clone();
        Ok(Self { widths, inside: params.inside })
    }

    fn state(&self) -> State {
        State { memories: vec![Memory::default(); self.widths.len()], stepped: 0 }
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        wanted.into()
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        for (i, (width, memory)) in self.widths.iter().zip(&mut state.memories).enumerate() {
            match inputs.error.get(i) {
                Some(error) if error.is_new() => {
                    if memory.absence.end(tick) {
                        memory.is_resting = false;
                    }
                    memory.is_resting = width.as_ref().is_some_and(|width| width.rests(*error, memory.is_resting));
                    match (memory.is_resting, self.inside) {
                        (false, _) => out.error.set_from(i, *error, &error),
                        (true, Inside::Zero) => out.error.set_from(i, 0.0, &error),
                        (true, Inside::Absent) => out.error.lose(i),
                    }
                }
                Some(_) => {}
                None => {
                    // Absent without a loss: all features were lost at once, and the node was not stepped then.
                    let is_lost = inputs.error.freshness(i) == Freshness::Lost;
                    memory.absence.begin(if is_lost { tick.now } else { state.stepped });
                    out.error.lose(i);
                }
            }
        }
        state.stepped = tick.now;
    }
}

impl Width {
    /// Returns whether a feature with this error rests, given whether it rested before.
    fn rests(&self, error: f64, has_rested: bool) -> bool {
        error.abs() < self.inner || has_rested && error.abs() <= self.outer
    }
}

/// Returns a mistake for each width without a feature and for each pair in the wrong order.
fn check<'n>(widths: &Map<Width>, names: impl Iterator<Item = &'n str> + Clone) -> Result<(), Mistakes> {
    if widths.0.is_empty() {
        let mistake = Mistake::new(Code::MissingKey, At::Param("width".into()), "no feature has a width");
        return Err(mistake.help("write `width.NAME = { inner = …, outer = … }`, or leave the node out").into());
    }
    let mistakes = widths.0.iter().filter_map(|(name, width)| {
        if !names.clone().any(|known| known == name) {
            let mistake = Mistake::key(format!("width.{name}"), format!("no feature is called `{name}`"));
            return Some(mistake.suggest(name, names.clone(), "features"));
        }
        let message =
            format!("`outer` of `{name}` is {}, which is not greater than `inner`, {}", width.outer, width.inner);
        let mistake = || Mistake::param(format!("width.{name}.outer"), message);
        (width.outer <= width.inner)
            .then(|| mistake().help(format!("write for example `outer = {}`", 2.0 * width.inner)))
    });
    refuse_any(mistakes)
}

#[cfg(test)]
mod tests;
