//! Guesses the frames in a text: a line each, or several lines up to a mark.

use super::heard::{Guess, Heard, rows_and_cols};

/// Share of bytes that belong to a text, in percent.
const MIN_TEXT_PERCENT: usize = 97;
/// Number of lines from which a guess is made.
const MIN_LINES: usize = 5;

/// Guesses the frames, if the bytes are a text of numbers.
pub(super) fn guess(heard: &Heard) -> Option<Guess> {
    let bytes = &heard.bytes;
    let is_text = |byte: &&u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    if bytes.iter().filter(is_text).count() * 100 < bytes.len() * MIN_TEXT_PERCENT {
        return None;
    }
    let text = String::from_utf8_lossy(bytes);
    let mut lines: Vec<&str> = text.split('\n').map(str::trim).collect();
    // The first line has lost its beginning, and the last one its end.
    lines.pop();
    lines.drain(..1.min(lines.len()));
    let counts: Vec<Option<usize>> = lines.iter().map(|line| numbers(line)).collect();
    let usual = most_frequent(counts.iter().flatten().copied())?;
    let rows: Vec<bool> = counts.iter().map(|count| *count == Some(usual)).collect();
    if rows.iter().filter(|is_row| **is_row).count() < MIN_LINES {
        return None;
    }
    let mut blocks: Vec<usize> = rows.split(|is_row| !is_row).map(<[bool]>::len).filter(|length| *length > 0).collect();
    // The ends are cut off.
    if blocks.len() > 2 {
        blocks = blocks[1..blocks.len() - 1].to_vec();
    }
    let block = most_frequent(blocks.iter().copied()).unwrap_or(1);
    let is_block =
        block > 1 && blocks.len() >= 3 && blocks.iter().filter(|length| **length == block).count() * 2 > blocks.len();
    let mut findings = vec![format!("{} lines of {usual} numbers", rows.iter().filter(|is_row| **is_row).count())];
    let mut keys = vec![("frame", "\"lines\"".to_owned(), ""), ("cell", "\"dec\"".to_owned(), "")];
    let (shape, frames) = if is_block {
        let ends = lines.iter().zip(&rows).filter(|(_, is_row)| !**is_row).map(|(line, _)| *line);
        let mark = ends.clone().find(|line| line.is_empty()).or_else(|| ends.clone().next()).unwrap_or_default();
        // A number in the line would change.
        let mark = mark.split(|c: char| c.is_ascii_digit()).next().unwrap_or_default().trim();
        findings.push(format!("after {block} of them comes the line `{mark}`"));
        keys.push(("mark", format!("{mark:?}"), "the line that ends a frame"));
        ((block, usual), blocks.len())
    } else {
        (rows_and_cols(usual), rows.iter().filter(|is_row| **is_row).count())
    };
    keys.push(("shape", format!("[{}, {}]", shape.0, shape.1), "rows and columns; check them"));
    keys.push(("rate_hz", rate(frames, heard.seconds), "as it was heard"));
    Some(Guess { findings, keys })
}

/// Returns how many numbers a line has, if it has nothing else.
fn numbers(line: &str) -> Option<usize> {
    let words = line.split([',', ';', ' ', '\t']).filter(|word| !word.is_empty());
    let all = words.clone().all(|word| word.parse::<f64>().is_ok());
    Some(words.count()).filter(|count| all && *count > 0)
}

fn most_frequent(values: impl Iterator<Item = usize>) -> Option<usize> {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    values.for_each(|value| *counts.entry(value).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map(|(value, _)| value)
}

/// Returns a rate in frames per second, as a description writes it.
pub(super) fn rate(frames: usize, seconds: f64) -> String {
    let rate = frames as f64 / seconds.max(1e-3);
    format!("{:.1}", rate.clamp(0.1, 1e5))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(text: &str) -> Option<Vec<String>> {
        let heard = Heard { bytes: text.as_bytes().to_vec(), pauses: vec![0], seconds: 1.0, asks: Vec::new() };
        guess(&heard).map(|guess| guess.keys.iter().map(|(key, value, _)| format!("{key} = {value}")).collect())
    }

    #[test]
    fn lines_of_numbers_are_frames_or_rows() {
        let row = |count: usize| vec!["12"; count].join(",");
        let lines = keys(&format!("34,12\n{}", format!("{}\r\n", row(256)).repeat(8))).unwrap();
        assert!(lines.contains(&"shape = [16, 16]".to_owned()) && lines.len() == 4, "{lines:?}");
        for (end, mark) in [("\n", "mark = \"\""), ("END\n", "mark = \"END\""), ("frame 7\n", "mark = \"frame\"")] {
            let block = format!("{}{end}", format!("{}\n", row(8)).repeat(4));
            let rows = keys(&format!("2,2\n{}", block.repeat(6))).unwrap();
            assert!(rows.contains(&mark.to_owned()) && rows.contains(&"shape = [4, 8]".to_owned()), "{rows:?}");
        }
    }

    #[test]
    fn other_text_is_no_frame() {
        assert_eq!(keys(&"hello\n".repeat(20)), None);
        assert_eq!(keys("1,2\n3"), None);
        assert_eq!(keys("\u{fffd}\u{fffd}\u{fffd}"), None);
    }
}
