//! The wires of the devices: bytes that a peer sends, in pieces of any size.
//!
//! The first byte of an input selects the device. Of a wire with datagrams, each datagram follows its length, a `u16`
//! with the low byte first.

use std::fmt::Write as _;

use tactflow_nodes::wires::{Listener, WIRES};
use tactflow_runtime::random::Random;

use super::Subject;

/// What a device may take beside a multiple of the input [bytes].
const BESIDE: u64 = 4 << 20;
/// What a device may take for each byte: for a text of each message, mostly.
const PER_BYTE: u64 = 2000;

/// A device with its parameters, and the bytes that a good peer sends.
struct Peer {
    params: String,
    bytes: Vec<u8>,
    has_datagrams: bool,
}

impl Peer {
    fn stream(params: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { params: params.into(), bytes: bytes.into(), has_datagrams: false }
    }

    fn datagrams(params: impl Into<String>, datagrams: &[Vec<u8>]) -> Self {
        let framed = |datagram: &Vec<u8>| [&(datagram.len() as u16).to_le_bytes()[..], datagram].concat();
        Self { params: params.into(), bytes: datagrams.iter().flat_map(framed).collect(), has_datagrams: true }
    }
}

fn subject(name: &'static str, peers: &[Peer]) -> Subject {
    let wire = WIRES.iter().find(|wire| wire.name == name).expect("the wire of a device");
    let open = |peer: &Peer| {
        let listener = (wire.open)(&peer.params).unwrap_or_else(|why| panic!("{name}: {why:?}\n{}", peer.params));
        // Frames with a mark are delivered once three follow each other. Later bytes that arrive with them can show that
        // they begin elsewhere.
        let has_marks = ["sync", "trailer"].iter().any(|framing| peer.params.contains(framing));
        (listener, peer.has_datagrams, has_marks)
    };
    let listeners: Vec<(Listener, bool, bool)> = peers.iter().map(open).collect();
    let input = |(i, peer): (usize, &Peer)| [&[i as u8], &*peer.bytes].concat();
    Subject {
        corpus: peers.iter().enumerate().map(input).collect(),
        read: Box::new(move |input| {
            let (first, bytes) = input.split_first().unwrap_or((&0, &[]));
            let (listener, has_datagrams, has_marks) = &listeners[usize::from(*first) % listeners.len()];
            if *has_datagrams {
                return listener(&datagrams(bytes)).len() > 1;
            }
            let (whole, cut) = (messages(listener(&[bytes])), messages(listener(&pieces(bytes))));
            assert!(*has_marks || cut == whole, "the same bytes in pieces are {cut:?}, and not {whole:?}");
            !whole.is_empty()
        }),
        max_memory: |input| PER_BYTE * input.len() as u64 + BESIDE,
    }
}

/// Leaves out the counts of a pad: bytes of a line that has not ended may be counted later.
fn messages(mut heard: Vec<String>) -> Vec<String> {
    heard.pop_if(|last| last.starts_with("Tally"));
    heard
}

/// Cuts bytes into pieces, the same each time.
fn pieces(mut bytes: &[u8]) -> Vec<&[u8]> {
    let (mut random, mut pieces) = (Random::new(bytes.len() as u64, 0), Vec::new());
    while !bytes.is_empty() {
        let most = [1, 4, 40, 1000][random.below(4)];
        let (piece, rest) = bytes.split_at(bytes.len().min(1 + random.below(most)));
        pieces.push(piece);
        bytes = rest;
    }
    pieces
}

/// Takes datagrams apart. The last one may be shorter than it says.
fn datagrams(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut datagrams = Vec::new();
    while let [low, high, rest @ ..] = bytes {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
        let (datagram, rest) = rest.split_at(length);
        datagrams.push(datagram);
        bytes = rest;
    }
    datagrams
}

/// A simulator in lockstep with the arm of the shipped benches.
pub(super) fn lockstep() -> Subject {
    let joints = ["a1", "a2", "e1", "a3", "a4", "a5", "a6"].map(|joint| format!("\"lwr_{joint}_joint\"")).join(",");
    let mut text = format!(
        "{{\"type\":\"hello\",\"proto\":1,\"dt\":0.004,\"lockstep\":true,\"task\":\"ball\",\"joints\":[{joints}],\
         \"q_min\":[-1,-1,-1,-1,-1,-1,-1],\"q_max\":[1,1,1,1,1,1,1],\"dq_max\":[1,1,1,1,1,1,1],\"urdf\":\"lwr4p\",\
         \"tip\":\"lwr_7_link\",\"T_es\":[1,0,0,0.1,0,1,0,0,0,0,1,0.03,0,0,0,1],\"rows\":2,\"cols\":2,\"pitch\":0.005,\
         \"counts_per_unit\":102.375,\"newton_per_unit\":0.1,\"threshold_units\":0.15}}\n"
    );
    for seq in 1..5 {
        let _ = writeln!(
            text,
            "{{\"type\":\"obs\",\"seq\":{seq},\"t\":{},\"q\":[0,0.1,0,0,0,0,0],\"dq\":[0,0,0,0,0,0,0],\
             \"q_eq\":[0,0.1,0,0,0,0,0],\"img\":[0,1,2.5,4095]}}",
            f64::from(seq) * 0.004
        );
    }
    text.push_str("{\"type\":\"end\",\"reason\":\"done\"}\n");
    let free = text.replace("\"lockstep\":true", "\"lockstep\":false");
    subject("lockstep", &[Peer::stream("", text), Peer::stream("acceleration = 1.0", free)])
}

/// Keys that all pads here share.
const PAD: &str = "link = 'tcp:127.0.0.1:1'\nrate_hz = 100\npitch = 0.005\nshape = [2, 3]\n";

/// Pads of every framing.
pub(super) fn stream() -> Subject {
    let xor = |bytes: Vec<u8>| [&*bytes, &[bytes.iter().fold(0, |xor, byte| xor ^ byte)]].concat();
    let each = |frame: &dyn Fn(u8) -> Vec<u8>| (0..8).flat_map(frame).collect::<Vec<u8>>();
    let cells = |i: u8| [i, 1, 2, 3, 4, 5];
    let sync = |i| [&[0xAA, 0x55][..], &cells(i)].concat();
    let pad = |keys: &str, bytes: Vec<u8>| Peer::stream(format!("{PAD}{keys}"), bytes);
    let parts = |i: u8| vec![0xAA, 0x55, i % 2, i, 1, 2];
    let clock = |i: u8| [&[0xAA, 0x55, i, 0, i, 0, 0][..], &cells(i)].concat();
    let line = |i: u8| format!("{i}, 1.5;2 -3 4e1 5\r\n").into_bytes();
    let datagrams = |frame: &dyn Fn(u8) -> Vec<u8>| (0..8).map(frame).collect::<Vec<_>>();
    let packed = |keys: &str, datagrams: &[Vec<u8>]| Peer::datagrams(format!("{PAD}{keys}"), datagrams);
    let floats = |i: u8| (0..6).flat_map(|k| f32::from(i + k).to_le_bytes()).chain([13, 10]).collect();
    let mut peers = vec![
        pad("frame = 'sync'\nmark = 'hex:AA55'\ncell = 'u8'", each(&sync)),
        pad("frame = 'sync'\nmark = 'hex:AA55'\ncell = 'u8'\ncheck = 'xor8'", each(&|i| xor(sync(i)))),
        pad(
            "frame = 'sync'\nmark = 'hex:AA55'\ncell = 'u8'\nparts = { values = 3, index = { offset = 2, cell = 'u8' } }\noffset = 3",
            each(&parts),
        ),
        pad(
            "frame = 'sync'\nmark = 'hex:AA55'\ncell = 'u8'\noffset = 7\n\
             clock = { stamp = { offset = 3, cell = 'u32le', unit = 's' }, counter = { offset = 2, cell = 'u8' } }",
            each(&clock),
        ),
        pad("frame = 'trailer'\nmark = 'hex:0D0A'\ncell = 'f32le'\nplausible = { value = [-1e3, 1e3] }", each(&floats)),
        pad("frame = 'lines'\ncell = 'dec'", each(&line)),
        pad("frame = 'lines'\ncell = 'hex'\nmark = 'end'", b"1a,2,ff\n3 4 5\nend\n".repeat(4)),
        pad("frame = 'cobs'\ncell = 'u8'", each(&|i| [&[7][..], &cells(i + 1), &[0]].concat())),
        pad("frame = 'slip'\ncell = 'u8'\ncheck = 'sum8'", b"\x01\x02\x03\x04\x05\x06\x15\xc0".repeat(4)),
        packed("frame = 'reply'\ncell = 'u8'\npoll = 'hex:01'", &datagrams(&|i| cells(i).to_vec())),
    ];
    let of_udp = PAD.replace("tcp:127.0.0.1:1", "udp:5005");
    let binary = datagrams(&|i| cells(i).to_vec());
    peers.push(Peer::datagrams(format!("{of_udp}frame = 'datagram'\ncell = 'u8'"), &binary));
    peers.push(Peer::datagrams(format!("{of_udp}frame = 'datagram'\ncell = 'dec'"), &datagrams(&line)));
    peers.extend(shipped_pads());
    subject("stream", &peers)
}

/// The descriptions that ship, with bytes that begin as their frames do.
fn shipped_pads() -> impl Iterator<Item = Peer> {
    crate::toml_files(&crate::workspace().join("graphs/pads")).into_iter().map(|file| {
        let text = std::fs::read_to_string(file).expect("a file that ships");
        let params = text.replace("[sensor]\n", "link = 'serial:/dev/null'\n").replace("[sensor.", "[");
        let bytes = [&[0xAA, 0x55, 0xF0, 0xC4, 0x01][..], &[0; 2000]].concat();
        if params.contains("poll =") { Peer::datagrams(params, &[bytes]) } else { Peer::stream(params, bytes) }
    })
}

/// A device with a Myrmex and a sensor of a layout of its own.
pub(super) fn agni() -> Subject {
    let sealed = |body: &[u8]| [body, &[body.iter().fold(0, |xor, byte| xor ^ byte)]].concat();
    let frame = |sensor: u8, stamp: u32, payload: &[u8]| {
        sealed(&[&[0xF0, 0xC4, sensor], &stamp.to_le_bytes()[..], payload].concat())
    };
    let mut bytes = [
        sealed(&[0xF0, 0xC4, 0x00, 0x01, 0x02, 0x02, 0x34, 0x12, 0x00, 0x02, 0x35, 0x12, 0x04, 0x00]),
        sealed(b"\xF0\xC4\xF2\x04B007"),
        sealed(b"\xF0\xC4\xFE\x03hot"),
        sealed(&[0xF0, 0xC4, 0xF1, 0x11, 0x01, 0x01]),
    ]
    .concat();
    for i in 0..3 {
        bytes.extend(frame(1, 100 * i, &[7; 512]));
        bytes.extend(frame(2, 100 * i, &[1, 2, 3, 4]));
    }
    let small = bytes[..80].to_vec();
    let params = "link = 'tcp:127.0.0.1:1'\nsensors = [{ side = 'left' }, { side = 'right', layout = 'own' }]\n\
                  layouts.own = { rows = 1, cols = 2 }";
    subject("agni", &[Peer::stream(params, bytes), Peer::stream("link = 'tcp:127.0.0.1:1'", small)])
}

/// A controller of FRI 1.0.
pub(super) fn lwr_fri() -> Subject {
    let datagram = |number: u16| {
        let mut bytes = vec![0; 916];
        bytes[..8].copy_from_slice(&[0x01, 0x00, 0x00, 0x00, 0x94, 0x03, 0x06, 0x20]);
        bytes[..2].copy_from_slice(&number.to_le_bytes());
        bytes[140..144].copy_from_slice(&(f32::from(number) * 0.004).to_le_bytes());
        bytes[148..152].copy_from_slice(&0.004_f32.to_le_bytes());
        bytes
    };
    subject("lwr_fri", &[Peer::datagrams("", &[1, 2, 3, 5, 4, 5].map(datagram))])
}

/// A controller that speaks RTDE.
pub(super) fn ur() -> Subject {
    const TYPES: &[u8] =
        b"\x01DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,DOUBLE,INT32,INT32,UINT32,DOUBLE,DOUBLE";
    let packet =
        |command: u8, payload: &[u8]| [&(3 + payload.len() as u16).to_be_bytes()[..], &[command], payload].concat();
    let mut sample = vec![1];
    sample.extend((1..=32).flat_map(|i| f64::from(i).to_be_bytes()));
    sample.extend([7, 1, 2].iter().flat_map(|mode: &i32| mode.to_be_bytes()));
    sample.extend([1.0, 1.0_f64].iter().flat_map(|value| value.to_be_bytes()));
    let bytes = [
        packet(b'V', &[1]),
        packet(b'v', &[0, 0, 0, 5, 0, 0, 0, 11, 0, 0, 0, 0, 0, 0, 0, 1]),
        packet(b'M', b"\x05hello\x04RTDE\x03"),
        packet(b'O', TYPES),
        packet(b'S', &[1]),
        packet(b'U', &sample),
        packet(b'U', &sample),
    ];
    subject("ur", &[Peer::stream("", bytes.concat())])
}
