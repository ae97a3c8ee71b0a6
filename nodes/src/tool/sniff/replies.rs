//! Guesses the frames of a pad that answers questions: each answer is a frame.

use std::collections::BTreeMap;

use super::binary::{KNOWN, cells, checksum};
use super::heard::{Guess, Heard, rows_and_cols};
use super::text::rate;
use crate::devices::stream::checksum_size;

/// Number of answers from which a guess is made.
const MIN_ANSWERS: usize = 4;
/// Shortest answer [bytes].
const MIN_LENGTH: usize = 4;
/// Share of the questions with an answer of the usual length, in percent. The first ones may come too early for a board.
const MIN_USUAL_PERCENT: usize = 50;

/// Guesses the frames, if questions have answers of one length.
pub(super) fn guess(heard: &Heard) -> Option<Guess> {
    let ends = heard.asks.iter().skip(1).copied().chain([heard.bytes.len()]);
    let answers = heard.asks.iter().zip(ends).map(|(begin, end)| &heard.bytes[*begin..end]);
    let answers: Vec<&[u8]> = answers.filter(|answer| answer.len() >= MIN_LENGTH).collect();
    let mut counts = BTreeMap::<usize, usize>::new();
    answers.iter().for_each(|answer| *counts.entry(answer.len()).or_default() += 1);
    let (length, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
    if count < MIN_ANSWERS || 100 * count < MIN_USUAL_PERCENT * answers.len() {
        return None;
    }
    let frames: Vec<&[u8]> = answers.into_iter().filter(|answer| answer.len() == length).collect();
    // A tactel that nobody touches is constant too, so only a usual mark is one.
    let mark = KNOWN.iter().find(|mark| frames.iter().all(|frame| frame.starts_with(mark)));
    let check = checksum(&frames, 0);
    let end = length - check.as_deref().map_or(0, checksum_size);
    let (offset, cell, count) = cells(&frames, mark.map_or(0, |mark| mark.len()), end);
    let (rows, cols) = rows_and_cols(count);
    let digits = |mark: &[u8]| mark.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
    let mut findings =
        vec![format!("{} of {} questions have an answer of {length} bytes", frames.len(), heard.asks.len())];
    findings.extend(mark.map(|mark| format!("each has {} at its beginning", digits(mark))));
    findings.extend(check.as_ref().map(|check| format!("the checksum is {check}")));
    let mut keys = vec![("frame", "\"reply\"".to_owned(), "")];
    keys.extend(mark.map(|mark| ("mark", format!("\"hex:{}\"", digits(mark)), "")));
    keys.extend(check.map(|check| ("check", format!("{check:?}"), "")));
    keys.push(("length", length.to_string(), ""));
    keys.push(("cell", format!("{cell:?}"), "check it"));
    keys.push(("offset", offset.to_string(), ""));
    keys.push(("shape", format!("[{rows}, {cols}]"), "rows and columns; check them"));
    keys.push(("rate_hz", rate(frames.len(), heard.seconds), "as it was asked"));
    Some(Guess { findings, keys })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(answers: &[Vec<u8>]) -> Heard {
        let mut heard = Heard { seconds: 1.0, ..Heard::default() };
        for answer in answers {
            heard.asks.push(heard.bytes.len());
            heard.bytes.extend(answer);
        }
        heard
    }

    fn answer(n: usize) -> Vec<u8> {
        (0..256).map(|k| ((7 * n + 3 * k) % 251) as u8).collect()
    }

    #[test]
    fn each_answer_is_a_frame() {
        // Two questions that the board has not heard, and a greeting of the board.
        let mut answers = vec![Vec::new(), Vec::new(), b"ready\r\n".to_vec()];
        answers.extend((0..10).map(answer));
        let guess = guess(&heard(&answers)).expect("there are answers");
        let keys: Vec<String> = guess.keys.iter().map(|(key, value, _)| format!("{key} = {value}")).collect();
        for key in ["frame = \"reply\"", "length = 256", "offset = 0", "cell = \"u8\"", "shape = [16, 16]"] {
            assert!(keys.iter().any(|found| found == key), "{key}: {keys:?}");
        }
        assert_eq!(guess.findings[0], "10 of 13 questions have an answer of 256 bytes");
    }

    #[test]
    fn answers_of_any_length_and_no_questions_are_no_frames() {
        let answers: Vec<Vec<u8>> = (0..20).map(|n| answer(n)[..10 + 7 * n].to_vec()).collect();
        assert_eq!(guess(&heard(&answers)), None);
        assert_eq!(guess(&Heard { bytes: answer(0), ..Heard::default() }), None);
    }
}
