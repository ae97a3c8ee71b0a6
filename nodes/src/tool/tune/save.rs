//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::Outline;
use toml_edit::{Array, InlineTable, Value};

use super::cases::Stated;
use super::tuned::Tuned;
use super::{TuneArgs, gain_keys};
use crate::tool::control::contacts::{Answer, Contact};
use crate::tool::guided::BenchFile;

/// Writes all files, and returns what was written.
///
/// # Errors
/// If a file cannot be changed; then nothing is written.
pub(super) fn save(args: &TuneArgs, outline: &Outline, tuned: &Tuned, shell: &Shell) -> Result<String, String> {
    let mut graph = BenchFile::read(&args.graph)?;
    let mode = outline.modes.iter().find(|mode| mode.name == tuned.mode);
    for one in &tuned.features {
        let (Some(pid), Some(mode), Some(new)) = (&one.feature.pid, mode, one.new) else { continue };
        let keys = ["kp", "ki", "kd"].into_iter().zip(one.old).zip(new);
        for (key, gain) in keys.filter(|((_, old), new)| old != new).map(|((key, _), gain)| (key, gain)) {
            let path = gain_keys::gain_key(pid, &one.name, key, mode);
            let path: Vec<&str> = path.split('.').collect();
            let Some((last, section)) = path.split_last() else { continue };
            graph.set(section, last, gain)?;
        }
    }
    for range in &tuned.ranges {
        let path: Vec<&str> = ["live"].into_iter().chain(range.name.split('.')).collect();
        let Some((last, section)) = path.split_last() else { continue };
        graph.set(section, last, range.value())?;
    }
    let mut files = vec![graph];
    for Stated { file: bench, contacts } in tuned.stated() {
        let Some(bench) = bench else { continue };
        // A graph can have its own devices.
        let is_graph = bench == args.graph;
        if !is_graph {
            files.push(BenchFile::read(&bench)?);
        }
        let Some(file) = (if is_graph { files.first_mut() } else { files.last_mut() }) else { continue };
        file.set(&["facts", &tuned.arm], "contacts", lines(&contacts))?;
        if !is_graph {
            file.check(shell.catalogue())?;
        }
    }
    files.iter().try_for_each(BenchFile::write)?;
    let written = files.iter().map(|file| format!("wrote {}:\n{}\n", file.path().display(), file.changes()));
    Ok(written.collect::<String>().trim_end().to_owned())
}

/// Writes contacts as a list, each on its own line.
fn lines(contacts: &[Contact]) -> Array {
    let mut list = Array::from_iter(contacts.iter().map(value));
    list.iter_mut().for_each(|contact| contact.decor_mut().set_prefix("\n  "));
    list.set_trailing("\n");
    list.set_trailing_comma(true);
    list
}

/// Writes a contact as an inline table.
pub(super) fn value(contact: &Contact) -> Value {
    let mut table = InlineTable::new();
    table.insert("object", contact.object.as_str().into());
    if contact.latency_ms > 0.0 {
        table.insert("latency_ms", contact.latency_ms.into());
    }
    for (feature, answer) in &contact.features {
        table.insert(feature, inline(answer));
    }
    table.into()
}

fn inline(answer: &Answer) -> Value {
    let Answer { vx, vy, vz, wx, wy, wz, resonance_hz, damping_ratio, latency_ms, ref response } = *answer;
    let keys = [
        ("vx", vx),
        ("vy", vy),
        ("vz", vz),
        ("wx", wx),
        ("wy", wy),
        ("wz", wz),
        ("resonance_hz", resonance_hz),
        ("damping_ratio", damping_ratio),
        ("latency_ms", latency_ms),
    ];
    let mut table = InlineTable::new();
    for (key, value) in keys.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        table.insert(key, value.into());
    }
    if !response.is_empty() {
        table.insert("response", points(response).into());
    }
    table.into()
}

/// Number of points of a response on one line.
const POINTS_OF_A_LINE: usize = 6;

/// Writes a measured response: frequency, multiple and phase, several on a line.
fn points(response: &[[f64; 3]]) -> Array {
    let point = |[hz, multiple, phase]: &[f64; 3]| {
        Array::from_iter([Value::from(*hz), Value::from(*multiple), Value::from(*phase as i64)])
    };
    let mut list = Array::from_iter(response.iter().map(point));
    let lines = list.iter_mut().step_by(POINTS_OF_A_LINE);
    lines.for_each(|point| point.decor_mut().set_prefix("\n    "));
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_is_read_as_it_was_written() {
        let response = (1..=11).map(|i| [0.5 * f64::from(i), 1.0 + 0.25 * f64::from(i), -7.0 * f64::from(i)]).collect();
        let answer = Answer { vz: Some(7.0), latency_ms: Some(0.0), response, ..Answer::default() };
        let contact =
            Contact { object: "pen".into(), latency_ms: 4.0, features: [("pressure".to_owned(), answer)].into() };
        let text = format!("contacts = {}", lines(std::slice::from_ref(&contact)));
        let read: toml::Table = toml::from_str(&text).unwrap();
        assert_eq!(read["contacts"].clone().try_into::<Vec<Contact>>().unwrap(), [contact]);
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    }
}
