//! The device `agni` against a device in another process, on a pseudo-terminal.

use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use tactflow_nodes::devices::agni::Agni;
use tactflow_runtime::harness::LinkRig;
use tactflow_runtime::signal::Image;

use crate::peer::{Process, SOON};

/// The device.
pub(crate) struct Sensor {
    process: Process,
    pub(crate) link: PathBuf,
    _folder: tempfile::TempDir,
}

impl Sensor {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("pad");
        let arguments = [link.to_str().unwrap()].into_iter().chain(arguments.iter().copied());
        let process = Process::start("agni.py", arguments);
        process.wait(0, |said| said["ready"].is_string());
        Self { process, link, _folder: folder }
    }

    fn rig(&self, params: &str) -> LinkRig {
        let rig = LinkRig::start::<Agni>(&format!("link = 'serial:{}'\n{params}", self.link.display()));
        rig.unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
    }

    fn order(&mut self, line: &str) {
        self.process.say(line);
    }

    /// Asks for its number of frames, and whether it runs. Whatever it was ordered before has begun then.
    fn ask(&mut self) -> (u64, bool) {
        let from = self.process.count();
        self.order("ask it");
        let said = self.process.wait(from, |said| said["tag"] == "it");
        (said["frames"].as_u64().unwrap(), said["is_started"] == true)
    }

    /// The commands that it has got.
    fn got(&self) -> Vec<String> {
        self.process.said(0).iter().filter_map(|said| said["got"].as_str().map(str::to_owned)).collect()
    }

    /// Waits until it has stopped sending frames, as a host has asked for.
    fn wait_for_stop(&mut self) -> bool {
        let end = Instant::now() + SOON;
        while Instant::now() < end {
            if !self.ask().1 {
                return true;
            }
            thread::sleep(Duration::from_millis(5));
        }
        false
    }
}

/// Returns the reading of the first tactel, if the image is a ramp from there on, as every frame is.
fn ramp(image: &Image) -> Result<i64, String> {
    let reading = |cell: f32| ((1.0 - f64::from(cell)) * 4095.0).round() as i64;
    let base = reading(image.cells()[0]);
    match image.cells().iter().enumerate().find(|(i, cell)| reading(**cell) != (base + *i as i64) % 4096) {
        None if base < 3000 => Ok(base),
        None => Err(format!("no frame begins at {base}")),
        Some((i, cell)) => Err(format!("tactel {i} reads {} and the first {base}", reading(*cell))),
    }
}

/// Waits for so many images, each a whole frame.
fn images(rig: &mut LinkRig, count: usize) {
    for _ in 0..count {
        let lost = rig.lost("image").map(str::to_owned);
        let image = rig.next::<Image>("image", SOON).unwrap_or_else(|| panic!("no image: {lost:?}"));
        ramp(image).unwrap();
    }
}

#[test]
fn a_sensor_is_stopped_asked_started_and_stopped_again() {
    let mut sensor = Sensor::start(&["--help-text", "--serial", "B012"]);
    let mut rig = sensor.rig("sets_rate = true\nrate_hz = 1000.0");
    images(&mut rig, 20);
    assert!(sensor.ask().1);
    rig.stop().unwrap();
    assert!(sensor.wait_for_stop(), "it goes on after the run");
    let got = sensor.got();
    let got: Vec<&str> = got.iter().map(String::as_str).collect();
    let expected =
        ["F0C4000034", "F0C400C0F4", "F0C400C2F6", "F0C400C1F5", "F0C401D002000A00ED", "F0C400F1C5", "F0C4000034"];
    // A busy machine may make the device late with its configuration.
    let without_repeats: Vec<&str> =
        got.iter().enumerate().filter(|(i, text)| *i == 0 || got[i - 1] != **text).map(|(_, text)| *text).collect();
    assert_eq!(without_repeats, expected);
}

#[test]
fn whatever_happens_to_the_bytes_an_image_is_a_frame() {
    let mut sensor = Sensor::start(&[]);
    let mut rig = sensor.rig("silence_ms = 5000");
    images(&mut rig, 5);
    for (order, counter) in [
        ("wrong", "rejected frames"),
        ("lose", "resyncs"),
        ("mixed", "bad frames"),
        ("extra", "resyncs"),
        ("garbage", "skipped bytes"),
        ("fault", "errors of the device"),
    ] {
        let before = rig.count(counter);
        sensor.order(order);
        assert!(rig.wait_until(SOON, |rig| rig.count(counter) > before), "{order}");
        images(&mut rig, 5);
    }
    sensor.order("split");
    sensor.ask();
    images(&mut rig, 5);
    assert_eq!(rig.count("reconnects"), 0);
    rig.stop().unwrap();
}

#[test]
fn headers_in_the_data_are_data() {
    let mut sensor = Sensor::start(&[]);
    let mut rig = sensor.rig("silence_ms = 5000");
    images(&mut rig, 3);
    sensor.order("mark");
    sensor.ask();
    let is_mark = |cell: &f32| ((1.0 - f64::from(*cell)) * 4095.0).round() as i64 == 0x4F0;
    assert!(
        rig.wait_until(SOON, |rig| rig.get::<Image>("image").is_some_and(|image| image.cells().iter().all(is_mark)))
    );
    // Also when the beginning has to be found among them.
    for _ in 0..3 {
        let before = rig.count("resyncs");
        sensor.order("lose");
        assert!(rig.wait_until(SOON, |rig| rig.count("resyncs") > before));
        for _ in 0..3 {
            assert!(rig.next::<Image>("image", SOON).unwrap().cells().iter().all(is_mark));
        }
    }
    rig.stop().unwrap();
}

#[test]
fn a_sensor_that_is_unplugged_is_lost_and_starts_again() {
    let mut sensor = Sensor::start(&["--serial", "B012"]);
    let mut rig = sensor.rig("silence_ms = 2000");
    for order in ["unplug", "half"] {
        images(&mut rig, 5);
        sensor.order(order);
        assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()), "{order}");
        assert!(rig.lost("image").unwrap().contains("(serial number B012)"), "{:?}", rig.lost("image"));
        assert_eq!(rig.get::<Image>("image"), None);
        sensor.order("replug");
    }
    images(&mut rig, 5);
    assert!(rig.count("reconnects") >= 2);
    rig.stop().unwrap();
}

#[test]
fn another_serial_number_behind_the_same_port_ends_the_device() {
    let mut sensor = Sensor::start(&["--serial", "B012"]);
    let mut rig = sensor.rig("");
    images(&mut rig, 5);
    sensor.order("unplug");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()));
    sensor.order("replug B013");
    let is_named = |rig: &LinkRig| rig.lost("image").is_some_and(|why| why.contains("number B013"));
    assert!(rig.wait_until(SOON, is_named), "{:?}", rig.lost("image"));
    let error = rig.stop().unwrap_err().to_string();
    assert!(error.contains("(serial number B012): another device has come back"), "{error}");
}

#[test]
fn a_silent_sensor_is_lost_and_greeted_again() {
    let mut sensor = Sensor::start(&[]);
    let mut rig = sensor.rig("silence_ms = 300");
    images(&mut rig, 5);
    sensor.order("silence");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()));
    assert!(rig.lost("image").unwrap().ends_with("no frame for 300ms"), "{:?}", rig.lost("image"));
    sensor.order("speak");
    images(&mut rig, 5);
    rig.stop().unwrap();
}

#[test]
fn two_sensors_are_two_pads() {
    let sensor = Sensor::start(&["--sensors", "512,192"]);
    let mut rig = sensor.rig("sensors = [{ side = 'hand', layout = 'glove' }, { side = 'palm' }]");
    images(&mut rig, 5);
    assert_eq!(rig.get::<Image>("image").unwrap().rows(), 8);
    rig.stop().unwrap();
    let mut rig = sensor.rig("sensors = [{ side = 'palm', uid = 0x1234 }, { side = 'hand', layout = 'glove' }]");
    images(&mut rig, 5);
    assert_eq!(rig.get::<Image>("image").unwrap().rows(), 16);
    rig.stop().unwrap();
}

#[test]
fn another_sensor_than_the_bench_says_fails_with_the_list() {
    let sensor = Sensor::start(&["--sensors", "192"]);
    let mut rig = sensor.rig("");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()));
    let error = rig.stop().unwrap_err().to_string();
    assert!(error.contains("it has 1: uid 0x1234, 192 bytes"), "{error}");
}

#[test]
fn stamps_with_a_unit_are_those_of_the_device() {
    let sensor = Sensor::start(&[]);
    let mut rig = sensor.rig("stamp_unit_ms = 0.1");
    images(&mut rig, 50);
    assert_eq!(rig.count("steps of its clock"), 0);
    rig.stop().unwrap();
}
