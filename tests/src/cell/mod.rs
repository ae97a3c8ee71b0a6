//! A robot cell that exists only in software: the simulated bench in real time, behind the wires of real devices.
//!
//! `tactflow-cell CELL.toml` steps a `sim_bench` with the clock. Its pad is served as one of three sensors, and its arm
//! as one of two robots, byte by byte as their makers describe the wires. So a task runs against it as against
//! hardware, and what the task does to the arm is measured where it arrives.
//!
//! | module | what it holds |
//! |---|---|
//! | `setup` | the file that describes a cell |
//! | `simulation` | the bench, stepped with the clock |
//! | `pty` | a pseudo-terminal in the place of a serial port |
//! | `flexitac`, `myrmex`, `tcp_pad` | the sensors |
//! | `lwr`, `ur` | the robots |
//! | `log` | what arrived, when, and what it did |
//! | `run` | the loop over all of them |
//!
//! The first line of its output is JSON with the ports and paths that it serves, and the last one is JSON with its
//! figures. A line on its standard input is answered with the time and the motion. It ends when its standard input ends, on SIGTERM, and after `for_s`.

mod flexitac;
mod log;
mod lwr;
mod myrmex;
mod pty;
mod run;
mod setup;
mod simulation;
mod tcp_pad;
mod ur;

use std::io;

use serde_json::Value;

pub use run::run;
pub use setup::Setup;

use log::Log;
use simulation::Posture;

/// A sensor: how an image goes out.
trait PadWire {
    /// Reads what hosts have sent, and accepts new ones.
    ///
    /// # Errors
    /// If the wire is broken for good.
    fn serve(&mut self) -> io::Result<()>;

    /// Sends an image [counts] that was taken at `time` [s]. Returns whether all of it has gone out.
    ///
    /// # Errors
    /// If the wire is broken for good.
    fn send(&mut self, counts: &[f32], time: f64) -> io::Result<bool>;

    /// Where a host finds it.
    fn place(&self) -> Value;

    /// What it has counted.
    fn counts(&self) -> Value {
        Value::Null
    }
}

/// A robot: how commands come in and its state goes out.
trait ArmWire {
    /// Reads the commands that have arrived, and sends the state. Returns the velocity of each joint until the next
    /// beat [rad/s].
    ///
    /// # Errors
    /// If the wire is broken for good.
    fn beat(&mut self, posture: &Posture, log: &mut Log) -> io::Result<Vec<f64>>;

    /// Time between two beats [s].
    fn period(&self) -> f64;

    /// Where a host finds it.
    fn place(&self) -> Value;

    /// What it has counted.
    fn counts(&self) -> Value;
}
