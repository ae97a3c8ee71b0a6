//! What the driver understands of the packets of a controller, without a connection.

use super::packet::{self, Splitter};
use super::recipe::{Output, Recipe};
use super::rtde::{RECEIVED_BYTES, controller_version};
use super::status::{Allowed, is_playing, is_stopped, runtime_name};

/// Reads packets: the versions, the recipe of the outputs and the states that follow it, and texts.
pub(crate) fn listen(pieces: &[&[u8]]) -> Vec<String> {
    let (mut splitter, mut recipe, mut heard) = (Splitter::new(RECEIVED_BYTES), None, Vec::new());
    let allowed = Allowed { reduced: false, min_speed_fraction: 1.0 };
    for piece in pieces {
        splitter.feed(piece);
        loop {
            let (command, payload) = match splitter.take() {
                Ok(Some(packet)) => packet,
                Ok(None) => break,
                Err(why) => {
                    heard.push(why);
                    return heard;
                }
            };
            heard.push(match command {
                packet::OUTPUTS => {
                    let read = Recipe::read(&Output::all(), payload);
                    let said = format!("{read:?}");
                    recipe = read.ok();
                    said
                }
                packet::CONTROLLER => format!("{:?}", controller_version(payload)),
                packet::TEXT => format!("{:?}", packet::text(payload)),
                packet::SAMPLE => {
                    let state = recipe.as_ref().and_then(|recipe: &Recipe| recipe.state(payload));
                    let status = state.as_ref().map(|state| {
                        (allowed.refusal(state), is_playing(state), is_stopped(state), runtime_name(state))
                    });
                    format!("{state:?} {status:?}")
                }
                other => format!("packet {other}"),
            });
        }
    }
    heard
}
