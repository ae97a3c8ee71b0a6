//! What the device understands of the lines of a simulator, and what it answers, without a connection.

use super::frames::Frames;
use super::lines::Lines;
use super::message::{self, Reply};
use super::{Params, describe};

/// Returns the receiving end of a connection: the description of the device, and for each frame the command that answers
/// it. It ends at the first mistake, as a run does.
pub(crate) fn listen(params: Params) -> impl Fn(&[&[u8]]) -> Vec<String> {
    move |pieces| {
        let mut heard = Vec::new();
        if let Err(why) = follow(&params, pieces, &mut heard) {
            heard.push(Reply::End { reason: &why }.line());
        }
        heard
    }
}

fn follow(params: &Params, pieces: &[&[u8]], heard: &mut Vec<String>) -> Result<(), String> {
    let (mut lines, mut frames) = (Lines::default(), None);
    for piece in pieces {
        let mut taken = 0;
        while taken < piece.len() {
            let (count, line) = lines.feed(&piece[taken..]);
            taken += count;
            let Some(line) = line? else { continue };
            let Some(frames) = &mut frames else {
                let hello = message::hello(&line).map_err(|why| format!("hello (line 1): {why}"))?;
                let (description, ..) = describe(&hello, params).map_err(|mistakes| format!("{mistakes:?}"))?;
                heard.push(format!("{hello:?} {description:?}"));
                frames = Some(Frames::new(hello));
                continue;
            };
            let frame = frames.read(&line, lines.count).inspect_err(|_| {
                heard.push(format!("unanswered: {:?}", message::seq_of(&line)));
            })?;
            let Some(obs) = frame else { return Ok(()) };
            heard.push(Reply::Cmd { seq: obs.seq, dq: &obs.q_eq, est: None }.line());
        }
    }
    Ok(())
}
