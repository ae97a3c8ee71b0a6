//! The link, and what is sent over it.

use std::net::IpAddr;

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::params::{Framing, Params};
use super::text::{bytes_of, is_spaced_hex};
use super::useless;
use crate::devices::link::Address;
use crate::devices::link::address::FORMS;

/// The link, with what belongs to one kind of it.
pub(crate) struct Link {
    pub(crate) address: Address,
    pub(crate) baud: u32,
    pub(crate) from: Option<IpAddr>,
}

/// What is sent.
pub(crate) struct Sent {
    pub(crate) start: Vec<u8>,
    pub(crate) stop: Vec<u8>,
    pub(crate) poll: Option<Vec<u8>>,
}

pub(crate) fn link(params: &Params, mistakes: &mut Mistakes) -> Option<Link> {
    let address = match Address::parse(&params.link) {
        Ok(address) => address,
        Err(message) => {
            mistakes.push(Mistake::param("link", message).help(FORMS));
            return None;
        }
    };
    // A description of a pad states `baud` even if a bench reaches the pad over a network.
    if matches!(address, Address::Serial(_)) && params.baud.is_none() {
        let mistake = Mistake::new(Code::MissingKey, At::Param("link".into()), "a serial port needs `baud`, its speed");
        mistakes.push(mistake.help("write the speed of the data sheet, such as `baud = 115200`"));
    }
    let from = params.from.as_deref().and_then(|from| {
        if !matches!(address, Address::UdpListen(_)) {
            let why = format!("with the link `{address}`");
            mistakes.push(useless("from", &why, "leave it out, or listen with `link = \"udp:PORT\"`"));
        }
        let parsed = from.parse::<IpAddr>();
        if parsed.is_err() {
            let mistake = Mistake::param("from", format!("`{from}` is not the address of a host"));
            mistakes.push(mistake.help("write numbers, such as `192.168.0.7`"));
        }
        parsed.ok()
    });
    Some(Link { address, baud: u32::try_from(params.baud.unwrap_or(0)).unwrap_or(0), from })
}

pub(crate) fn sent(params: &Params, address: Option<&Address>, mistakes: &mut Mistakes) -> Option<Sent> {
    let mut read = |key: &str, text: &Option<String>| match text.as_deref().map(bytes_of) {
        None => Some(None),
        Some(Ok(bytes)) if bytes.is_empty() => {
            mistakes.push(Mistake::param(key, format!("`{key}` is empty")).help("leave it out to send nothing"));
            None
        }
        Some(Ok(_)) if text.as_deref().is_some_and(is_spaced_hex) => {
            let text = text.as_deref().unwrap_or_default();
            let mistake = Mistake::param(key, format!("`{text}` is sent as text, and looks like hexadecimal digits"));
            mistakes.push(mistake.instead(text, &format!("hex:{text}")));
            None
        }
        Some(Ok(bytes)) => Some(Some(bytes)),
        Some(Err((message, help))) => {
            mistakes.push(Mistake::param(key, message).help(help));
            None
        }
    };
    let (start, stop, poll) = (read("start", &params.start), read("stop", &params.stop), read("poll", &params.poll));
    let asks_first = [("start", params.start.is_some()), ("poll", params.poll.is_some())];
    if address.is_some_and(|address| !address.can_send_first()) {
        for (key, _) in asks_first.into_iter().filter(|(_, is_set)| *is_set) {
            let message = format!("`{key}` has no receiver: `{}` only listens", params.link);
            mistakes.push(Mistake::param(key, message).help("name the pad, `link = \"udp:HOST:PORT\"`"));
        }
    }
    if params.frame == Framing::Reply && params.poll.is_none() {
        let mistake =
            Mistake::new(Code::MissingKey, At::Param("frame".into()), "a reply needs `poll`, what is sent for it");
        mistakes.push(mistake.help("write `poll = \"A\"` or `poll = \"hex:41\"`, or another `frame`"));
    }
    Some(Sent { start: start?.unwrap_or_default(), stop: stop?.unwrap_or_default(), poll: poll? })
}
