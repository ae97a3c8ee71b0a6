//! The address of a link, as a bench writes it: `serial:PATH`, `tcp:HOST:PORT`, `udp:PORT`, `udp:HOST:PORT` or
//! `ws:HOST:PORT/PATH`.

use std::fmt;

/// Where the bytes of a device come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Address {
    /// The path of a serial port.
    Serial(String),
    /// `HOST:PORT` of a TCP server.
    Tcp(String),
    /// The UDP port on which to listen.
    UdpListen(u16),
    /// `HOST:PORT` of a UDP peer, to which bytes are sent, and whose datagrams alone are read.
    UdpPeer(String),
    /// `HOST:PORT/PATH` of a WebSocket server.
    WebSocket(String),
}

/// The forms of an address, for messages.
pub(crate) const FORMS: &str = "write `serial:/dev/serial/by-id/NAME`, `tcp:HOST:PORT`, `udp:PORT` to listen, \
                                `udp:HOST:PORT` to ask, or `ws:HOST:PORT/PATH`";

impl Address {
    /// Reads an address.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let Some((scheme, rest)) = text.split_once(':') else {
            return Err(format!("`{text}` does not begin with a kind of link"));
        };
        match scheme {
            "serial" if rest.is_empty() => Err("the path of the serial port is missing".to_owned()),
            "serial" => Ok(Self::Serial(rest.to_owned())),
            "tcp" => is_host_and_port(rest).map(|()| Self::Tcp(rest.to_owned())),
            "udp" if !rest.contains(':') => port(rest).map(Self::UdpListen),
            "udp" => is_host_and_port(rest).map(|()| Self::UdpPeer(rest.to_owned())),
            "ws" => {
                let rest = rest.trim_start_matches('/');
                let host = rest.split('/').next().unwrap_or_default();
                is_host_and_port(host).map(|()| Self::WebSocket(rest.to_owned()))
            }
            "wss" => Err("a link does not encrypt, so `wss` is not supported".to_owned()),
            _ => Err(format!("`{scheme}` is not a kind of link")),
        }
    }

    /// Whether what arrives comes in messages, whose borders are those of the sender.
    pub(crate) const fn has_messages(&self) -> bool {
        matches!(self, Self::UdpListen(_) | Self::UdpPeer(_) | Self::WebSocket(_))
    }

    /// Whether bytes can be sent before any have arrived.
    pub(crate) const fn can_send_first(&self) -> bool {
        !matches!(self, Self::UdpListen(_))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(path) => f.write_str(path),
            Self::Tcp(peer) => write!(f, "tcp:{peer}"),
            Self::UdpListen(port) => write!(f, "udp:{port}"),
            Self::UdpPeer(peer) => write!(f, "udp:{peer}"),
            Self::WebSocket(peer) => write!(f, "ws:{peer}"),
        }
    }
}

fn is_host_and_port(text: &str) -> Result<(), String> {
    let (host, number) = text.rsplit_once(':').ok_or_else(|| format!("the port of `{text}` is missing"))?;
    if host.is_empty() {
        return Err(format!("the host of `{text}` is missing"));
    }
    port(number).map(drop)
}

fn port(text: &str) -> Result<u16, String> {
    text.parse().ok().filter(|port| *port > 0).ok_or_else(|| format!("`{text}` is not a port from 1 to 65535"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_written() {
        let cases = [
            ("serial:/dev/serial/by-id/usb-1", Address::Serial("/dev/serial/by-id/usb-1".into())),
            ("tcp:pad.local:5000", Address::Tcp("pad.local:5000".into())),
            ("udp:5005", Address::UdpListen(5005)),
            ("udp:192.168.0.7:5005", Address::UdpPeer("192.168.0.7:5005".into())),
            ("ws:localhost:5000", Address::WebSocket("localhost:5000".into())),
            ("ws://localhost:5000/pad", Address::WebSocket("localhost:5000/pad".into())),
        ];
        for (text, expected) in cases {
            assert_eq!(Address::parse(text), Ok(expected), "{text}");
        }
    }

    #[test]
    fn each_wrong_address_has_its_message() {
        let cases = [
            ("/dev/ttyUSB0", "`/dev/ttyUSB0` does not begin with a kind of link"),
            ("usb:1", "`usb` is not a kind of link"),
            ("serial:", "the path of the serial port is missing"),
            ("tcp:pad", "the port of `pad` is missing"),
            ("tcp::5000", "the host of `:5000` is missing"),
            ("udp:pad", "`pad` is not a port from 1 to 65535"),
            ("udp:0", "`0` is not a port from 1 to 65535"),
            ("tcp:pad:70000", "`70000` is not a port from 1 to 65535"),
            ("wss:pad:443", "a link does not encrypt, so `wss` is not supported"),
        ];
        for (text, expected) in cases {
            assert_eq!(Address::parse(text), Err(expected.to_owned()), "{text}");
        }
    }
}
