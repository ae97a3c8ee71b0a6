//! `ros2_pad`: a tactile pad behind a topic.

use async_trait::async_trait;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened, Output};
use tactflow_runtime::node::{Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Image, ImageShape, Unit};

use super::frame;
use super::message::{Float32MultiArray, Picture, TactileState, Time};
use super::place::Place;
use super::sensor::{Sensor, stamp};
use crate::arm::mount::Mount;
use crate::devices::pad::{self, PadFacts};

/// The type of the messages of a pad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Kind {
    /// `sensor_msgs/msg/Image` in mono8, mono16 or 32FC1.
    Image,
    /// `std_msgs/msg/Float32MultiArray`.
    Array,
    /// `tactile_msgs/msg/TactileState`.
    TactileState,
}

/// Parameters of `ros2_pad`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The topic, such as `/tactile/image`.
    topic: String,
    /// The type of its messages.
    message: Kind,
    /// The sensor of a `tactile_state` with several.
    channel: Option<String>,
    #[param(flatten)]
    place: Place,
    /// Number of rows.
    #[param(range = 1..=10_000)]
    rows: usize,
    /// Number of columns.
    #[param(range = 1..=10_000)]
    cols: usize,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0)]
    pitch: f64,
    /// Unit of the values.
    #[param(default = Unit::RAW)]
    unit: Unit,
    /// Images per second.
    #[param(unit = "1/s", range = 0.001..=1e5)]
    rate_hz: f64,
    /// Time without a message after which the pad is lost: five periods, and at least 100 ms, if not given.
    #[param(unit = "ms", above = 0.0)]
    timeout_ms: Option<f64>,
    /// Time from the measurement of an image to its stamp; of messages without a stamp, to their arrival.
    #[param(unit = "ms", range = 0.0..=1e3, default = 0.0)]
    latency_ms: f64,
    /// Noise threshold that the pad states as a fact; in N with a `calibration`.
    #[param(unit = "$unit", range = 0.0..)]
    threshold: Option<f64>,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    rest_frames: usize,
    /// Largest difference of a zero from the calibrated one, stated as a fact.
    #[param(unit = "$unit", above = 0.0)]
    tare_bound: Option<f64>,
    /// Unit of pressure that the pad states as a fact, per tactel: p = 1 in the paper; in N with a `calibration`.
    #[param(unit = "$unit", above = 0.0)]
    pressure: Option<f64>,
    /// A calibration file from `tactflow calibrate`, stated as a fact. It converts the image to forces.
    calibration: Option<FilePath>,
    /// Pose of the pad on the tip of its arm, stated as a fact.
    mount: Option<Mount>,
}

/// A tactile pad behind a topic of ROS 2: an image, an array or a tactile state. It needs no ROS installation.
///
/// Rows run along y of the pad, and columns along x. The stamp of the header is that of the measurement, in the clock of
/// the publisher, whatever this clock is: offset and drift are estimated. Without a stamp, the time of arrival counts.
/// The reader takes the newest message, best effort, which every publisher offers.
///
/// A message of another size or encoding spoils nothing: it is counted (`bad messages`). Without a good one for
/// `timeout_ms` the pad is lost, and the message says what the topic offers instead.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "skin"
///
/// [devices.skin]
/// type = "ros2_pad"
/// topic = "/tactile/image"
/// message = "image"
/// rows = 16
/// cols = 16
/// pitch = 0.005
/// unit = "N"
/// rate_hz = 100.0
/// threshold = 0.015
/// ```
#[derive(Debug, Describe)]
pub struct Ros2Pad;

impl Device for Ros2Pad {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let sensor = Sensor::new(&params.place, params.topic, params.rate_hz, params.timeout_ms)?;
        if params.channel.is_some() && params.message != Kind::TactileState {
            let message = "`channel` is the sensor of a `tactile_state`";
            return Err(Mistake::param("channel", message)
                .help("remove it, or write `message = \"tactile_state\"`")
                .into());
        }
        let Params { rows, cols, pitch, unit, .. } = params;
        let mut description = Description::every(1.0 / params.rate_hz);
        description.latency = params.latency_ms * 1e-3;
        let facts = PadFacts {
            unit,
            threshold: params.threshold,
            pressure: params.pressure,
            calibration: params.calibration.as_ref(),
            mount: params.mount.as_ref(),
            rest_frames: params.rest_frames,
            tare_bound: params.tare_bound,
        };
        let shape = ImageShape { rows, cols, pitch: [pitch; 2], unit };
        let image = pad::fill(description.fills(pad::ROLE), shape, facts.facts()?);
        let (kind, channel, cells) = (params.message, params.channel, vec![0.0; rows * cols]);
        let driver = PadDriver { image, sensor, kind, channel, cells, cols };
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

struct PadDriver {
    image: Output<Image>,
    sensor: Sensor,
    kind: Kind,
    channel: Option<String>,
    /// The newest image.
    cells: Vec<f32>,
    cols: usize,
}

#[async_trait]
impl Live for PadDriver {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let Self { image, sensor, kind, channel, mut cells, cols } = *self;
        let lose = |link: &mut Link, why: &str| link.lost(image, why.to_owned());
        let publish = |link: &mut Link, cells: &[f32], time: Time, number: u64| {
            let stamp = stamp(link, time);
            link.publish(|samples| samples.write(image, stamp, number).cells_mut().copy_from_slice(cells));
        };
        match kind {
            Kind::Image => {
                let take = |link: &mut Link, picture: &Picture, number| {
                    frame::of_picture(picture, &mut cells, cols)?;
                    publish(link, &cells, picture.header.stamp, number);
                    Ok(())
                };
                sensor.follow(&mut link, take, lose).await
            }
            Kind::Array => {
                let take = |link: &mut Link, array: &Float32MultiArray, number| {
                    frame::of_array(array, &mut cells, cols)?;
                    publish(link, &cells, Time::default(), number);
                    Ok(())
                };
                sensor.follow(&mut link, take, lose).await
            }
            Kind::TactileState => {
                let take = |link: &mut Link, state: &TactileState, number| {
                    frame::of_state(state, channel.as_deref(), &mut cells)?;
                    publish(link, &cells, state.header.stamp, number);
                    Ok(())
                };
                sensor.follow(&mut link, take, lose).await
            }
        }
    }
}
