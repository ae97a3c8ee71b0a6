//! What the driver understands of the bytes of a pad, without a link.

use tactflow_runtime::node::Mistakes;

use super::plan::Plan;
use super::plan::params::Params;
use super::reader::Reader;

/// Returns the receiving end of a connection: images with the number and the time of their frames, and the counts. A pad
/// that is polled is asked before each piece.
pub(crate) fn listen(params: &Params) -> Result<impl Fn(&[&[u8]]) -> Vec<String> + use<>, Mistakes> {
    let plan = Plan::new(params)?;
    Ok(move |pieces: &[&[u8]]| {
        let (mut reader, mut heard) = (Reader::new(plan.clone()), Vec::new());
        let mut cells = reader.cells();
        for piece in pieces {
            if plan.poll.is_some() {
                reader.ask();
            }
            reader.push(piece, false);
            while let Some(read) = reader.next(&mut cells) {
                heard.push(format!("{read:?} {cells:?}"));
            }
        }
        heard.push(format!("{:?} {} {}", reader.tally, reader.is_waiting(), reader.is_ambiguous()));
        heard
    })
}
