//! Compares the ports of two runs, tick by tick: which differ, from when, and by how much.

use std::collections::BTreeMap;

use serde_json::Value;

use super::json::base64;

/// A message of a port: its name, the time of its sample after time zero \[ns\], and its JSON.
pub(super) struct PortMessage<'m> {
    pub(super) port: &'m str,
    pub(super) stamp: i64,
    pub(super) data: &'m [u8],
}

/// How a port differs between two runs.
#[derive(Debug, Clone, PartialEq)]
pub struct PortDifference {
    /// Place among the ports that differ, in the order of the ports within a tick.
    pub order: usize,
    /// Number of the first tick in which it differs.
    pub tick: u64,
    /// Time of that tick in the graph's clock \[ns\].
    pub time: i64,
    /// Component that differs in that tick; empty for the value itself.
    pub component: String,
    /// The two values of that component.
    pub values: [String; 2],
    /// Number of ticks in which the port was written and differs.
    pub ticks: u64,
    /// Largest difference of two numbers, its component, and the time of its tick \[ns\]; `None` if no number differs.
    pub largest: Option<(f64, String, i64)>,
}

/// The stamp of a message \[ns\], and its JSON.
type LastMessage = (i64, Vec<u8>);

/// The differences of all ports.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Differences {
    /// The ports that differ.
    pub ports: BTreeMap<String, PortDifference>,
    /// The last message of each port in both runs: its stamp and its JSON.
    last: BTreeMap<String, [Option<LastMessage>; 2]>,
}

/// A part of a message.
#[derive(Debug, Clone, PartialEq)]
enum Leaf {
    Number(f64),
    Text(String),
}

impl Leaf {
    fn text(&self) -> String {
        match self {
            Self::Number(number) => format!("{number:?}"),
            Self::Text(text) => text.clone(),
        }
    }

    /// Whether two parts are the same to the last bit.
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Number(a), Self::Number(b)) => a.to_bits() == b.to_bits(),
            (a, b) => a == b,
        }
    }
}

impl Differences {
    /// Compares the messages of a tick in both runs. Returns whether they are the same.
    pub(super) fn add(&mut self, (tick, time): (u64, i64), runs: [&[PortMessage<'_>]; 2]) -> bool {
        let is_same = |(a, b): (&PortMessage<'_>, &PortMessage<'_>)| {
            (a.port, a.stamp, timeless(a.data)) == (b.port, b.stamp, timeless(b.data))
        };
        let are_same = runs[0].len() == runs[1].len() && runs[0].iter().zip(runs[1]).all(is_same);
        let written = self.take_over(runs);
        if are_same {
            return true;
        }
        let mut is_equal = true;
        for port in written {
            let [a, b] = &self.last[&port];
            let fresh = runs.map(|run| run.iter().any(|message| message.port == port));
            let is_same = match (a, b) {
                (Some((a_stamp, a)), Some((b_stamp, b))) => a_stamp == b_stamp && timeless(a) == timeless(b),
                (a, b) => a == b,
            };
            if is_same && fresh[0] == fresh[1] {
                continue;
            }
            is_equal = false;
            let (component, values, largest) = compare(a.as_ref(), b.as_ref(), fresh);
            let order = self.ports.len();
            let difference = self.ports.entry(port).or_insert_with(|| PortDifference {
                order,
                tick,
                time,
                component,
                values,
                ticks: 0,
                largest: None,
            });
            difference.ticks += 1;
            if let Some((by, component)) = largest
                && difference.largest.as_ref().is_none_or(|(known, ..)| by > *known)
            {
                difference.largest = Some((by, component, time));
            }
        }
        is_equal
    }

    /// Keeps the messages of a tick. Returns the ports that were written in either run.
    fn take_over(&mut self, runs: [&[PortMessage<'_>]; 2]) -> Vec<String> {
        let mut written: Vec<String> = Vec::new();
        for (run, messages) in runs.iter().enumerate() {
            for message in *messages {
                if !self.last.contains_key(message.port) {
                    self.last.insert(message.port.to_owned(), [None, None]);
                }
                let last = self.last.get_mut(message.port).expect("it was just inserted");
                let (stamp, data) = last[run].get_or_insert_default();
                *stamp = message.stamp;
                data.clear();
                data.extend_from_slice(message.data);
                if !written.iter().any(|port| port == message.port) {
                    written.push(message.port.to_owned());
                }
            }
        }
        written
    }
}

/// The first component that differs, its values, and the largest difference of two numbers with its component.
type Compared = (String, [String; 2], Option<(f64, String)>);

fn compare(a: Option<&LastMessage>, b: Option<&LastMessage>, fresh: [bool; 2]) -> Compared {
    let parts = [a, b].map(|message| message.map(|(_, data)| leaves(data)).unwrap_or_default());
    let mut first: Option<(String, [String; 2])> = None;
    let mut largest: Option<(f64, String)> = None;
    for (name, one) in &parts[0] {
        let Some(other) = parts[1].get(name).filter(|other| !one.is_same(other)) else { continue };
        first.get_or_insert_with(|| (name.clone(), [one.text(), other.text()]));
        if let (Leaf::Number(one), Leaf::Number(other)) = (one, other) {
            let by = (one - other).abs();
            if largest.as_ref().is_none_or(|(known, _)| by > *known) {
                largest = Some((by, name.clone()));
            }
        }
    }
    let missing =
        parts[0].keys().chain(parts[1].keys()).find(|name| parts.iter().any(|part| !part.contains_key(*name)));
    let (component, values) = first.unwrap_or_else(|| match (missing, fresh) {
        (Some(name), _) => {
            let text = |part: &BTreeMap<String, Leaf>| part.get(name).map_or_else(|| "missing".into(), Leaf::text);
            (name.clone(), [text(&parts[0]), text(&parts[1])])
        }
        (None, [true, true]) => {
            let stamp =
                |message: Option<&(i64, Vec<u8>)>| message.map_or_else(String::new, |(stamp, _)| format!("{stamp} ns"));
            ("time of the sample".to_owned(), [stamp(a), stamp(b)])
        }
        (None, fresh) => {
            let text = |is_new: bool| if is_new { "new" } else { "not new" }.to_owned();
            ("freshness".to_owned(), fresh.map(text))
        }
    });
    (component, values, largest)
}

/// Returns a message without the time at its start, which is a date in a run in real time. The stamp
/// of the message is the time of its sample in the run.
fn timeless(data: &[u8]) -> &[u8] {
    let Some(rest) = data.strip_prefix(b"{\"timestamp\":{") else { return data };
    rest.iter().position(|byte| *byte == b'}').map_or(data, |end| &rest[end..])
}

/// Returns the parts of a message without its time, by name.
fn leaves(data: &[u8]) -> BTreeMap<String, Leaf> {
    let mut parts = BTreeMap::new();
    if let Ok(Value::Object(message)) = serde_json::from_slice(data) {
        let cells = message.get("fields").and_then(|_| cells(&message));
        for (name, value) in &message {
            match (name.as_str(), &cells) {
                ("t" | "timestamp", _) => {}
                ("data", Some(cells)) => parts.extend(cells.iter().cloned()),
                _ => add(name, value, &mut parts),
            }
        }
    }
    parts
}

fn add(name: &str, value: &Value, parts: &mut BTreeMap<String, Leaf>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| add(&format!("{name}.{key}"), value, parts)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, value)| add(&format!("{name}[{i}]"), value, parts)),
        Value::Number(number) => drop(parts.insert(name.to_owned(), Leaf::Number(number.as_f64().unwrap_or(f64::NAN)))),
        Value::String(text) => drop(parts.insert(name.to_owned(), Leaf::Text(text.clone()))),
        Value::Null => drop(parts.insert(name.to_owned(), Leaf::Text("absent".to_owned()))),
        Value::Bool(flag) => drop(parts.insert(name.to_owned(), Leaf::Text(flag.to_string()))),
    }
}

/// Returns the cells of a grid, each with its row and column.
fn cells(message: &serde_json::Map<String, Value>) -> Option<Vec<(String, Leaf)>> {
    let columns = message.get("column_count")?.as_u64()?.max(1) as usize;
    let values = grid_values(message)?;
    let axes = grid_fields(message);
    let cell = |(i, value): (usize, f32)| {
        let (tactel, axis) = (i / axes, ["x", "y", "z"].get(i % axes).filter(|_| axes > 1));
        let place = format!("row {}, column {}", tactel / columns, tactel % columns);
        (axis.map_or(place.clone(), |axis| format!("{place}, {axis}")), Leaf::Number(value.into()))
    };
    Some(values.into_iter().enumerate().map(cell).collect())
}

/// Returns the number of fields of each cell of a grid: 3 of a vector image, 1 of other images.
pub(super) fn grid_fields(message: &serde_json::Map<String, Value>) -> usize {
    message.get("fields").and_then(Value::as_array).map_or(1, Vec::len).max(1)
}

/// Returns the values of a grid, row by row, and field by field in each cell.
pub(super) fn grid_values(message: &serde_json::Map<String, Value>) -> Option<Vec<f32>> {
    let bytes = base64(message.get("data")?.as_str()?)?;
    Some(match message.get("cell_stride")?.as_u64()? {
        1 => bytes.into_iter().map(f32::from).collect(),
        _ => bytes.chunks_exact(4).filter_map(|bytes| Some(f32::from_le_bytes(bytes.try_into().ok()?))).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message<'m>(port: &'m str, stamp: i64, data: &'m str) -> PortMessage<'m> {
        PortMessage { port, stamp, data: data.as_bytes() }
    }

    #[test]
    fn the_first_tick_the_component_and_the_largest_difference_are_found() {
        let mut differences = Differences::default();
        let ticks = [
            ("{\"t\":0.0,\"x\":1.0,\"y\":2.0}", "{\"t\":0.0,\"x\":1.0,\"y\":2.0}"),
            ("{\"t\":0.1,\"x\":1.0,\"y\":2.0}", "{\"t\":0.1,\"x\":1.0,\"y\":2.5}"),
            ("{\"t\":0.2,\"x\":1.0,\"y\":null}", "{\"t\":0.2,\"x\":-3.0,\"y\":2.5}"),
        ];
        for (i, (a, b)) in ticks.iter().enumerate() {
            let (a, b) = ([message("p", 0, a)], [message("p", 0, b)]);
            assert_eq!(differences.add((i as u64 + 1, i as i64), [&a, &b]), i == 0);
        }
        let found = &differences.ports["p"];
        assert_eq!((found.tick, found.component.as_str(), found.ticks), (2, "y", 2));
        assert_eq!(found.values, ["2.0", "2.5"]);
        assert_eq!(found.largest, Some((4.0, "x".to_owned(), 2)));
    }

    #[test]
    fn a_sign_of_zero_a_stamp_and_a_missing_message_are_differences() {
        let cases = [
            ([("p", 0, "{\"x\":0.0}")], [("p", 0, "{\"x\":-0.0}")], "x"),
            ([("p", 0, "{\"x\":0.0}")], [("p", 1, "{\"x\":0.0}")], "time of the sample"),
        ];
        for (a, b, component) in cases {
            let mut differences = Differences::default();
            let [a, b] = [a, b].map(|run| run.map(|(port, stamp, data)| message(port, stamp, data)));
            assert!(!differences.add((1, 0), [&a, &b]));
            assert_eq!(differences.ports["p"].component, component);
        }
        let mut differences = Differences::default();
        let a = [message("p", 0, "{\"x\":0.0}")];
        assert!(differences.add((1, 0), [&a, &a]) && !differences.add((2, 1), [&a, &[]]));
        assert_eq!(differences.ports["p"].component, "freshness");
    }

    #[test]
    fn the_day_of_a_run_is_no_difference() {
        let [a, b, c] = [(0, 1.0), (1_700_000_000, 1.0), (0, 2.0)].map(|(day, x)| {
            format!("{{\"timestamp\":{{\"sec\":{day},\"nsec\":4}},\"frame_id\":\"base\",\"x\":{x:?}}}")
        });
        let mut differences = Differences::default();
        assert!(differences.add((1, 4), [&[message("p", 4, &a)], &[message("p", 4, &b)]]));
        assert!(!differences.add((2, 8), [&[message("p", 4, &c)], &[message("p", 4, &b)]]));
        assert_eq!(differences.ports["p"].component, "x");
    }

    #[test]
    fn an_image_differs_in_a_cell() {
        let grid = |data: &str| format!("{{\"column_count\":1,\"cell_stride\":4,\"fields\":[],\"data\":\"{data}\"}}");
        let (one, other) = (grid("AACAPwAAAAA="), grid("AACAPwAAAD8="));
        let mut differences = Differences::default();
        differences.add((1, 0), [&[message("p", 0, &one)], &[message("p", 0, &other)]]);
        let found = &differences.ports["p"];
        assert_eq!((found.component.as_str(), &found.values), ("row 1, column 0", &["0.0".into(), "0.5".into()]));
    }
}
