//! `edge_guard`: the contact stays away from the rim of the pad.

mod fence;

use tactflow_runtime::node::{
    Absence, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Image, ImageShape, Scalar, Twist};

use fence::{Fence, guarded};

/// Keeps the contact away from the rim of the pad: near the rim, only inward motion passes unchanged.
///
/// A contact that slides off the pad is lost, and the rim cuts off a part of a contact, whose centre of gravity is then
/// wrong. Near the rim this node removes the motion that carries the contact further out. It is the edge guard of the
/// authors' later code, which kept the centre of gravity within tactels 2 to 13 of 16.
///
/// The contact of an object at rest moves over the pad with dx/dt = -vx + wz y and dy/dt = -vy - wz x. In the middle of
/// the pad all outward motion passes, from `margin_tactels` on none. Over `ramp_tactels` before the margin the fraction
/// falls linearly, so the output does not chatter. Only vx and vy are corrected: a turn about z continues, about the
/// contact. Outward rolling (wy < 0 at the +x side, wx > 0 at the +y side, and the opposite signs at the opposite
/// sides) is scaled by the same fraction. Inward motion, vz and wz pass unchanged.
///
/// Put it behind the `twist_adder` and before the limits, so that it guards guidance as well. The output is
/// as old as the contact or the twist, whichever is older.
///
/// Without a contact every motion passes, so that the sensor can approach an object. The last contact is remembered for
/// the graph's `reset_after_ms`, so flicker does not open the guard. The guard depends on geometry alone, so it works
/// with any signs in the columns of `inverse_jacobian`. An object that moves by itself can still leave the pad.
///
/// ```toml
/// [nodes.edge_guard]
/// type = "edge_guard"
/// in.twist = "sum.twist"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// in.image = "calibrate.image"
/// margin_tactels = 2.0                # tactels 2 to 13 of 16
/// ramp_tactels = 1.0
/// ```
#[derive(Describe)]
pub struct EdgeGuard {
    x: Fence,
    y: Fence,
}

/// Parameters of `edge_guard`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Distance that the contact keeps from the centres of the outermost tactels.
    #[param(unit = "tactel", range = 0.0.., default = 2.0)]
    margin_tactels: f64,
    /// Width of the zone before the margin in which outward motion fades out.
    #[param(unit = "tactel", above = 0.0, default = 1.0)]
    ramp_tactels: f64,
}

/// What `edge_guard` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The motion to guard, in the frame of the sensor.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// Centre of the contact along the sensor's x, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "x")]
    x: Option<In<'a, Scalar>>,
    /// Centre of the contact along the sensor's y, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "y")]
    y: Option<In<'a, Scalar>>,
    /// Any image of the pad, for its size and pitch.
    #[port(unit = "_", frame = "A", sampled)]
    #[expect(dead_code, reason = "only its shape is used")]
    image: In<'a, Image>,
}

/// What `edge_guard` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion without the part that carries the contact toward the rim.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Whether outward motion is reduced: set when more than half of it is removed, cleared when none is removed.
    at_rim: Out<Flag>,
}

/// What `edge_guard` remembers.
#[derive(State)]
pub struct State {
    /// Last position of the contact, until it has been absent for long [m].
    contact: Option<[f64; 2]>,
    absence: Absence,
    /// The last output.
    at_rim: bool,
}

impl Node for EdgeGuard {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let Params { margin_tactels: margin, ramp_tactels: ramp } = params;
        let &ImageShape { rows, cols, pitch, .. } = &setup.inputs.image;
        let half = (rows.min(cols).max(1) as f64 - 1.0) / 2.0;
        if half <= 0.0 {
            let message = format!("a pad of {rows} by {cols} tactels has no middle: every contact on it is at the rim");
            return Err(Mistake::input("image", message).help("remove the `edge_guard`").into());
        }
        if margin + ramp > half {
            let message = format!(
                "a margin of {margin} and a ramp of {ramp} tactels leave no middle on a pad of {rows} by {cols} tactels"
            );
            let help = format!("`margin_tactels` and `ramp_tactels` may add up to at most {half} here");
            return Err(Mistake::param("margin_tactels", message).help(help).into());
        }
        let fence = |count, pitch| Fence::new(count, pitch, margin, ramp);
        Ok(Self { x: fence(cols, pitch[0]), y: fence(rows, pitch[1]) })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let contact = inputs.x.zip(inputs.y).map(|(x, y)| [*x, *y]);
        let is_forgotten = state.absence.is_long(contact.is_some(), tick);
        if contact.is_some() || is_forgotten {
            state.contact = contact;
        }
        let share = match state.contact {
            Some([x, y]) => {
                out.twist.set(guarded(&inputs.twist, [x, y], self.x, self.y));
                self.x.share(x, x).min(self.y.share(y, y))
            }
            None => {
                out.twist.set(*inputs.twist);
                1.0
            }
        };
        state.at_rim = if state.at_rim { share < 1.0 } else { share < 0.5 };
        out.at_rim.set(state.at_rim);
    }
}

#[cfg(test)]
mod tests;
