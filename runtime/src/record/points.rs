//! Records the points of a surface: each new value of a pose becomes a vertex of a PLY file.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::PortColumns;
use super::output::{OutputFile, write_whole};
use super::writer::seconds;
use crate::engine::Engine;
use crate::graph::{Compiled, PlannedPort};
use crate::node::PortId;
use crate::signal::{Freshness, Kind, Pose};
use crate::source::suggestion;

/// The value of the option `--points`: the ports to record and the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointsRequest {
    /// The pose and the ports with extra values; empty for the pose that the graph reports.
    ports: Vec<String>,
    /// The file.
    pub path: PathBuf,
}

impl std::str::FromStr for PointsRequest {
    type Err = String;

    /// Parses `surface.ply`, `ruler.pose=surface.ply`, or `ruler.pose,touch.pressure=surface.ply`. The file `-` is the
    /// standard output.
    fn from_str(text: &str) -> Result<Self, String> {
        let (ports, path) = text.split_once('=').map_or((None, text), |(ports, path)| (Some(ports), path));
        if path.is_empty() {
            return Err(not_points(Path::new(path)));
        }
        let ports: Vec<String> =
            ports.iter().flat_map(|ports| ports.split(',')).map(|port| port.trim().into()).collect();
        Ok(Self { ports, path: path.into() })
    }
}

/// The ports of a [`PointsRequest`], resolved in a graph.
#[derive(Debug, Clone)]
pub struct PointPorts {
    pose: PlannedPort,
    /// Ports with extra values, each with its name on the command line.
    extra: Vec<(String, PlannedPort)>,
}

/// The message about a path that does not end in .ply.
fn not_points(path: &Path) -> String {
    let path = path.display();
    format!("`{path}` is not a .ply file: write `surface.ply`, or ports and a file as in `ruler.pose=surface.ply`")
}

impl PointsRequest {
    /// Checks that the path ends in .ply.
    ///
    /// # Errors
    /// Returns a message that says what to write instead.
    pub fn check_extension(&self) -> Result<(), String> {
        if self.path.extension().is_some_and(|extension| extension == "ply") {
            Ok(())
        } else {
            Err(not_points(&self.path))
        }
    }

    /// Resolves the ports in a graph.
    ///
    /// # Errors
    /// Returns a message that names the port that does not exist or whose kind cannot be written.
    pub fn resolve(&self, plan: &Compiled) -> Result<PointPorts, String> {
        let Some((first, rest)) = self.ports.split_first() else {
            let mut poses = plan.reported().filter(|port| port.shape.kind() == Kind::Pose);
            let found = poses.next().filter(|_| poses.next().is_none()).cloned();
            let pose = found.ok_or(
                "the graph does not report exactly one pose: name a port, as in `--points ruler.pose=surface.ply`",
            )?;
            return Ok(PointPorts { pose, extra: Vec::new() });
        };
        let pose = look_up(plan, first)?;
        if pose.shape.kind() != Kind::Pose {
            let kind = pose.shape.kind().with_article();
            return Err(format!("`{first}` is {kind}, but the first port of `--points` must be a pose"));
        }
        let extra = rest.iter().map(|name| {
            let port = look_up(plan, name)?;
            if PortColumns::width(&port.shape) == 0 {
                return Err(format!("`{name}` is {}, which has no numbers to write", port.shape.kind().with_article()));
            }
            Ok((name.clone(), port))
        });
        Ok(PointPorts { pose, extra: extra.collect::<Result<_, _>>()? })
    }
}

fn look_up(plan: &Compiled, name: &str) -> Result<PlannedPort, String> {
    plan.port(name).cloned().ok_or_else(|| {
        let names = plan.exports().iter().map(|(export, _)| export.as_str());
        let names = names.chain(plan.ports().map(|port| port.name.as_str()));
        format!("the graph has no port `{name}`: {}", suggestion(name, names, "ports"))
    })
}

/// Columns of every point: position, direction out of the surface, time.
const POINT_COLUMNS: [&str; 7] = ["x", "y", "z", "nx", "ny", "nz", "time"];

/// Collects the points of a run in memory, 56 bytes each, and writes them at the end, so no tick waits for the disk.
pub struct PointRecorder {
    file: OutputFile,
    pose: PortId,
    extra: PortColumns,
    names: Vec<String>,
    comments: Vec<String>,
    values: Vec<f64>,
}

impl PointRecorder {
    /// The first bytes of a PLY file.
    pub const FILE_START: &'static str = "ply\n";

    /// Creates a recorder that writes to an open file.
    ///
    /// # Panics
    /// If the ports belong to another graph.
    #[must_use]
    pub fn new(file: OutputFile, ports: &PointPorts, engine: &Engine) -> Self {
        let id_of = |port: &PlannedPort| {
            let found = engine.ports().iter().find(|(other, _)| other.name == port.name);
            found.expect("the ports were resolved in the graph of this engine").1
        };
        let frame = ports.pose.frames.get(1).and_then(Option::as_deref).unwrap_or("its frame");
        let mut names: Vec<String> = POINT_COLUMNS.map(str::to_owned).into();
        let mut comments = vec![
            format!("tactflow: x y z is the position of {} in {frame} [m], one point per new value", ports.pose.name),
            "nx ny nz points out of the surface, against the sensor's z; time is in [s]".into(),
        ];
        for (word, port) in &ports.extra {
            for column in PortColumns::of(port) {
                let name = format!("{word}{}", column.part).replace('.', "_");
                comments.push(format!("{name} [{}]", column.unit));
                names.push(name);
            }
        }
        let extra: Vec<(PlannedPort, PortId)> =
            ports.extra.iter().map(|(_, port)| (port.clone(), id_of(port))).collect();
        let (pose, extra) = (id_of(&ports.pose), PortColumns::new(&extra));
        Self { file, pose, extra, names, comments, values: Vec::with_capacity(1 << 16) }
    }

    /// Records the point of the last tick, if the pose is new.
    pub fn record(&mut self, engine: &Engine) {
        let bus = engine.bus();
        if bus.mark(self.pose).freshness(engine.ticks()) != Freshness::New {
            return;
        }
        let pose = bus.slot::<Pose>(self.pose).0;
        let (at, z) = (pose.translation.vector, pose.rotation.matrix().column(2).into_owned());
        self.values.extend([
            at.x,
            at.y,
            at.z,
            -z.x,
            -z.y,
            -z.z,
            seconds(engine.began().map_or(engine.now(), |began| began.time)),
        ]);
        let from = self.values.len();
        self.values.resize(from + self.extra.list.len(), f64::NAN);
        self.extra.read(bus, &mut self.values[from..]);
    }

    /// Writes the points, closes the file and returns the number of points. Waits while `goes_on` returns true for the
    /// number of bytes that have been written.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self, goes_on: impl FnMut(u64) -> bool) -> io::Result<usize> {
        let count = self.values.len() / self.names.len();
        let mut text = Vec::new();
        writeln!(text, "{}format binary_little_endian 1.0", Self::FILE_START)?;
        self.comments.iter().try_for_each(|comment| writeln!(text, "comment {comment}"))?;
        writeln!(text, "element vertex {count}")?;
        self.names.iter().try_for_each(|name| writeln!(text, "property double {name}"))?;
        writeln!(text, "end_header")?;
        text.extend(self.values.iter().flat_map(|value| value.to_le_bytes()));
        write_whole(self.file, text, goes_on).map(|()| count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_ports_and_a_file() {
        let cases: [(&str, &[&str], &str); 4] = [
            ("surface.ply", &[], "surface.ply"),
            ("ruler.pose=a/b.ply", &["ruler.pose"], "a/b.ply"),
            ("ruler.pose, touch.pressure=b.ply", &["ruler.pose", "touch.pressure"], "b.ply"),
            ("ruler.pose=a=b.ply", &["ruler.pose"], "a=b.ply"),
        ];
        for (text, ports, path) in cases {
            let request: PointsRequest = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(
                (request.ports, request.path),
                (ports.iter().map(|&p| p.into()).collect(), path.into()),
                "{text}"
            );
        }
        for text in ["", "surface", "surface.csv", "ruler.pose=", "ruler.pose=surface.obj", "surface.ply=ruler.pose"] {
            let error = text.parse().and_then(|request: PointsRequest| request.check_extension()).unwrap_err();
            assert!(error.contains("is not a .ply file"), "{text}: {error}");
        }
    }
}
