//! The server of the Real-Time Data Exchange: `size u16 | command u8 | payload`, big-endian.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};

use super::values::{Field, Values};

/// Clients that are served at once.
const MAX_CLIENTS: usize = 8;
/// Bytes that may wait for a client that does not read; then the link is closed.
const MAX_WAITING: usize = 1 << 18;
/// Rate of an e-Series [Hz].
const MAX_RATE: f64 = 500.0;
/// Half of the time between two beats, for times that are not exact [s].
const HALF_BEAT: f64 = 0.001;
const LEVEL_ERROR: u8 = 1;

/// The server.
pub(super) struct Rtde {
    listener: TcpListener,
    clients: Vec<Client>,
    packets: u64,
}

struct Client {
    stream: TcpStream,
    inbox: Vec<u8>,
    outbox: Vec<u8>,
    /// Names of the variables of its recipe.
    recipe: Vec<String>,
    /// Number of input recipes.
    inputs: u8,
    /// Time between two packets [s].
    period: f64,
    next: f64,
    has_version: bool,
    is_started: bool,
}

impl Rtde {
    /// Listens on a port; 0 takes a free one.
    ///
    /// # Errors
    /// If the port is taken.
    pub(super) fn open(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, clients: Vec::new(), packets: 0 })
    }

    /// The port on which it listens.
    pub(super) fn port(&self) -> Option<u16> {
        self.listener.local_addr().map(|address| address.port()).ok()
    }

    /// Number of packets with values that were sent.
    pub(super) fn packets(&self) -> u64 {
        self.packets
    }

    /// Answers the clients, and sends them the values that are due.
    ///
    /// # Errors
    /// If a socket cannot be set up.
    pub(super) fn serve(&mut self, values: &Values) -> io::Result<()> {
        while let Ok((stream, _)) = self.listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            if self.clients.len() < MAX_CLIENTS {
                self.clients.push(Client::new(stream));
            }
        }
        let packets = &mut self.packets;
        self.clients.retain_mut(|client| {
            let is_open = client.receive().is_ok() && client.answer(values).is_some();
            if is_open {
                *packets += u64::from(client.publish(values));
            }
            is_open && client.flush().is_ok() && client.outbox.len() < MAX_WAITING
        });
        Ok(())
    }
}

impl Client {
    fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            inbox: Vec::new(),
            outbox: Vec::new(),
            recipe: Vec::new(),
            inputs: 0,
            period: 1.0 / MAX_RATE,
            next: 0.0,
            has_version: false,
            is_started: false,
        }
    }

    fn receive(&mut self) -> io::Result<()> {
        let mut bytes = [0; 4096];
        while self.inbox.len() < MAX_WAITING {
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.inbox.extend_from_slice(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        while !self.outbox.is_empty() {
            match self.stream.write(&self.outbox) {
                Ok(count) => drop(self.outbox.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn send(&mut self, command: u8, payload: &[u8]) {
        let size = (payload.len() + 3) as u16;
        self.outbox.extend_from_slice(&size.to_be_bytes());
        self.outbox.push(command);
        self.outbox.extend_from_slice(payload);
    }

    /// Answers the packets that are complete. Returns `None` if one is none.
    fn answer(&mut self, values: &Values) -> Option<()> {
        while let Some(size) = self.inbox.first_chunk::<2>().map(|size| usize::from(u16::from_be_bytes(*size))) {
            if size < 3 {
                return None;
            }
            if self.inbox.len() < size {
                return Some(());
            }
            let packet: Vec<u8> = self.inbox.drain(..size).collect();
            self.answer_one(packet[2], &packet[3..], values)?;
        }
        Some(())
    }

    fn answer_one(&mut self, command: u8, payload: &[u8], values: &Values) -> Option<()> {
        match command {
            b'V' => {
                self.has_version = *payload == [0, 2];
                self.send(b'V', &[u8::from(self.has_version)]);
            }
            b'v' => self.send(b'v', &[5_u32, 12, 0, 0].map(u32::to_be_bytes).concat()),
            b'O' if self.has_version => {
                let (rate, names) = payload.split_first_chunk::<8>()?;
                let rate = f64::from_be_bytes(*rate);
                if !(1.0..=MAX_RATE).contains(&rate) {
                    self.text("the frequency is out of range");
                    return Some(());
                }
                self.period = 1.0 / rate;
                let names = str::from_utf8(names).ok()?;
                let fields = names.split(',').map(|name| values.get(name.trim()));
                let types: Vec<&str> = fields.map(|field| field.map_or("NOT_FOUND", Field::type_name)).collect();
                self.recipe = names.split(',').map(|name| name.trim().to_owned()).collect();
                self.send(b'O', &[&[1], types.join(",").as_bytes()].concat());
            }
            b'I' => {
                let types: Vec<&str> = str::from_utf8(payload).ok()?.split(',').map(input_type).collect();
                let is_accepted = !types.contains(&"NOT_FOUND");
                self.inputs += u8::from(is_accepted && self.inputs < 255);
                let recipe = if is_accepted { self.inputs } else { 0 };
                self.send(b'I', &[&[recipe], types.join(",").as_bytes()].concat());
            }
            b'S' => {
                self.is_started = !self.recipe.is_empty() && self.recipe.iter().all(|name| values.get(name).is_some());
                self.next = values.timestamp;
                self.send(b'S', &[u8::from(self.is_started)]);
            }
            b'P' => {
                self.is_started = false;
                self.send(b'P', &[1]);
            }
            // Values of inputs move nothing here.
            b'U' => {}
            _ => self.text("the command is not known"),
        }
        Some(())
    }

    fn text(&mut self, text: &str) {
        let source = "cell";
        let payload = [&[text.len() as u8], text.as_bytes(), &[source.len() as u8], source.as_bytes(), &[LEVEL_ERROR]];
        self.send(b'M', &payload.concat());
    }

    /// Sends the values of its recipe, if they are due. Returns whether they are.
    fn publish(&mut self, values: &Values) -> bool {
        if !self.is_started || values.timestamp < self.next - HALF_BEAT {
            return false;
        }
        self.next = (self.next + self.period).max(values.timestamp);
        let mut payload = vec![1];
        self.recipe.iter().filter_map(|name| values.get(name)).for_each(|field| field.write(&mut payload));
        self.send(b'U', &payload);
        true
    }
}

/// Returns the type of an input, of those that belong to clients of RTDE.
fn input_type(name: &str) -> &'static str {
    let register = |prefix: &str| {
        let number = name.trim().strip_prefix(prefix).and_then(|number| number.parse::<u8>().ok());
        number.is_some_and(|number| (24..48).contains(&number))
    };
    match name.trim() {
        "speed_slider_mask" => "UINT32",
        "speed_slider_fraction" => "DOUBLE",
        _ if register("input_int_register_") => "INT32",
        _ if register("input_double_register_") => "DOUBLE",
        _ => "NOT_FOUND",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(timestamp: f64) -> Values {
        Values {
            timestamp,
            actual_q: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            actual_qd: [0.0; 6],
            target_q: [0.0; 6],
            target_qd: [0.0; 6],
            tcp_pose: [0.0; 6],
            tcp_force: [0.0; 6],
            safety_mode: 1,
            runtime_state: 1,
        }
    }

    fn exchange(rtde: &mut Rtde, client: &mut TcpStream, sent: &[u8], length: usize) -> Vec<u8> {
        client.write_all(sent).unwrap();
        client.set_nonblocking(true).unwrap();
        let (mut answer, mut bytes) = (Vec::new(), [0; 1024]);
        while answer.len() < length {
            rtde.serve(&values(1.0)).unwrap();
            if let Ok(count) = client.read(&mut bytes) {
                answer.extend_from_slice(&bytes[..count]);
            }
        }
        client.set_nonblocking(false).unwrap();
        answer
    }

    #[test]
    fn the_literal_packets_are_answered() {
        let mut rtde = Rtde::open(0).unwrap();
        let mut client = TcpStream::connect((Ipv4Addr::LOCALHOST, rtde.port().unwrap())).unwrap();
        assert_eq!(exchange(&mut rtde, &mut client, &[0, 5, 0x56, 0, 2], 4), [0, 4, 0x56, 1]);
        let names = b"timestamp,actual_q,actual_qd,safety_mode";
        let recipe = [&[0x00, 0x33, 0x4F, 0x40, 0x7F, 0x40, 0, 0, 0, 0, 0], &names[..]].concat();
        let answer = exchange(&mut rtde, &mut client, &recipe, 34);
        assert_eq!((answer.len(), &answer[4..]), (34, &b"DOUBLE,VECTOR6D,VECTOR6D,INT32"[..]));
        let started = exchange(&mut rtde, &mut client, &[0, 3, 0x53], 4 + 112);
        assert_eq!(started[..4], [0, 4, 0x53, 1]);
        assert_eq!(started[4..8], [0, 112, 0x55, 1]);
        assert_eq!(started[8 + 8..8 + 16], 1.0_f64.to_be_bytes());
        let unknown = exchange(&mut rtde, &mut client, &[0, 3, 0x50, 0, 6, 0x49, b'a', b',', b'b'], 4 + 23);
        assert!(unknown.ends_with(b"\x00NOT_FOUND,NOT_FOUND"), "{unknown:?}");
    }

    #[test]
    fn a_packet_of_a_wrong_size_closes_the_link() {
        let mut rtde = Rtde::open(0).unwrap();
        let mut client = TcpStream::connect((Ipv4Addr::LOCALHOST, rtde.port().unwrap())).unwrap();
        client.write_all(&[0, 2, 0x56]).unwrap();
        client.set_nonblocking(true).unwrap();
        while !client.read(&mut [0; 8]).is_ok_and(|count| count == 0) {
            rtde.serve(&values(0.0)).unwrap();
        }
    }

    proptest::proptest! {
        #[test]
        fn any_packets_of_a_client_are_answered_or_end_the_link(packets: Vec<(u8, Vec<u8>)>) {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
            let _peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let mut client = Client::new(listener.accept().unwrap().0);
            for (command, payload) in packets {
                for command in [command, b'V', b'O', b'I', b'S'] {
                    client.inbox.extend(((payload.len() + 3) as u16).to_be_bytes());
                    client.inbox.push(command);
                    client.inbox.extend(&payload);
                    if client.answer(&values(0.0)).is_none() {
                        return Ok(());
                    }
                    client.publish(&values(1.0));
                }
            }
        }
    }
}
