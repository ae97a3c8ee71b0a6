//! The simulated bench, stepped from outside through the contract that every stepped device has.

use std::fs;
use std::path::Path;

use nalgebra::IsometryMatrix3;
use tactflow_nodes::arm::chain::Chain;
use tactflow_nodes::arm::model::load;
use tactflow_nodes::arm::mount::Mount;
use tactflow_nodes::builtin;
use tactflow_runtime::device::{Command, Commands, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{FilePath, Mistakes, Reader};
use tactflow_runtime::signal::{Image, Joint, Joints, Scalar, Twist};
use tactflow_runtime::source::{SourceMap, Value, parse_table};

/// The posture of the arm at one time, and what its pad feels.
pub(super) struct Posture {
    /// Time since the start [s].
    pub(super) time: f64,
    /// Joint positions [rad].
    pub(super) position: Vec<f64>,
    /// Joint velocities [rad/s].
    pub(super) speed: Vec<f64>,
    /// Joint positions that the commands add up to [rad].
    pub(super) equilibrium: Vec<f64>,
    /// Pose of the tip in the base.
    pub(super) tip: IsometryMatrix3<f64>,
    /// Pose of the sensor in the base.
    pub(super) sensor: IsometryMatrix3<f64>,
    /// Force on the pad along its z [N].
    pub(super) force: f64,
    /// Centre of pressure in the sensor's frame [m]; `None` without contact.
    pub(super) centre: Option<[f64; 2]>,
    /// Mean force of the tactels in contact [N per tactel]; `None` without contact.
    pub(super) pressure: Option<f64>,
}

/// A `sim_bench` that is open.
pub(super) struct Simulation {
    device: Box<dyn Stepped>,
    samples: Samples,
    commands: Commands,
    image: Output<Image>,
    position: Output<Joints>,
    equilibrium: Output<Joints>,
    truth: [Output<Scalar>; 4],
    velocity: Command,
    tip: Chain,
    sensor: Chain,
    last: Option<(f64, Vec<f64>)>,
}

impl Simulation {
    /// Opens the `sim_bench` of a bench file; `set` replaces some of its parameters.
    ///
    /// # Errors
    /// What cannot be read, or is wrong in the files.
    pub(super) fn open(bench: &Path, set: &toml::Table) -> Result<Self, String> {
        let mut table = device_table(bench)?;
        table.extend(set.clone());
        let text = toml::to_string(&table).map_err(|error| error.to_string())?;
        let mut sources = SourceMap::with_builtin(builtin::FILES);
        let value = parse_table(sources.add_file(bench, text)).map_err(|error| format!("{error:?}"))?;
        let mut reader = Reader::new(&sources);
        let Some(Opened { description, driver }) = sim_bench(&value, &mut reader) else {
            return Err(messages(&reader.mistakes));
        };
        let Driver::Stepped(device) = driver else { return Err("`sim_bench` is not a stepped device".into()) };
        let missing = |name: &str| format!("`sim_bench` has no port `{name}`");
        let scalar = |name: &str| description.output::<Scalar>(name).ok_or_else(|| missing(name));
        let joints = |name: &str| description.output::<Joints>(name).ok_or_else(|| missing(name));
        let [tip, sensor] = chains(&table)?;
        Ok(Self {
            image: description.output("image").ok_or_else(|| missing("image"))?,
            position: joints("position")?,
            equilibrium: joints("equilibrium")?,
            truth: [scalar("force")?, scalar("x")?, scalar("y")?, scalar("pressure")?],
            velocity: description.command("velocity").ok_or_else(|| missing("velocity"))?,
            samples: Samples::of(&description),
            commands: Commands::of(&description),
            device,
            tip,
            sensor,
            last: None,
        })
    }

    /// The joints of the arm.
    pub(super) fn joints(&self) -> &[Joint] {
        self.tip.joints()
    }

    /// Returns the time of the next image [ns].
    pub(super) fn next_image(&self) -> Option<i64> {
        self.device.next()
    }

    /// Moves on to `now` [ns], at these velocities of the joints [rad/s].
    ///
    /// # Errors
    /// If the simulation fails.
    pub(super) fn step(&mut self, now: i64, velocity: &[f64]) -> Result<(), String> {
        self.commands.command(self.velocity, velocity);
        self.device.exchange(now, &self.commands, &mut self.samples).map_err(|error| error.to_string())
    }

    /// Returns the newest image [counts]; empty before the first.
    pub(super) fn counts(&self) -> &[f32] {
        self.samples.get(self.image).map_or(&[], Image::cells)
    }

    /// Returns the posture at `now` [ns], the time of the last step.
    pub(super) fn posture(&mut self, now: i64) -> Posture {
        let time = now as f64 * 1e-9;
        let joints = |port| self.samples.get::<Joints>(port).map_or_else(Vec::new, |joints| joints.0.to_vec());
        let (position, equilibrium) = (joints(self.position), joints(self.equilibrium));
        let [force, x, y, pressure] = self.truth.map(|port| self.samples.get(port).copied());
        let pose = |chain: &Chain| {
            let mut columns = vec![Twist::default(); chain.joints().len()];
            chain.forward(&position, &mut columns).0
        };
        let speed = match &self.last {
            Some((before, last)) if time > *before => {
                position.iter().zip(last).map(|(q, last)| (q - last) / (time - before)).collect()
            }
            _ => vec![0.0; position.len()],
        };
        let (tip, sensor) = (pose(&self.tip), pose(&self.sensor));
        self.last = Some((time, position.clone()));
        Posture {
            time,
            speed,
            tip,
            sensor,
            force: force.unwrap_or(0.0),
            centre: x.zip(y).map(|(x, y)| [x, y]),
            pressure,
            position,
            equilibrium,
        }
    }
}

fn messages(mistakes: &Mistakes) -> String {
    mistakes.iter().map(|mistake| mistake.message.as_str()).collect::<Vec<_>>().join("; ")
}

/// Opens the device as a graph does.
fn sim_bench(table: &Value, reader: &mut Reader<'_>) -> Option<Opened> {
    let catalogue = tactflow_nodes::catalogue();
    let device = catalogue.devices().iter().find(|device| device.name() == "sim_bench")?;
    device.open(table, reader)
}

fn read(path: &Path) -> Result<toml::Table, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Returns the parameters of the `sim_bench` of a bench, with those of its robot.
fn device_table(bench: &Path) -> Result<toml::Table, String> {
    let document = read(bench)?;
    let devices = document.get("devices").and_then(toml::Value::as_table);
    let is_bench = |device: &&toml::Table| device.get("type").and_then(toml::Value::as_str) == Some("sim_bench");
    let device = devices.and_then(|devices| devices.values().filter_map(toml::Value::as_table).find(is_bench));
    let mut device =
        device.ok_or_else(|| format!("{}: it has no device of type `sim_bench`", bench.display()))?.clone();
    device.remove("type");
    let folder = bench.parent().unwrap_or(Path::new(""));
    make_absolute(&mut device, "calibration", folder)?;
    make_absolute(&mut device, "urdf", folder)?;
    let Some(robot) = device.remove("robot").and_then(|robot| robot.as_str().map(str::to_owned)) else {
        return Ok(device);
    };
    let path = folder.join(robot);
    let mut document = read(&path)?;
    let Some(toml::Value::Table(mut robot)) = document.remove("robot") else {
        return Err(format!("{}: it has no section `[robot]`", path.display()));
    };
    make_absolute(&mut robot, "urdf", path.parent().unwrap_or(Path::new("")))?;
    robot.extend(device);
    Ok(robot)
}

/// Makes the path of a file independent of the folder of the file that names it.
fn make_absolute(table: &mut toml::Table, key: &str, folder: &Path) -> Result<(), String> {
    let Some(path) = table.get(key).and_then(toml::Value::as_str).filter(|path| !path.starts_with("builtin:")) else {
        return Ok(());
    };
    let path = std::path::absolute(folder.join(path)).map_err(|error| format!("`{path}`: {error}"))?;
    table.insert(key.into(), path.to_string_lossy().into_owned().into());
    Ok(())
}

/// Returns the chain to the tip of the arm, and that to the sensor.
fn chains(table: &toml::Table) -> Result<[Chain; 2], String> {
    let text =
        |key: &str| table.get(key).and_then(toml::Value::as_str).ok_or_else(|| format!("the arm has no `{key}`"));
    let (urdf, tip) = (text("urdf")?, text("tip")?);
    let contents = urdf.strip_prefix("builtin:").and_then(|name| builtin::FILES.iter().find(|file| file.0 == name));
    let urdf =
        FilePath { path: urdf.into(), span: 0..0, builtin: contents.map(|file| std::borrow::Cow::Borrowed(file.1)) };
    let numbers = |key: &str| -> [f64; 3] {
        let list = table.get("mount").and_then(|mount| mount.get(key)).and_then(toml::Value::as_array);
        let number = |i: usize| list.and_then(|list| list.get(i)).and_then(toml::Value::as_float);
        [0, 1, 2].map(|i| number(i).unwrap_or(0.0))
    };
    let mount = Mount { xyz: numbers("xyz"), rpy: numbers("rpy") };
    let chain = |mount: &Mount| load(&urdf, tip, mount).map_err(|mistakes| messages(&mistakes));
    Ok([chain(&Mount::NONE)?, chain(&mount)?])
}
