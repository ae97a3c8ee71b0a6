//! Which sensor of a device is which pad of the bench.

use std::fmt::Write;

use tactflow_runtime::node::{At, Map, Mistake, Mistakes, Param};
use tactflow_runtime::source::Code;

use super::layout::{BUILTIN, Layout, LayoutParams};
use super::messages::{Config, SensorType, VERSION};

/// A sensor of the device.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub(super) struct SensorParams {
    /// Name of the pad if the device has several, for the bench: `left_pad = "skin.left"`.
    side: Option<String>,
    /// Its place in the configuration of the device, from 1. Without it and without `uid`, the first one whose payload
    /// has the length of the layout, and that no other pad takes.
    #[param(range = 1..=201)]
    number: Option<usize>,
    /// Its type in the configuration of the device.
    #[param(range = 0..=65_535)]
    uid: Option<usize>,
    /// Layout of its payload: `myrmex_v2` (16 by 16 tactels, 512 bytes), `glove` (64 tactels with their ids, 192
    /// bytes), or one of `layouts`.
    #[param(default = "myrmex_v2")]
    layout: String,
}

/// A pad of the bench.
#[derive(Debug, Clone)]
pub(super) struct Pad {
    pub(super) side: Option<String>,
    number: Option<usize>,
    uid: Option<usize>,
    layout_name: String,
    pub(super) layout: Layout,
}

/// Returns the pads of the bench.
///
/// # Errors
/// Every unknown layout, layout with a wrong order, and name of a side that is missing or used twice.
pub(super) fn pads(sensors: Vec<SensorParams>, layouts: &Map<LayoutParams>) -> Result<Vec<Pad>, Mistakes> {
    let mut mistakes = Mistakes::new();
    let mut own = Vec::new();
    for (name, params) in &layouts.0 {
        let path = format!("layouts.{name}");
        match Layout::of(params, &path) {
            _ if BUILTIN.contains(&name.as_str()) => {
                let message = format!("the layout `{name}` is built in: give yours another name");
                mistakes.push(Mistake::key(path, message));
            }
            Ok(layout) => own.push((name.as_str(), layout)),
            Err(mistake) => mistakes.push(mistake),
        }
    }
    if sensors.is_empty() {
        mistakes.push(Mistake::param("sensors", "the device needs a sensor: leave `sensors` out for the first one"));
    }
    let mut pads: Vec<Pad> = Vec::new();
    let has_several = sensors.len() > 1;
    for (i, SensorParams { side, number, uid, layout }) in sensors.into_iter().enumerate() {
        if has_several && side.is_none() {
            let message = format!("the device has several sensors, so the sensor {} needs a `side`", i + 1);
            mistakes.push(Mistake::new(Code::MissingKey, At::Param("sensors".into()), message));
        }
        if side.is_some() && pads.iter().any(|pad| pad.side == side) {
            let message = format!("two sensors have the side `{}`", side.as_deref().unwrap_or_default());
            mistakes.push(Mistake::param("sensors", message));
        }
        let found = own.iter().find(|(name, _)| *name == layout).map(|(_, layout)| layout.clone());
        match found.or_else(|| Layout::builtin(&layout)) {
            Some(found) => pads.push(Pad { side, number, uid, layout_name: layout, layout: found }),
            None if layouts.0.contains_key(&layout) => {}
            None => {
                let known = BUILTIN.into_iter().chain(own.iter().map(|(name, _)| *name));
                let mistake = Mistake::param("sensors", format!("no layout is called `{layout}`"));
                mistakes.push(mistake.suggest(&layout, known, "layouts"));
            }
        }
    }
    if mistakes.is_empty() { Ok(pads) } else { Err(mistakes) }
}

/// Returns the pad that each sensor of the device serves; `None` for a sensor that serves none.
///
/// # Errors
/// If a pad has no sensor, with the sensors that the device has.
pub(super) fn assign(pads: &[Pad], config: &Config) -> Result<Vec<Option<usize>>, String> {
    if config.version != VERSION {
        return Err(format!("the device speaks version {} of the protocol, and not {VERSION}", config.version));
    }
    let mut served = vec![None; config.sensors.len()];
    // Pads that name their sensor come first.
    let (named, others): (Vec<_>, Vec<_>) =
        pads.iter().enumerate().partition(|(_, pad)| pad.number.is_some() || pad.uid.is_some());
    for (i, pad) in named.into_iter().chain(others) {
        let fits = |at: usize, sensor: &SensorType| {
            pad.number.is_none_or(|number| number == at + 1)
                && pad.uid.is_none_or(|uid| uid == usize::from(sensor.uid))
                && usize::from(sensor.bytes) == pad.layout.bytes()
        };
        let found = (0..served.len()).find(|at| served[*at].is_none() && fits(*at, &config.sensors[*at]));
        served[found.ok_or_else(|| missing(pad, config))?] = Some(i);
    }
    Ok(served)
}

/// Returns the message about a pad without a sensor.
fn missing(pad: &Pad, config: &Config) -> String {
    let mut message = "no free sensor of the device ".to_owned();
    // Writing to a text does not fail.
    if let Some(number) = pad.number {
        let _ = write!(message, "is its number {number} and ");
    }
    if let Some(uid) = pad.uid {
        let _ = write!(message, "has the uid 0x{uid:04X} and ");
    }
    let _ = write!(message, "sends the {} bytes of the layout `{}`; it has ", pad.layout.bytes(), pad.layout_name);
    if config.sensors.is_empty() {
        message.push_str("no sensor");
    }
    for (i, SensorType { uid, bytes }) in config.sensors.iter().enumerate() {
        let comma = if i > 0 { ", " } else { "" };
        let _ = write!(message, "{comma}{}: uid 0x{uid:04X}, {bytes} bytes", i + 1);
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(side: &str, number: Option<usize>, uid: Option<usize>, layout: &str) -> SensorParams {
        SensorParams { side: Some(side.into()), number, uid, layout: layout.into() }
    }

    fn config(sensors: &[(u16, u16)]) -> Config {
        let sensors = sensors.iter().map(|(uid, bytes)| SensorType { uid: *uid, bytes: *bytes }).collect();
        Config { version: 1, sensors }
    }

    #[test]
    fn pads_find_their_sensors_by_number_uid_and_length() {
        let none = Map(std::collections::BTreeMap::new());
        let device = config(&[(7, 192), (8, 512), (9, 512), (10, 40)]);
        for (sensors, expected) in [
            (vec![SensorParams::default()], Ok(vec![None, Some(0), None, None])),
            (vec![sensor("a", Some(3), None, "myrmex_v2")], Ok(vec![None, None, Some(0), None])),
            (
                // The second one names the sensor that the first one would take.
                vec![sensor("a", None, None, "myrmex_v2"), sensor("b", None, Some(8), "myrmex_v2")],
                Ok(vec![None, Some(1), Some(0), None]),
            ),
            (
                vec![sensor("a", Some(1), None, "myrmex_v2")],
                Err("no free sensor of the device is its number 1 and sends the 512 bytes of the layout `myrmex_v2`; \
                    it has 1: uid 0x0007, 192 bytes, 2: uid 0x0008, 512 bytes, 3: uid 0x0009, 512 bytes, 4: uid \
                    0x000A, 40 bytes"
                    .to_owned()),
            ),
        ] {
            assert_eq!(assign(&pads(sensors, &none).unwrap(), &device), expected);
        }
        let wrong = assign(&[], &Config { version: 2, sensors: vec![] });
        assert_eq!(wrong.unwrap_err(), "the device speaks version 2 of the protocol, and not 1");
    }

    #[test]
    fn several_sensors_need_sides_and_known_layouts() {
        let none = Map(std::collections::BTreeMap::new());
        let messages = |sensors| -> Vec<String> {
            pads(sensors, &none).unwrap_err().into_iter().map(|mistake| mistake.message).collect()
        };
        let first = SensorParams::default;
        assert_eq!(
            messages(vec![first(), sensor("a", None, None, "glove")]),
            ["the device has several sensors, so the sensor 1 needs a `side`"]
        );
        assert_eq!(
            messages(vec![sensor("a", None, None, "glove"), sensor("a", None, None, "glove")]),
            ["two sensors have the side `a`"]
        );
        assert_eq!(messages(vec![sensor("a", None, None, "gloves")]), ["no layout is called `gloves`"]);
        assert_eq!(messages(vec![]).len(), 1);
    }
}
