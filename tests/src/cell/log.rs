//! What a cell writes down: each command when it arrives, the motion at each beat of the robot, the truth at each image,
//! and how old the image was that was sent last.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};

use super::simulation::Posture;

/// Images whose times are kept: those that may be sent between the arrival of a command and its reading.
const KEPT_FRAMES: usize = 16;
/// Latencies that are kept.
const MAX_LATENCIES: usize = 1 << 20;
/// Change of a velocity that makes a command another one: four times what 32 bits of a position resolve in 4 ms [rad/s].
const CHANGE: f64 = 1e-4;

/// The log of a cell.
pub(super) struct Log {
    begin: Instant,
    commands: Option<BufWriter<File>>,
    motion: Option<BufWriter<File>>,
    truth: Option<BufWriter<File>>,
    /// The last images: when each was sent, and whether a command has changed since.
    frames: VecDeque<(Instant, bool)>,
    sent: u64,
    dropped: u64,
    arrived: u64,
    velocity: Vec<f64>,
    /// Time from an image to each command after it [ms].
    ages: Vec<f32>,
    /// Time from an image to the first command after it that is another one [ms].
    answers: Vec<f32>,
}

impl Log {
    /// Begins a log, with files in a folder if there is one.
    ///
    /// # Errors
    /// If the files cannot be made.
    pub(super) fn begin(folder: Option<&Path>, joints: usize, begin: Instant) -> io::Result<Self> {
        let file = |name: &str, header: &str| -> io::Result<Option<BufWriter<File>>> {
            let Some(folder) = folder else { return Ok(None) };
            fs::create_dir_all(folder)?;
            let mut file = BufWriter::new(File::create(folder.join(name))?);
            writeln!(file, "{header}")?;
            Ok(Some(file))
        };
        let velocities: Vec<String> = (1..=joints).map(|i| format!("dq{i}_rad_s")).collect();
        let header = format!("t_s,since_image_ms,is_followed,{}", velocities.join(","));
        Ok(Self {
            begin,
            commands: file("commands.csv", &header)?,
            motion: file("motion.csv", "t_s,speed_rad_s")?,
            truth: file(
                "truth.csv",
                "t_s,force_n,x_m,y_m,pressure_n,tip_x_m,tip_y_m,tip_z_m,sensor_x_m,sensor_y_m,sensor_z_m,speed_rad_s",
            )?,
            frames: VecDeque::new(),
            sent: 0,
            dropped: 0,
            arrived: 0,
            velocity: vec![0.0; joints],
            ages: Vec::new(),
            answers: Vec::new(),
        })
    }

    /// Notes an image that has been sent at `at`, or dropped, and the truth when it was taken.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn image(&mut self, at: Instant, is_sent: bool, posture: &Posture) -> io::Result<()> {
        if is_sent {
            self.sent += 1;
            self.frames.push_back((at, false));
            if self.frames.len() > KEPT_FRAMES {
                self.frames.pop_front();
            }
        } else {
            self.dropped += 1;
        }
        let Some(file) = &mut self.truth else { return Ok(()) };
        let or_empty = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
        let [x, y] = [0, 1].map(|i| or_empty(posture.centre.map(|centre| centre[i])));
        let [tip, sensor] = [&posture.tip, &posture.sensor].map(|pose| pose.translation.vector);
        let speed = fastest(&posture.speed);
        write!(file, "{:.4},{:.4},{x},{y},{}", posture.time, posture.force, or_empty(posture.pressure))?;
        for place in tip.iter().chain(&sensor) {
            write!(file, ",{place:.6}")?;
        }
        writeln!(file, ",{speed:.6}")
    }

    /// Notes at which velocities the robot moves its joints from a beat on [rad/s].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn beat(&mut self, time: f64, velocity: &[f64]) -> io::Result<()> {
        let Some(file) = &mut self.motion else { return Ok(()) };
        writeln!(file, "{time:.5},{:.6}", fastest(velocity))
    }

    /// Notes a command that arrived at `at`: the velocities that it asks for [rad/s], and whether the robot follows it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn command(&mut self, at: Instant, is_followed: bool, velocity: &[f64]) -> io::Result<()> {
        self.arrived += 1;
        let is_another = self.velocity.iter().zip(velocity).any(|(last, v)| (last - v).abs() > CHANGE);
        self.velocity.copy_from_slice(velocity);
        let frame = self.frames.iter_mut().rev().find(|(sent, _)| *sent <= at);
        let age = frame.as_ref().map(|(sent, _)| (at - *sent).as_secs_f32() * 1e3);
        if is_followed && self.ages.len() < MAX_LATENCIES {
            self.ages.extend(age);
            if let Some((_, is_answered)) = frame
                && is_another
                && !*is_answered
            {
                *is_answered = true;
                self.answers.extend(age);
            }
        }
        let Some(file) = &mut self.commands else { return Ok(()) };
        let age = age.map_or_else(String::new, |age| format!("{age:.3}"));
        write!(file, "{:.5},{age},{}", (at - self.begin).as_secs_f64(), u8::from(is_followed))?;
        for v in velocity {
            write!(file, ",{v:.6}")?;
        }
        writeln!(file)
    }

    /// Moves the start of the time, after a delay of the cell itself.
    pub(super) fn begin_at(&mut self, begin: Instant) {
        self.begin = begin;
    }

    /// Writes the rest to the files, and returns the figures of the cell.
    ///
    /// # Errors
    /// If the files cannot be written.
    pub(super) fn end(&mut self) -> io::Result<Value> {
        for file in self.commands.iter_mut().chain(&mut self.motion).chain(&mut self.truth) {
            file.flush()?;
        }
        Ok(json!({
            "images": self.sent,
            "dropped_images": self.dropped,
            "commands": self.arrived,
            "since_image_ms": percentiles(&mut self.ages),
            "answer_ms": percentiles(&mut self.answers),
        }))
    }
}

/// Returns the largest speed of a joint [rad/s].
pub(super) fn fastest(velocity: &[f64]) -> f64 {
    velocity.iter().fold(0.0, |most, speed| most.max(speed.abs()))
}

/// Returns the number, the median, the 99th percentile and the largest of some times.
fn percentiles(times: &mut [f32]) -> Value {
    times.sort_by(f32::total_cmp);
    let at = |share: f64| {
        let last = times.len().checked_sub(1)?;
        times.get((last as f64 * share).round() as usize).map(|time| (f64::from(*time) * 1e3).round() / 1e3)
    };
    json!({ "count": times.len(), "p50": at(0.5), "p99": at(0.99), "most": at(1.0) })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use nalgebra::IsometryMatrix3;

    use super::*;

    #[test]
    fn a_command_is_as_old_as_the_image_before_its_arrival() {
        let begin = Instant::now();
        let at = |ms: u64| begin + Duration::from_millis(ms);
        let mut log = Log::begin(None, 1, begin).unwrap();
        let pose = IsometryMatrix3::identity();
        let posture = Posture {
            time: 0.0,
            position: vec![0.0],
            speed: vec![0.0],
            equilibrium: vec![0.0],
            tip: pose,
            sensor: pose,
            force: 0.0,
            centre: None,
            pressure: None,
        };
        log.image(at(10), true, &posture).unwrap();
        log.image(at(20), true, &posture).unwrap();
        // It arrived before the second image, and changes nothing; the next two do, and one of them is the answer.
        log.command(at(14), true, &[0.0]).unwrap();
        log.command(at(23), true, &[0.1]).unwrap();
        log.command(at(29), true, &[0.2]).unwrap();
        let figures = log.end().unwrap();
        assert_eq!(figures["since_image_ms"], json!({ "count": 3, "p50": 4.0, "p99": 9.0, "most": 9.0 }));
        assert_eq!(figures["answer_ms"], json!({ "count": 1, "p50": 3.0, "p99": 3.0, "most": 3.0 }));
    }
}
