//! `tactflow ros2 publish`: ports of a run as topics, for others to see.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use tactflow_runtime::cli::{FAULTED, FoundRun, NotFound, RunArg, Shell, clap, table};
use tactflow_runtime::socket::{Following, RunEnd};

use super::domain::DomainArgs;
use super::statuses::{of_end, of_nothing, of_run, of_silence};
use crate::devices::ros2::shown::{Board, Naming, Status, Topics};

/// Time between two looks at the state of a run.
const LOOK: Duration = Duration::from_millis(100);
/// Longest time between two messages of the same state.
const REPEAT: Duration = Duration::from_secs(1);

/// Publish ports of a graph that runs as topics of ROS 2, and its state on /diagnostics
#[derive(clap::Parser)]
#[command(
    name = "publish",
    after_help = "Examples:
  tactflow ros2 publish pad.image 'touch.*'            images and features
  tactflow ros2 publish 'move.sensor_pose' --frame arm.base=panda_link0
  tactflow ros2 publish '*' --wait                     everything, of this run and of each that follows

The port `touch.moments.x` is the topic `/tactflow/touch/moments/x`. Images are sensor_msgs/Image, poses
geometry_msgs/PoseStamped and /tf, twists geometry_msgs/TwistStamped, and all other numbers sensor_msgs/JointState, by
their names. Without a port, only /diagnostics is published. The run waits for nobody: this command reads its socket, as
`watch` does, so it reaches no run in virtual time.

Exit codes: 0 the run has ended; 1 it has ended in a fault, or is gone without an end; 2 it is not found, or a name means
nothing."
)]
pub(super) struct PublishArgs {
    /// A port, or a pattern in which `*` stands for any text
    #[arg(value_name = "PORT")]
    ports: Vec<String>,
    #[command(flatten)]
    run: RunArg,
    /// Wait until a run begins, and for the next one when it has ended; Ctrl-C ends it
    #[arg(long)]
    wait: bool,
    /// Greatest number of messages of a port in a second
    #[arg(long, value_name = "HZ", value_parser = rate, default_value = "50")]
    rate: f64,
    /// What the names of the topics begin with
    #[arg(long, value_name = "PREFIX", default_value = "/tactflow")]
    prefix: String,
    /// Name of a frame of the graph in ROS, such as arm.base=panda_link0; may be repeated
    #[arg(long, value_name = "FRAME=NAME", value_parser = renamed)]
    frame: Vec<(String, String)>,
    /// Publish no transforms on /tf
    #[arg(long)]
    no_tf: bool,
    #[command(flatten)]
    domain: DomainArgs,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.1..=1000.0).contains(rate));
    rate.ok_or_else(|| "write a number from 0.1 to 1000".to_owned())
}

fn renamed(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((from, to)) if !from.is_empty() && !to.is_empty() => Ok((from.to_owned(), to.to_owned())),
        _ => Err("write the frame of the graph and its name in ROS, such as `arm.base=panda_link0`".to_owned()),
    }
}

pub(super) fn run(args: &PublishArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    let naming = Naming { prefix: args.prefix.clone(), frames: args.frame.clone(), has_transforms: !args.no_tf };
    naming.check().map_err(refuse)?;
    let board = Board::join(args.domain.id(), args.domain.network).map_err(refuse)?;
    let mut said = String::new();
    loop {
        let found = find(args, shell, &board).map_err(refuse)?;
        match show(args, (&board, &naming), found, shell) {
            Ok(code) if !args.wait => return Ok(code),
            Ok(_) => said.clear(),
            Err(why) if !args.wait => return Err(shell.refuse(why)),
            Err(why) => {
                // Perhaps the run ends, and the next one fits.
                if why != said {
                    shell.warning(&why);
                    said = why;
                }
                board.diagnose(&[of_nothing()]);
                sleep(REPEAT);
            }
        }
    }
}

/// Finds the run, or waits for it. While it waits, `board` says that nothing runs.
fn find(args: &PublishArgs, shell: &Shell, board: &Board) -> Result<FoundRun, String> {
    let mut said: Option<Instant> = None;
    loop {
        match args.run.find() {
            Ok(run) => return Ok(run),
            Err(NotFound { message, may_begin }) if !(may_begin && args.wait) => return Err(message),
            Err(_) => {}
        }
        if said.is_none() {
            shell.say_beside("waiting for a run");
        }
        if said.is_none_or(|said| said.elapsed() >= REPEAT) {
            said = Some(Instant::now());
            board.diagnose(&[of_nothing()]);
        }
        sleep(LOOK);
    }
}

/// Publishes a run until it has ended. Returns the exit code.
///
/// # Errors
/// Why it cannot be published.
fn show(
    args: &PublishArgs,
    (board, naming): (&Board, &Naming),
    mut run: FoundRun,
    shell: &Shell,
) -> Result<u8, String> {
    let about = run.about()?;
    let following = run.follow(args.ports.clone(), 1e3 / args.rate)?;
    let topics = board.topics(following.ports(), naming)?;
    let rows = topics.rows();
    shell.say_beside(&format!("{} (process {}) is published on /diagnostics{}", about.graph, about.pid, and(&rows)));
    let lost = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&lost);
    let worker = std::thread::spawn(move || publish(following, &topics, &counted));
    let end = diagnose(board, &mut run, worker, about.graph.as_str());
    let lost = lost.load(Ordering::Relaxed);
    if lost > 0 {
        shell.warning(format_args!("{lost} messages were not sent, because a subscriber did not answer"));
    }
    let end = end?;
    board.diagnose(&[of_end(&about.graph, end.as_ref())]);
    board.settle();
    Ok(match end {
        Some(RunEnd { reason, is_fault: false }) => {
            shell.say_beside(&format!("the run has ended: {reason}"));
            0
        }
        Some(RunEnd { reason, is_fault: true }) => {
            shell.error(format_args!("the run has ended in a fault: {reason}"));
            FAULTED
        }
        None => {
            shell.error("the run is gone, and has not said why: it was killed, or it has crashed");
            FAULTED
        }
    })
}

/// Lists the topics behind the first one.
fn and(rows: &[[String; 2]]) -> String {
    if rows.is_empty() { String::new() } else { format!(" and\n\n{}", table(rows, 0, 0).trim_end()) }
}

/// Publishes values until the run is gone. Returns how it has ended, if it has said so.
fn publish(mut following: Following, topics: &Topics, lost: &AtomicU64) -> Result<Option<RunEnd>, String> {
    let mut end = None;
    while let Some(followed) = following.wait()? {
        for (port, sample) in &followed.ports {
            if !topics.publish(port, sample) {
                lost.fetch_add(1, Ordering::Relaxed);
            }
        }
        end = followed.end.or(end);
    }
    Ok(end)
}

/// Publishes the state of a run each second, and when it changes, until the values end.
fn diagnose(
    board: &Board,
    run: &mut FoundRun,
    worker: JoinHandle<Result<Option<RunEnd>, String>>,
    graph: &str,
) -> Result<Option<RunEnd>, String> {
    let mut last: Option<(Instant, Vec<Status>)> = None;
    while !worker.is_finished() {
        let statuses = match run.about() {
            Ok(about) => of_run(&about),
            Err(why) => {
                // Perhaps it ends.
                sleep(LOOK);
                vec![of_silence(graph, &why)]
            }
        };
        // The values change in each tick: they alone are no change of the state.
        let is_same =
            |(_, last): &(Instant, Vec<Status>)| last.iter().map(Status::state).eq(statuses.iter().map(Status::state));
        let is_due = last.as_ref().is_none_or(|last| !is_same(last) || last.0.elapsed() >= REPEAT);
        if is_due && !worker.is_finished() {
            board.diagnose(&statuses);
            last = Some((Instant::now(), statuses));
        }
        sleep(LOOK);
    }
    worker.join().unwrap_or_else(|_| Err("the thread that publishes has panicked".to_owned()))
}
