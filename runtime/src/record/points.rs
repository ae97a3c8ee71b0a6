//! Points of a surface: each new value of a pose is a vertex of a PLY file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyAccess, PropertyDef, PropertyType, ScalarType};
use ply_rs_bw::writer::Writer;

use super::Columns;
use crate::engine::Engine;
use crate::graph::{Compiled, PlannedPort};
use crate::node::PortId;
use crate::signal::{Freshness, Kind, Pose, Signal};
use crate::source::suggestion;

/// Which points are written, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// The pose, and what else is written of each point; empty for the pose that the graph reports.
    ports: Vec<String>,
    /// The file.
    pub path: PathBuf,
}

impl std::str::FromStr for Wanted {
    type Err = String;

    /// `surface.ply`, `ruler.pose=surface.ply`, or `ruler.pose,touch.pressure=surface.ply`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (ports, path) = text.split_once('=').map_or((None, text), |(ports, path)| (Some(ports), path));
        if Path::new(path).extension().is_none_or(|extension| extension != "ply") {
            return Err(format!("`{path}` is no .ply: give a file, or ports and a file, as ruler.pose=surface.ply"));
        }
        let ports: Vec<String> =
            ports.iter().flat_map(|ports| ports.split(',')).map(|port| port.trim().into()).collect();
        Ok(Self { ports, path: path.into() })
    }
}

/// The ports of points in a graph.
#[derive(Debug, Clone)]
pub struct Chosen {
    pose: PlannedPort,
    /// As the command line calls them.
    beside: Vec<(String, PlannedPort)>,
}

impl Wanted {
    /// Looks the ports up.
    ///
    /// # Errors
    /// Which of them is not there, or of a kind that cannot be written.
    pub fn choose(&self, plan: &Compiled) -> Result<Chosen, String> {
        let Some((first, rest)) = self.ports.split_first() else {
            let mut poses = plan.reported().filter(|port| port.shape.kind() == Kind::Pose);
            let found = poses.next().filter(|_| poses.next().is_none()).cloned();
            let pose =
                found.ok_or("the graph does not report one pose: name a port, as --points ruler.pose=surface.ply")?;
            return Ok(Chosen { pose, beside: Vec::new() });
        };
        let pose = look_up(plan, first)?;
        if pose.shape.kind() != Kind::Pose {
            return Err(format!("`{first}` is {}, but a point is where a pose is", pose.shape.kind().with_article()));
        }
        let beside = rest.iter().map(|word| {
            let port = look_up(plan, word)?;
            if Columns::width(&port.shape) == 0 {
                return Err(format!("`{word}` is {}: it has no numbers to write", port.shape.kind().with_article()));
            }
            Ok((word.clone(), port))
        });
        Ok(Chosen { pose, beside: beside.collect::<Result<_, _>>()? })
    }
}

fn look_up(plan: &Compiled, word: &str) -> Result<PlannedPort, String> {
    plan.port(word).cloned().ok_or_else(|| {
        let names = plan.exports().iter().map(|(export, _)| export.as_str());
        let names = names.chain(plan.ports().map(|port| port.name.as_str()));
        format!("the graph has no port `{word}`: {}", suggestion(word, names, "ports"))
    })
}

/// What stands in every point, whatever is beside it: place, direction out of the surface, time.
const OWN: [&str; 7] = ["x", "y", "z", "nx", "ny", "nz", "time"];

/// Gathers the points of a run in memory, so that no tick waits for a disk: 56 bytes a point.
pub struct Points {
    file: File,
    pose: PortId,
    beside: Columns,
    names: Vec<String>,
    comments: Vec<String>,
    values: Vec<f64>,
}

impl Points {
    /// How a file of points begins.
    pub const START: &'static str = "ply\n";

    /// Creates the file.
    ///
    /// # Errors
    /// If it cannot be created.
    ///
    /// # Panics
    /// If the ports are those of another graph.
    pub fn create(path: &Path, chosen: &Chosen, engine: &Engine) -> io::Result<Self> {
        let id_of = |port: &PlannedPort| {
            let found = engine.ports().iter().find(|(other, _)| other.name == port.name);
            found.expect("the engine runs the plan that the port was found in").1
        };
        let frame = chosen.pose.frames.get(1).and_then(Option::as_deref).unwrap_or("its frame");
        let mut names: Vec<String> = OWN.map(str::to_owned).into();
        let mut comments = vec![
            format!("tactflow: x y z is where {} is in {frame} [m], a point for each new value", chosen.pose.name),
            "nx ny nz points out of the surface, against the sensor's z; time is in [s]".into(),
        ];
        for (word, port) in &chosen.beside {
            for column in Columns::of(port) {
                let part = column.name.strip_prefix(port.name.as_str()).unwrap_or_default();
                let name = format!("{word}{part}").replace('.', "_");
                comments.push(format!("{name} [{}]", column.unit));
                names.push(name);
            }
        }
        let ports: Vec<(PlannedPort, PortId)> =
            chosen.beside.iter().map(|(_, port)| (port.clone(), id_of(port))).collect();
        let (pose, beside) = (id_of(&chosen.pose), Columns::new(&ports));
        Ok(Self { file: File::create(path)?, pose, beside, names, comments, values: Vec::with_capacity(1 << 16) })
    }

    /// Takes the point of the tick that the engine has just run, if there is a new one.
    pub fn record(&mut self, engine: &Engine) {
        let bus = engine.bus();
        if bus.marks[self.pose.mark as usize].freshness(engine.ticks()) != Freshness::New {
            return;
        }
        let pose = Pose::arena(&bus.arenas)[self.pose.slot as usize].0;
        let (at, z) = (pose.translation.vector, pose.rotation.matrix().column(2).into_owned());
        self.values.extend([at.x, at.y, at.z, -z.x, -z.y, -z.z, engine.now() as f64 * 1e-9]);
        let from = self.values.len();
        self.values.resize(from + self.beside.list.len(), f64::NAN);
        self.beside.read(bus, &mut self.values[from..]);
    }

    /// Writes the points and closes the file; how many there are.
    ///
    /// # Errors
    /// If anything could not be written.
    pub fn finish(self) -> io::Result<usize> {
        let count = self.values.len() / self.names.len();
        let double = |name: &String| PropertyDef::new(name.clone(), PropertyType::Scalar(ScalarType::Double));
        let mut vertex = ElementDef::new("vertex".into());
        vertex.count = count;
        vertex.properties = self.names.iter().map(|name| (name.clone(), double(name))).collect();
        let mut header = Header::new();
        (header.encoding, header.comments) = (Encoding::BinaryLittleEndian, self.comments);
        header.elements.insert(vertex.name.clone(), vertex.clone());
        let (writer, mut out) = (Writer::<Vertex<'_>>::new(), BufWriter::new(self.file));
        writer.write_header(&mut out, &header)?;
        for values in self.values.chunks(self.names.len()) {
            writer.write_little_endian_element(&mut out, &Vertex { names: &self.names, values }, &vertex)?;
        }
        out.flush()?;
        Ok(count)
    }
}

/// One point, as the writer asks for it.
struct Vertex<'a> {
    names: &'a [String],
    values: &'a [f64],
}

impl PropertyAccess for Vertex<'_> {
    fn new() -> Self {
        Self { names: &[], values: &[] }
    }

    fn get_double(&self, name: &str) -> Option<f64> {
        self.values.get(self.names.iter().position(|other| other == name)?).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wanted_is_ports_and_a_file() {
        let cases: [(&str, &[&str], &str); 4] = [
            ("surface.ply", &[], "surface.ply"),
            ("ruler.pose=a/b.ply", &["ruler.pose"], "a/b.ply"),
            ("ruler.pose, touch.pressure=b.ply", &["ruler.pose", "touch.pressure"], "b.ply"),
            ("ruler.pose=a=b.ply", &["ruler.pose"], "a=b.ply"),
        ];
        for (text, ports, path) in cases {
            let wanted: Wanted = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!((wanted.ports, wanted.path), (ports.iter().map(|&p| p.into()).collect(), path.into()), "{text}");
        }
        for text in ["", "surface", "surface.csv", "ruler.pose=", "ruler.pose=surface.obj", "surface.ply=ruler.pose"] {
            assert!(text.parse::<Wanted>().is_err(), "{text}");
        }
    }
}
