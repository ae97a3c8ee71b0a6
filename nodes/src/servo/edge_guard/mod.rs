//! `edge_guard`: keeps the finger off the pad's rim: near it, only motion that brings the contact inward passes whole.
//!
//! A contact at p = (x, y, 0) of an object that rests moves over the pad with dp/dt = -(v + omega x p), so
//!
//! ```text
//! dx/dt = -vx + wz y        dy/dt = -vy - wz x
//! ```
//!
//! What of this goes toward the rim is taken away by a correction of vx and vy alone; it is all of it from the margin
//! on, and a share that grows linearly over a ramp before it. A turn wz goes on: the sensor then turns about the contact
//! and no more about its own middle. Rolling over an object of radius R adds -R wy to dx/dt and R wx to dy/dt; R is
//! unknown, but not its sign, so wx and wy are scaled by themselves when they roll toward the rim.
//!
//! Invariant: the twist is a continuous function of the contact and of what comes in, and what goes inward passes
//! unchanged, bit for bit.

use tactflow_runtime::node::{Mistake, Mistakes, Node, NonNegative, Positive, Setup, Tick};
use tactflow_runtime::signal::Twist;
use tactflow_runtime::{inputs, outputs, params, state};

params! {
    /// How far from the centres of the outermost tactels the contact stays [tactel].
    margin_tactels: NonNegative = NonNegative(2.0),
    /// Width of the zone before the margin in which motion toward the rim fades out [tactel].
    ramp_tactels: Positive = Positive(1.0),
}

inputs! {
    /// What is about to be commanded, in the sensor's frame [m/s, rad/s].
    twist: Twist["A"],
    /// Centre of the contact along the sensor's x from the pad's middle [m].
    x: Trigger<Scalar["m", "A"]>,
    /// Centre of the contact along the sensor's y from the pad's middle [m].
    y: Trigger<Scalar["m", "A"]>,
    /// Any image of the pad: its size and pitch count, not its values.
    image: Sampled<Image["_", "A"]>,
}

outputs! {
    /// The same without what would carry the contact further toward the rim [m/s, rad/s].
    twist: Twist["A"],
    /// Whether motion toward the rim is held back: set when half of it is, until none is.
    at_rim: Flag,
}

state! {
    /// Where the contact is, or was a moment ago [m].
    contact: Option<[f64; 2]>,
    /// When it went away, if it did [ns].
    lost_at: Option<i64>,
    /// Whether it is at the rim.
    at_rim: bool,
}

/// How far the contact may go.
pub struct EdgeGuard {
    x: Fence,
    y: Fence,
}

/// How far the contact may go along one axis.
#[derive(Debug, Clone, Copy)]
struct Fence {
    /// Furthest from the middle [m].
    margin: f64,
    /// Width of the zone before [m].
    ramp: f64,
}

impl tactflow_runtime::node::Describe for EdgeGuard {
    const NAME: &'static str = "edge_guard";
    const SUMMARY: &'static str = "keeps the finger off the pad's rim: near it only motion inward passes whole";
    const DOC: &'static str = "A contact that slides off the pad is lost, and one that is cut off by the rim has a \
        wrong centre of gravity. So near the rim this node takes away what would carry the contact further out. It \
        is the edge guard of the authors' later code, which held the centre of gravity within tactels 2 to 13 of \
        16.\n\n\
        The contact of an object that rests moves with dx/dt = -vx + wz y and dy/dt = -vy - wz x over the pad. Of \
        what goes outward, all passes in the middle and nothing from `margin_tactels` on; over `ramp_tactels` \
        before it the share falls linearly, so nothing chatters at a border. Only vx and vy are corrected: a turn \
        about z goes on, but about the contact. Rolling outward (wy < 0 at the +x side, wx > 0 at the +y side, and \
        the other way round) is scaled by the same share. Motion inward, vz and wz pass unchanged.\n\n\
        Put it last before the `adjoint`, behind the `twist_adder`, so that guidance is guarded as well. The \
        output is as old as the contact or the twist, whichever is older: a pad that falls silent lets the sink \
        fade.\n\n\
        Without a contact everything passes: there is nothing to keep, and an approach must get through. A contact \
        that flickers is remembered for the graph's `reset_after_ms`. A sign convention other than that of \
        `inverse_jacobian`'s example needs no change here, as only the geometry counts. An object that moves by \
        itself can still leave the pad.";
    const EXAMPLE: &'static str = r#"
[nodes.edge_guard]
type = "edge_guard"
in.twist = "sum.twist"
in.x = "moments.x"
in.y = "moments.y"
in.image = "calibrate.image"
margin_tactels = 2.0                # tactels 2 to 13 of 16
ramp_tactels = 1.0
"#;
}

impl Node for EdgeGuard {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.image;
        let mut mistakes = Mistakes::new();
        for (input, is_wired) in [("x", setup.inputs.x.is_some()), ("y", setup.inputs.y.is_some())] {
            if !is_wired {
                // It may be absent, but a guard that never knows of a contact is a wire that was forgotten.
                mistakes.push(crate::unwired(
                    <Self as tactflow_runtime::node::Describe>::NAME,
                    input,
                    "a scalar",
                    &format!("moments.{input}"),
                ));
            }
        }
        let (margin, ramp) = (*params.margin_tactels, *params.ramp_tactels);
        let half = (shape.rows.min(shape.cols).max(1) as f64 - 1.0) / 2.0;
        let (rows, cols) = (shape.rows, shape.cols);
        if half <= 0.0 {
            let message = format!("{rows} by {cols} tactels have no middle: a contact on them is always at the rim");
            mistakes.push(Mistake::input("image", message).help("leave the `edge_guard` out"));
        } else if margin + ramp > half {
            let message = format!(
                "a margin of {margin} and a ramp of {ramp} tactels leave no middle of {rows} by {cols} tactels"
            );
            let help = format!("`margin_tactels` and `ramp_tactels` together may be {half} here");
            mistakes.push(Mistake::param("margin_tactels", message).help(help));
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let fence = |count: usize, pitch: f64| Fence {
            margin: ((count as f64 - 1.0) / 2.0 - margin) * pitch,
            ramp: ramp * pitch,
        };
        Ok(Self { x: fence(shape.cols, shape.pitch[0]), y: fence(shape.rows, shape.pitch[1]) })
    }

    fn state(&self) -> State {
        State { contact: None, lost_at: None, at_rim: false }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.see(inputs.x.zip(inputs.y).map(|(x, y)| [*x, *y]), tick);
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

impl State {
    /// Takes over where the contact is; what flickers is still there.
    fn see(&mut self, contact: Option<[f64; 2]>, tick: &Tick) {
        if contact.is_some() {
            (self.contact, self.lost_at) = (contact, None);
        } else if tick.now - *self.lost_at.get_or_insert(tick.now) >= tick.reset_after {
            self.contact = None;
        }
    }
}

impl Fence {
    /// How much passes of a motion of the contact from `place` in the direction of `speed`: 1 in the middle, 0 from the
    /// margin on.
    fn share(self, place: f64, speed: f64) -> f64 {
        let room = if speed > 0.0 { self.margin - place } else { self.margin + place };
        (room / self.ramp).clamp(0.0, 1.0)
    }

    /// How much of `speed` does not pass.
    fn excess(self, place: f64, speed: f64) -> f64 {
        (1.0 - self.share(place, speed)) * speed
    }
}

/// The twist without what carries a contact at (x, y) toward the rim.
fn guarded(twist: &Twist, [x, y]: [f64; 2], along_x: Fence, along_y: Fence) -> Twist {
    let [vx, vy, vz, wx, wy, wz] = twist.0.into();
    Twist(
        [
            vx + along_x.excess(x, wz * y - vx),
            vy + along_y.excess(y, -wz * x - vy),
            vz,
            wx * along_y.share(y, wx),
            wy * along_x.share(x, -wy),
            wz,
        ]
        .into(),
    )
}

#[cfg(test)]
mod tests;
