//! Contacts as TOML: one table for each object, and in it one for each feature.

use toml_edit::{Array, ArrayOfTables, Item, Table, Value};

use crate::motion::COMPONENTS;
use crate::tool::control::contacts::{Answer, Contact};
use crate::tool::guided::headed;

/// Name of the fact.
pub(super) const CONTACTS: &str = "contacts";

/// Returns contacts as the lines of a bench.
pub(super) fn lines(arm: &str, contacts: &[Contact]) -> String {
    headed(&["facts", arm], CONTACTS, tables(contacts)) + "\n"
}

/// Returns contacts as tables.
pub(super) fn tables(contacts: &[Contact]) -> ArrayOfTables {
    contacts.iter().map(table).collect()
}

fn table(contact: &Contact) -> Table {
    let mut table = Table::new();
    table.insert("object", contact.object.as_str().into());
    if contact.latency_ms > 0.0 {
        table.insert("latency_ms", contact.latency_ms.into());
    }
    for (feature, answer) in &contact.features {
        table.insert(feature, Item::Table(of_feature(answer)));
    }
    table
}

fn of_feature(answer: &Answer) -> Table {
    let Answer { resonance_hz, damping_ratio, latency_ms, play, ref response, .. } = *answer;
    let others =
        [("resonance_hz", resonance_hz), ("damping_ratio", damping_ratio), ("latency_ms", latency_ms), ("play", play)];
    let mut table = Table::new();
    let all = COMPONENTS.into_iter().zip(answer.entries()).chain(others);
    for (key, value) in all.filter_map(|(key, value)| Some((key, value?))) {
        table.insert(key, value.into());
    }
    if !response.is_empty() {
        table.insert("response", points(response).into());
    }
    table
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
    lines.for_each(|point| point.decor_mut().set_prefix("\n  "));
    list.set_trailing("\n");
    list.set_trailing_comma(true);
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_is_read_as_it_was_written() {
        let response = (1..=11).map(|i| [0.5 * f64::from(i), 1.0 + 0.25 * f64::from(i), -7.0 * f64::from(i)]).collect();
        let answer = Answer { vz: Some(7.0), latency_ms: Some(0.0), play: Some(0.002), response, ..Answer::default() };
        let contact =
            Contact { object: "pen".into(), latency_ms: 4.0, features: [("pressure".to_owned(), answer)].into() };
        let text = lines("arm", std::slice::from_ref(&contact));
        assert!(text.starts_with("[[facts.arm.contacts]]\nobject = \"pen\"\nlatency_ms = 4.0\n"), "{text}");
        let read: toml::Table = toml::from_str(&text).unwrap();
        let read = read["facts"]["arm"][CONTACTS].clone();
        assert_eq!(read.try_into::<Vec<Contact>>().unwrap(), [contact]);
        assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    }
}
