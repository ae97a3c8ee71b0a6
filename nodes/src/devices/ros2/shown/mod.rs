//! What others see of a run: a topic for each port, `/tf` and `/diagnostics`.
//!
//! The set of kinds is closed, so each has one message. Numbers without a geometry are a `JointState`: ROS has no other
//! common message that has a stamp, names and numbers, and plotting tools show its numbers by their names.

mod message;

use std::net::IpAddr;
use std::time::Duration;

use tactflow_runtime::socket::{ImageFacts, PortFacts, PortSample};

use self::message::{DiagnosticArray, DiagnosticStatus, KeyValue, PoseStamped, TfMessage, TransformStamped};
use super::domain::{Domain, Writer, domain_of};
use super::message::{Header, JointState, Message, Picture, Time, TwistStamped};
use super::output::wall_clock;
use super::place::is_topic;

/// Longest wait at the end until everybody has the last messages.
const MAX_SETTLE: Duration = Duration::from_millis(500);

/// How topics and frames are called.
#[derive(Debug, Clone, Default)]
pub(crate) struct Naming {
    /// What the names of the topics begin with, such as `/tactflow`.
    pub(crate) prefix: String,
    /// Frames of the graph, each with its name in ROS.
    pub(crate) frames: Vec<(String, String)>,
    /// Whether poses are transforms too.
    pub(crate) has_transforms: bool,
}

impl Naming {
    /// Checks the names.
    ///
    /// # Errors
    /// What is wrong with the prefix.
    pub(crate) fn check(&self) -> Result<(), String> {
        if is_topic(&self.prefix) {
            return Ok(());
        }
        let prefix = &self.prefix;
        Err(format!(
            "`{prefix}` is no beginning of topics: it begins with `/`, and has letters, digits and `_`, such as `/cell_1`"
        ))
    }

    fn topic(&self, port: &str) -> String {
        format!("{}/{}", self.prefix, port.replace('.', "/"))
    }

    /// Returns the name of a frame of the graph in ROS; an empty one where the wires determine none.
    fn frame(&self, frame: Option<&String>) -> String {
        let frame = frame.map_or("", String::as_str);
        let renamed = self.frames.iter().find(|(of_graph, _)| of_graph == frame);
        renamed.map_or(frame, |(_, of_ros)| of_ros).to_owned()
    }

    /// Checks that each renamed frame is one of the ports.
    fn check_frames(&self, ports: &[PortFacts]) -> Result<(), String> {
        let mut known: Vec<&str> = ports.iter().flat_map(|port| &port.frames).flatten().map(String::as_str).collect();
        known.sort_unstable();
        known.dedup();
        let unknown = self.frames.iter().find(|(frame, _)| !known.contains(&frame.as_str()));
        let Some((frame, _)) = unknown else { return Ok(()) };
        Err(match known.as_slice() {
            [] => format!("`--frame {frame}=…` renames nothing: no published port has a frame"),
            known => format!("no published port has the frame `{frame}`; they have `{}`", known.join("`, `")),
        })
    }
}

/// A domain in which runs are shown.
pub(crate) struct Board {
    domain: Domain,
    diagnostics: Writer<DiagnosticArray>,
}

/// How well a task does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    /// All is well.
    Ok = 0,
    /// Its commands are held.
    Warning = 1,
    /// It has failed, or does not answer.
    Error = 2,
    /// Nothing runs.
    Stale = 3,
}

/// The state of a task, for `/diagnostics`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Status {
    pub(crate) level: Level,
    pub(crate) name: String,
    pub(crate) message: String,
    pub(crate) values: Vec<(&'static str, String)>,
}

impl Status {
    /// Returns what it says, without its values.
    pub(crate) fn state(&self) -> (Level, &str, &str) {
        (self.level, &self.name, &self.message)
    }
}

impl Board {
    /// Joins a domain: the given one, or that of the environment.
    ///
    /// # Errors
    /// If it cannot be joined.
    pub(crate) fn join(domain: Option<usize>, network: IpAddr) -> Result<Self, String> {
        let domain = Domain::join(domain_of(domain)?, network)?;
        let diagnostics = domain.show("/diagnostics")?;
        Ok(Self { domain, diagnostics })
    }

    /// Publishes the state of the tasks. Returns whether it was taken.
    pub(crate) fn diagnose(&self, statuses: &[Status]) -> bool {
        let status = |status: &Status| DiagnosticStatus {
            level: status.level as u8,
            name: status.name.clone(),
            message: status.message.clone(),
            hardware_id: String::new(),
            values: status
                .values
                .iter()
                .map(|(key, value)| KeyValue { key: (*key).into(), value: value.clone() })
                .collect(),
        };
        let header = Header { stamp: Time::of_nanos(wall_clock()), frame_id: String::new() };
        self.diagnostics.send(DiagnosticArray { header, status: statuses.iter().map(status).collect() })
    }

    /// Waits until those who read `/diagnostics` have the last one.
    pub(crate) fn settle(&self) {
        self.diagnostics.settle(MAX_SETTLE);
    }

    /// Opens the topics of ports.
    ///
    /// # Errors
    /// If a topic cannot be opened, or no port has a frame that is to be renamed.
    pub(crate) fn topics(&self, ports: &[PortFacts], naming: &Naming) -> Result<Topics, String> {
        naming.check_frames(ports)?;
        let mut moved: Vec<String> = Vec::new();
        let mut list = Vec::new();
        for port in ports {
            let shape = Shape::of(port, naming);
            // A frame has one parent: the pose that is declared first moves it.
            let moves = shape.child().filter(|child| naming.has_transforms && !moved.contains(*child)).cloned();
            moved.extend(moves.clone());
            list.push(Topic::open(&self.domain, naming.topic(&port.name), port.name.clone(), (shape, moves))?);
        }
        let transforms = (!moved.is_empty()).then(|| self.domain.show("/tf")).transpose()?;
        Ok(Topics { list, transforms })
    }
}

/// The topics of the ports of a run.
pub(crate) struct Topics {
    list: Vec<Topic>,
    transforms: Option<Writer<TfMessage>>,
}

impl Topics {
    /// Returns the name and the type of each.
    pub(crate) fn rows(&self) -> Vec<[String; 2]> {
        let rows = self.list.iter().map(|topic| [topic.name.clone(), topic.writer.kind().to_owned()]);
        let transforms = self.transforms.iter().map(|_| ["/tf".to_owned(), TfMessage::TYPE.to_owned()]);
        rows.chain(transforms).collect()
    }

    /// Publishes the values of a port. Returns whether they were taken.
    pub(crate) fn publish(&self, port: &str, sample: &PortSample) -> bool {
        let Some(topic) = self.list.iter().find(|topic| topic.port == port) else { return true };
        let stamp = Time::of_nanos(sample.stamp_ns);
        let is_taken = topic.writer.send(&topic.shape, stamp, sample);
        let moved = topic.moves.as_ref().zip(self.transforms.as_ref());
        let moved = moved.and_then(|(child, writer)| {
            let PoseStamped { header, position, orientation } = topic.shape.pose(stamp, sample)?;
            let child_frame_id = child.clone();
            let transform = TransformStamped { header, child_frame_id, translation: position, rotation: orientation };
            Some(writer.send(TfMessage { transforms: vec![transform] }))
        });
        is_taken && moved.unwrap_or(true)
    }
}

/// The topic of a port.
struct Topic {
    name: String,
    port: String,
    shape: Shape,
    /// The frame that its pose moves.
    moves: Option<String>,
    writer: TopicWriter,
}

enum TopicWriter {
    Picture(Writer<Picture>),
    Pose(Writer<PoseStamped>),
    Twist(Writer<TwistStamped>),
    Numbers(Writer<JointState>),
}

impl Topic {
    fn open(
        domain: &Domain,
        name: String,
        port: String,
        (shape, moves): (Shape, Option<String>),
    ) -> Result<Self, String> {
        let writer = match shape.content {
            Content::Picture(..) => TopicWriter::Picture(domain.show(&name)?),
            Content::Pose { .. } => TopicWriter::Pose(domain.show(&name)?),
            Content::Twist => TopicWriter::Twist(domain.show(&name)?),
            Content::Numbers(..) => TopicWriter::Numbers(domain.show(&name)?),
        };
        Ok(Self { name, port, shape, moves, writer })
    }
}

impl TopicWriter {
    const fn kind(&self) -> &'static str {
        match self {
            Self::Picture(_) => Picture::TYPE,
            Self::Pose(_) => PoseStamped::TYPE,
            Self::Twist(_) => TwistStamped::TYPE,
            Self::Numbers(_) => JointState::TYPE,
        }
    }

    /// Sends a value, if its message can hold it: an image, a pose and a twist that are absent have none.
    fn send(&self, shape: &Shape, stamp: Time, sample: &PortSample) -> bool {
        match self {
            Self::Picture(writer) => shape.picture(stamp, sample).is_none_or(|picture| writer.send(picture)),
            Self::Pose(writer) => shape.pose(stamp, sample).is_none_or(|pose| writer.send(pose)),
            Self::Twist(writer) => shape.twist(stamp, sample).is_none_or(|twist| writer.send(twist)),
            Self::Numbers(writer) => shape.numbers(stamp, sample).is_none_or(|numbers| writer.send(numbers)),
        }
    }
}

/// What a message of a port needs beside its values.
#[derive(Debug)]
struct Shape {
    frame: String,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// An image, with the number of values of each pixel.
    Picture(ImageFacts, usize),
    /// A pose of the frame `child`.
    Pose {
        child: String,
    },
    Twist,
    Numbers(Vec<String>, Field),
}

/// The field of a `JointState` that has the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Field {
    Position,
    Velocity,
    Effort,
}

impl Shape {
    fn of(port: &PortFacts, naming: &Naming) -> Self {
        let frame = |at: usize| naming.frame(port.frames.get(at).and_then(Option::as_ref));
        let frame_of = |at: usize, content: Content| Self { frame: frame(at), content };
        match (port.kind.as_str(), &port.image) {
            (kind, Some(image)) => {
                let channels = if kind == "vector_image" { 3 } else { 1 };
                frame_of(0, Content::Picture(image.clone(), channels))
            }
            // A pose is written in its second frame.
            ("pose", _) => frame_of(1, Content::Pose { child: frame(0) }),
            ("twist", _) => frame_of(0, Content::Twist),
            (kind, _) => {
                let own = port.name.rsplit('.').next().unwrap_or(&port.name);
                let name = |(name, _): &(String, String)| if name.is_empty() { own.to_owned() } else { name.clone() };
                let is_all = |unit: &str| kind == "joints" && port.numbers.iter().all(|(_, of)| of == unit);
                let field = match (is_all("rad/s"), is_all("N m")) {
                    (true, _) => Field::Velocity,
                    (_, true) => Field::Effort,
                    _ => Field::Position,
                };
                frame_of(0, Content::Numbers(port.numbers.iter().map(name).collect(), field))
            }
        }
    }

    /// Returns the frame that the pose moves in another one.
    fn child(&self) -> Option<&String> {
        match &self.content {
            Content::Pose { child } if !child.is_empty() && !self.frame.is_empty() && *child != self.frame => {
                Some(child)
            }
            _ => None,
        }
    }

    fn header(&self, stamp: Time) -> Header {
        Header { stamp, frame_id: self.frame.clone() }
    }

    fn picture(&self, stamp: Time, sample: &PortSample) -> Option<Picture> {
        let Content::Picture(image, channels) = &self.content else { return None };
        let cells = sample.values.as_ref()?;
        let [rows, cols] = [image.rows, image.cols];
        let bytes = |cell: &Option<f64>| (cell.unwrap_or(f64::NAN) as f32).to_le_bytes();
        (cells.len() == rows * cols * channels).then(|| Picture {
            header: self.header(stamp),
            height: rows as u32,
            width: cols as u32,
            encoding: format!("32FC{channels}"),
            is_bigendian: 0,
            step: (4 * channels * cols) as u32,
            data: cells.iter().flat_map(bytes).collect(),
        })
    }

    fn pose(&self, stamp: Time, sample: &PortSample) -> Option<PoseStamped> {
        let [x, y, z, qx, qy, qz, qw] = numbers_of(sample)?;
        Some(PoseStamped { header: self.header(stamp), position: [x, y, z], orientation: [qx, qy, qz, qw] })
    }

    fn twist(&self, stamp: Time, sample: &PortSample) -> Option<TwistStamped> {
        let [vx, vy, vz, wx, wy, wz] = numbers_of(sample)?;
        Some(TwistStamped { header: self.header(stamp), linear: [vx, vy, vz], angular: [wx, wy, wz] })
    }

    /// Returns the numbers with their names. One that is absent is NaN, so that a curve has a gap there.
    fn numbers(&self, stamp: Time, sample: &PortSample) -> Option<JointState> {
        let Content::Numbers(names, field) = &self.content else { return None };
        let number = |i: usize| sample.values.as_ref().and_then(|values| values.get(i).copied().flatten());
        let numbers: Vec<f64> = (0..names.len()).map(|i| number(i).unwrap_or(f64::NAN)).collect();
        let mut message = JointState { header: self.header(stamp), name: names.clone(), ..JointState::default() };
        match field {
            Field::Position => message.position = numbers,
            Field::Velocity => message.velocity = numbers,
            Field::Effort => message.effort = numbers,
        }
        Some(message)
    }
}

/// Returns the numbers of a value that has all of them.
fn numbers_of<const N: usize>(sample: &PortSample) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = sample.values.as_ref()?.iter().copied().collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(name: &str, kind: &str, frames: &[&str], numbers: &[(&str, &str)]) -> PortFacts {
        PortFacts {
            name: name.into(),
            kind: kind.into(),
            frames: frames.iter().map(|frame| Some((*frame).to_owned())).collect(),
            numbers: numbers.iter().map(|(name, unit)| ((*name).into(), (*unit).into())).collect(),
            image: None,
        }
    }

    fn sample(values: &[f64]) -> PortSample {
        let number = |value: &f64| Some(*value).filter(|value| value.is_finite());
        PortSample { stamp_ns: 1_500_000_000, values: Some(values.iter().map(number).collect()) }
    }

    fn naming(frames: &[(&str, &str)]) -> Naming {
        let frames = frames.iter().map(|(from, to)| ((*from).into(), (*to).into())).collect();
        Naming { prefix: "/cell".into(), frames, has_transforms: true }
    }

    #[test]
    fn numbers_keep_their_names_and_a_gap_where_they_are_absent() {
        let stamp = Time::of_nanos(1);
        let of = |port: &PortFacts, values: &[f64]| {
            Shape::of(port, &Naming::default()).numbers(stamp, &sample(values)).unwrap()
        };
        let features = of(&port("pid.control", "features", &[], &[("x", "m/s"), ("pressure", "1")]), &[0.5, f64::NAN]);
        assert_eq!((features.name, features.position[0]), (vec!["x".to_owned(), "pressure".to_owned()], 0.5));
        assert!(features.position[1].is_nan() && features.velocity.is_empty());
        let scalar = of(&port("touch.moments.x", "scalar", &["pad"], &[("", "m")]), &[0.25]);
        assert_eq!(
            (scalar.name, scalar.position, scalar.header.frame_id),
            (vec!["x".to_owned()], vec![0.25], "pad".into())
        );
        let joints = of(&port("ik.velocity", "joints", &[], &[("a1", "rad/s"), ("a2", "rad/s")]), &[0.1, 0.2]);
        assert_eq!((joints.velocity, joints.position), (vec![0.1, 0.2], vec![]));
        let absent = PortSample { stamp_ns: 0, values: None };
        let shape = Shape::of(&port("a.b", "scalar", &[], &[("", "m")]), &Naming::default());
        assert!(shape.numbers(stamp, &absent).unwrap().position[0].is_nan());
    }

    #[test]
    fn a_pose_is_written_in_its_second_frame_under_the_names_of_ros() {
        let numbers = ["x", "y", "z", "qx", "qy", "qz", "qw"].map(|name| (name, "1"));
        let shape =
            Shape::of(&port("state.sensor_pose", "pose", &["pad", "base"], &numbers), &naming(&[("base", "link0")]));
        assert_eq!(shape.child().map(String::as_str), Some("pad"));
        let pose = shape.pose(Time::of_nanos(1), &sample(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8])).unwrap();
        assert_eq!((pose.header.frame_id.as_str(), pose.position), ("link0", [1.0, 2.0, 3.0]));
        assert_eq!(pose.orientation, [0.0, 0.0, 0.6, 0.8]);
        // One that is not whole is not published.
        assert_eq!(shape.pose(Time::of_nanos(1), &sample(&[1.0, 2.0, 3.0, 0.0, 0.0, f64::NAN, 0.8])), None);
        assert_eq!(shape.pose(Time::of_nanos(1), &PortSample { stamp_ns: 1, values: None }), None);
    }

    #[test]
    fn an_image_has_the_bytes_of_its_cells() {
        let image = ImageFacts { rows: 1, cols: 2, pitch: [0.005; 2], unit: "N".into() };
        let facts = PortFacts { image: Some(image), ..port("pad.vectors", "vector_image", &["pad"], &[]) };
        let picture = |facts: &PortFacts, values: &[f64]| {
            Shape::of(facts, &Naming::default()).picture(Time::of_nanos(1), &sample(values))
        };
        let made = picture(&facts, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        assert_eq!((made.encoding.as_str(), made.step, made.height, made.width), ("32FC3", 24, 1, 2));
        let bytes: Vec<u8> = (1..=6).flat_map(|value| (value as f32).to_le_bytes()).collect();
        assert_eq!(made.data, bytes);
        assert!(picture(&facts, &[1.0, 2.0]).is_none());
    }

    #[test]
    fn names_that_mean_nothing_are_refused() {
        for (prefix, is_good) in [("/tactflow", true), ("/a/b_1", true), ("a", false), ("/", false), ("/a-b", false)] {
            assert_eq!(Naming { prefix: prefix.into(), ..Naming::default() }.check().is_ok(), is_good, "{prefix}");
        }
        assert_eq!(naming(&[]).topic("touch.moments.x"), "/cell/touch/moments/x");
        let ports = [port("a.b", "pose", &["pad", "base"], &[]), port("c.d", "scalar", &[], &[])];
        assert_eq!(naming(&[("base", "link0")]).check_frames(&ports), Ok(()));
        let why = naming(&[("bass", "link0")]).check_frames(&ports).unwrap_err();
        assert_eq!(why, "no published port has the frame `bass`; they have `base`, `pad`");
        assert!(naming(&[("base", "link0")]).check_frames(&ports[1..]).is_err());
    }
}
