//! The device over a pipe in memory, and the mistakes in its parameters.

use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use tactflow_runtime::harness::LinkRig;
use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

use super::session::Session;
use super::*;
use crate::devices::link::Connection;
use crate::devices::testing::open;

fn messages_of(params: &str) -> Vec<String> {
    let Err(mistakes) = open::<Agni>(params) else { panic!("it opens") };
    mistakes.into_iter().map(|mistake| mistake.message).collect()
}

#[test]
fn each_mistake_in_the_parameters_is_named() {
    let link = "link = 'serial:/dev/null'\n";
    for (params, expected) in [
        ("link = '/dev/ttyACM0'", "`/dev/ttyACM0` does not begin with a kind of link"),
        ("link = 'serial:'", "the path of the serial port is missing"),
        ("link = 'udp:5005'", "`udp:5005` is no serial port"),
        (&format!("{link}threshold = 0.1"), "the pad has no forces, so it has no `threshold` in N"),
        (&format!("{link}sensors = [{{ layout = 'glov' }}]"), "no layout is called `glov`"),
        (
            &format!("{link}sensors = [{{ layout = 'own' }}]\nlayouts.own = {{ rows = 1, cols = 2, order = [0, 0] }}"),
            "the order has 0 twice, and 1 is missing",
        ),
        (
            &format!("{link}layouts.own = {{ form = 'pairs', rows = 20, cols = 20 }}"),
            "20 by 20 tactels are more than the 256 that a frame can have",
        ),
        (
            &format!("{link}layouts.glove = {{ rows = 1, cols = 2 }}"),
            "the layout `glove` is built in: give yours another name",
        ),
    ] {
        assert_eq!(messages_of(params), [expected], "{params}");
    }
}

#[test]
fn a_pad_states_its_forces_as_far_as_they_are_known() {
    for (params, calibration, threshold, pressure) in [
        ("", "", "0.05 1", "0.15 1/tactel"),
        ("full_scale = 3.0", "gain = 3.0\nunit = \"N\"\n", "0.15 N", "0.45 N/tactel"),
        ("full_scale = 3.0\nthreshold = 0.02", "gain = 3.0\nunit = \"N\"\n", "0.02 N", "0.1 N/tactel"),
        ("full_scale = 3.0\npressure = 0.2", "gain = 3.0\nunit = \"N\"\n", "0.15 N", "0.2 N/tactel"),
    ] {
        let opened = open::<Agni>(&format!("link = 'serial:/dev/null'\n{params}")).unwrap();
        let fact = |name: &str| opened.description.fact(name).unwrap().clone();
        assert_eq!(toml::to_string(fact("calibration").as_table().unwrap()).unwrap(), calibration);
        assert_eq!((fact("threshold").as_str(), fact("pressure").as_str()), (Some(threshold), Some(pressure)));
    }
}

#[test]
fn several_sensors_are_several_pads_of_their_sizes() {
    let sensors = "sensors = [{ side = 'left' }, { side = 'hand', layout = 'glove' }]";
    let opened = open::<Agni>(&format!("link = 'serial:/dev/null'\n{sensors}")).unwrap();
    assert_eq!(opened.description.roles().collect::<Vec<_>>(), ["tactile_pad"; 2]);
}

#[test]
fn a_port_that_is_not_there_is_lost_and_the_device_can_be_stopped() {
    let mut rig = LinkRig::start::<Agni>("link = 'serial:/dev/no_such_port'").unwrap();
    assert!(rig.wait_until(Duration::from_secs(5), |rig| rig.lost("image").is_some()));
    assert!(rig.lost("image").unwrap().starts_with("/dev/no_such_port: "), "{:?}", rig.lost("image"));
    rig.stop().unwrap();
}

/// Runs a session against a device that is a function of the bytes that it gets.
fn greet(answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static) -> (Result<session::Identity, String>, Vec<u8>) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build().unwrap();
    runtime.block_on(async {
        let (host, mut device) = duplex(4096);
        let got = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&got);
        let device = tokio::spawn(async move {
            let mut bytes = [0; 256];
            while let Ok(count @ 1..) = device.read(&mut bytes).await {
                seen.lock().unwrap().extend_from_slice(&bytes[..count]);
                let _ = device.write_all(&answer(&bytes[..count])).await;
            }
        });
        let mut session = Session::new(Connection::Pipe(host));
        let identity = session.greet().await;
        if identity.is_ok() {
            session.start([1].into_iter(), Some(10)).await.unwrap();
            session.stop().await;
        }
        drop(session);
        device.await.unwrap();
        let got = got.lock().unwrap().clone();
        (identity, got)
    })
}

fn hex(text: &str) -> Vec<u8> {
    (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
}

#[test]
fn the_handshake_sends_the_literal_bytes_in_their_order() {
    let (identity, got) = greet(|bytes| match bytes {
        [0xF0, 0xC4, 0x00, 0xC0, 0xF4] => hex("F0C4000102013412000212"),
        _ => Vec::new(),
    });
    let identity = identity.unwrap();
    assert_eq!((identity.config.sensors[0].uid, identity.config.sensors[0].bytes), (0x1234, 512));
    assert_eq!(identity.serial, None, "no answer is allowed");
    let expected = "F0C4000034F0C400C0F4F0C400C2F6F0C400C1F5F0C401D002000A00EDF0C400F1C5F0C4000034";
    assert_eq!(got, hex(expected));
}

#[test]
fn a_device_that_only_talks_to_humans_is_lost_with_its_error() {
    let (identity, _) = greet(|bytes| if bytes[3] == 0xC0 { hex("F0C4FEF0CA") } else { b"help: press h\r\n".to_vec() });
    let why = identity.unwrap_err();
    assert_eq!(why, "the device does not send its configuration");
    let (identity, _) = greet(|bytes| if bytes[3] == 0xC0 { hex("F0C4FEF03A") } else { Vec::new() });
    let why = identity.unwrap_err();
    assert_eq!(why, "the device does not send its configuration; it reports a wrong checksum in a command");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_device_that_answers_anything_is_greeted_or_refused(answer: Vec<u8>) {
        let _ = greet(move |_| answer.clone());
    }
}
