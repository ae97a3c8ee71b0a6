//! What the device understands of the bytes on its port, without a port.

use tactflow_runtime::node::Mistakes;

use super::Params;
use super::driver::StampClock;
use super::layout::Channels;
use super::messages::{Message, Messages};
use super::sensors::{assign, pads};

/// Returns the receiving end of a connection: messages, configurations with the pads that they serve, and images.
pub(crate) fn listen(params: &Params) -> Result<impl Fn(&[&[u8]]) -> Vec<String> + use<>, Mistakes> {
    let pads = pads(params.sensors.clone(), &params.layouts)?;
    Ok(move |pieces: &[&[u8]]| {
        let mut heard = Vec::new();
        let mut messages = Messages::default();
        let mut served = Vec::new();
        let mut clock = StampClock::default();
        let mut channels: Vec<Channels> = pads.iter().map(|_| Channels::default()).collect();
        let mut cells: Vec<Vec<f32>> = pads.iter().map(|pad| vec![0.0; pad.layout.rows * pad.layout.cols]).collect();
        for piece in pieces {
            messages.push(piece);
            loop {
                let config = match messages.next() {
                    None => break,
                    Some(Message::Config(config)) => config,
                    Some(Message::Frame(frame)) => {
                        let at = served.get(usize::from(frame.sensor) - 1).copied().flatten();
                        let image = at.filter(|at: &usize| {
                            pads[*at].layout.read(frame.payload, &mut channels[*at], &mut cells[*at])
                        });
                        let image = image.map(|at| &cells[at]);
                        heard.push(format!("frame {} {} {image:?}", frame.sensor, clock.ticks(frame.stamp)));
                        continue;
                    }
                    Some(other) => {
                        heard.push(format!("{other:?}"));
                        continue;
                    }
                };
                messages.configure(&config);
                let assigned = assign(&pads, &config);
                heard.push(format!("{config:?} {assigned:?}"));
                served = assigned.unwrap_or_default();
            }
        }
        heard.push(format!("{:?}", messages.counts));
        heard
    })
}
