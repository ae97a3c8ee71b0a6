//! `tactflow press`: presses the simulated pad with a bladder and writes the log for a calibration.

use std::io::{BufWriter, Write};
use std::num::NonZeroUsize;
use std::path::PathBuf;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser};

use super::arguments::{may_replace, pair, positive};
use crate::sim::pad_model::MAX_TACTELS;
use crate::sim::readout::{Electronics, Readout};

/// Press the simulated pad with a bladder and write the log
#[derive(Parser)]
#[command(name = "press")]
#[command(
    after_help = "After five seconds without a load, the bladder presses on all tactels equally, slowly up to the maximum force and down again.
The log has the columns time [s], force [N] and the reading of each tactel [raw]; `tactflow calibrate` reads it.

Examples:
  tactflow press -o press.csv
  tactflow calibrate press.csv --load uniform -o pad.toml
  tactflow run graphs/hybrid.toml --set devices.bench.calibration=pad.toml

Exit codes: 0 success; 2 the log cannot be written."
)]
pub(super) struct PressArgs {
    /// Write the log; replaces a log of this command, but no other file
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Serial number of the pad: `electronics.serial` of a `sim_bench`
    #[arg(long, default_value_t = Electronics::default().serial)]
    serial: u64,
    /// Rows and columns of the pad
    #[arg(long, value_name = "ROWSxCOLS", value_parser = pair::<NonZeroUsize>, default_value = "16x16")]
    size: [NonZeroUsize; 2],
    /// Maximum force on a tactel [N]
    #[arg(long, value_name = "NEWTONS", value_parser = positive, default_value = "3")]
    most: f64,
}

/// Frames per second of the log [1/s].
const RATE_HZ: f64 = 50.0;
/// Time before the press, for the zero. There is no rest after the press, because the foam recovers slowly [s].
const REST_S: f64 = 5.0;
/// Time of the press, up and down [s].
const PRESS_S: f64 = 30.0;

pub(super) fn run(args: PressArgs, shell: &Shell) -> Result<u8, u8> {
    let [rows, cols] = args.size.map(NonZeroUsize::get);
    if rows.saturating_mul(cols) > MAX_TACTELS {
        let most = format_args!("a simulated pad has at most {MAX_TACTELS} tactels, not {rows} by {cols}");
        return Err(shell.refuse(most));
    }
    let frames = may_replace(&args.out, "a log of `press`", |text| text.starts_with("time,force,t0_0"))
        .and_then(|()| write(&args).map_err(|error| format!("cannot write `{}`: {error}", args.out.display())))
        .map_err(|message| shell.refuse(message))?;
    shell.say(&format!("wrote {}: {frames} frames at {RATE_HZ} Hz", args.out.display()));
    Ok(0)
}

fn write(args: &PressArgs) -> std::io::Result<usize> {
    let [rows, cols] = args.size.map(NonZeroUsize::get);
    let tactels = rows * cols;
    let mut readout = Readout::new(tactels, Electronics { serial: args.serial, ..Electronics::default() }, args.serial);
    let mut file = BufWriter::new(std::fs::File::create(&args.out)?);
    let names = (0..rows).flat_map(|i| (0..cols).map(move |j| format!(",t{i}_{j}")));
    writeln!(file, "time,force{}", names.collect::<String>())?;
    let mut counts = vec![0.0; tactels];
    let frames = ((REST_S + PRESS_S) * RATE_HZ) as usize;
    for frame in 0..frames {
        let time = frame as f64 / RATE_HZ;
        let each = args.most * bladder(time);
        readout.read(1.0 / RATE_HZ, &vec![each; tactels], &mut counts);
        write!(file, "{time:.2},{:.6}", each * tactels as f64)?;
        counts.iter().try_for_each(|count| write!(file, ",{count}"))?;
        writeln!(file)?;
    }
    file.flush()?;
    Ok(frames)
}

/// Returns the pressure of the bladder at a time [s], from 0 to 1.
fn bladder(time: f64) -> f64 {
    let t = (time - REST_S) / PRESS_S;
    if t < 0.0 { 0.0 } else { 1.0 - (2.0 * t - 1.0).abs() }
}
