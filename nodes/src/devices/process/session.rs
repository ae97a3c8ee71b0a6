//! The conversation with a program: its signature, the start, and a question with its answer.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::child::{Program, Received};
use super::launch::Launch;
use super::signature::{Signature, VERSION};
use super::wire::{self, Frame, Question, Value};

/// Returns the command that writes the signature of a program, to paste into a shell.
pub(super) fn signature_command(command: &[String]) -> String {
    format!("tactflow signature -- {}", in_shell(command))
}

/// Writes a command as a shell reads it.
pub(crate) fn in_shell(command: &[String]) -> String {
    // Only a zero byte has no way to be written, and no argument of a process has one.
    shlex::try_join(command.iter().map(String::as_str)).unwrap_or_else(|_| command.join(" "))
}

/// A program whose signature agrees.
pub(super) struct Session {
    program: Program,
    signature: Signature,
    timeout: Duration,
}

impl Session {
    /// Starts a program, compares its signature with the file, and sends it the shapes of its inputs and its parameters.
    pub(super) async fn start(launch: &Launch, inputs: Vec<Json>) -> Result<Self, String> {
        let mut program = Program::start(launch)?;
        let stated = receive_signature(&mut program, launch.start, "`start_s`").await?;
        if let Some(difference) = launch.signature.differs_from(&stated) {
            let command = signature_command(&launch.command);
            return Err(format!("{difference}: write the file once more with `{command}`"));
        }
        let start = json!({ "tactflow": VERSION, "inputs": inputs, "params": launch.values });
        program.send(format!("{start}\n").into_bytes())?;
        Ok(Self { program, signature: launch.signature.clone(), timeout: launch.timeout })
    }

    /// Asks a question and waits for its answer.
    pub(super) async fn ask(&mut self, question: Question) -> Result<Vec<Value>, String> {
        let (number, stamp) = (question.number, question.stamp);
        self.program.send(question.frame())?;
        let frame = match tokio::time::timeout(self.timeout, self.frame()).await {
            Ok(frame) => frame?,
            Err(_) => return Err(format!("no answer within {} ms (`timeout_ms`): it hangs", self.timeout.as_millis())),
        };
        if (frame.number, frame.stamp) != (number, stamp) {
            let (theirs, ours) = (frame.number, number);
            return Err(match theirs == ours {
                true => format!("its answer {ours} has the stamp {}, and the question had {stamp}", frame.stamp),
                false => format!("it answers question {theirs}, and {ours} was asked"),
            });
        }
        wire::values(&frame, &self.signature)
    }

    /// Returns the next frame, as soon as it is there.
    pub(super) async fn frame(&mut self) -> Result<Frame, String> {
        match self.program.received.recv().await {
            Some(Received::Frame(frame)) => Ok(frame),
            Some(Received::Broken(why)) => Err(why),
            Some(Received::Line(_)) => Err("it states its signature twice".to_owned()),
            None => Err(self.program.exit_message()),
        }
    }

    /// Returns a frame that is there already.
    pub(super) fn waiting(&mut self) -> Option<Received> {
        self.program.received.try_recv().ok()
    }

    /// Lets the program end by itself.
    pub(super) fn dismiss(&mut self) {
        self.program.dismiss();
    }
}

/// Waits for the signature as long as the parameter `param` says.
async fn receive_signature(program: &mut Program, patience: Duration, param: &str) -> Result<Signature, String> {
    let received = tokio::time::timeout(patience, program.received.recv()).await;
    let received = received
        .map_err(|_| format!("it has not stated its signature within {} s ({param})", patience.as_secs_f64()))?;
    match received {
        Some(Received::Line(line)) => Signature::from_line(&line).map_err(|why| {
            let start: String = line.trim_end().chars().take(60).collect();
            format!("its first line is no signature: {why} (it begins with `{start}`)")
        }),
        Some(Received::Broken(why)) => Err(why),
        Some(Received::Frame(_)) => Err("it sends a frame before its signature".to_owned()),
        None => Err(program.exit_message()),
    }
}

/// Runs a program until it has stated its signature.
///
/// # Errors
/// Why it has not.
pub(crate) fn ask_signature(command: &[String], folder: &Path, patience: Duration) -> Result<Signature, String> {
    let nothing = Signature {
        tactflow: VERSION,
        name: command.first().cloned().unwrap_or_default(),
        doc: String::new(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        params: Vec::new(),
    };
    let launch = Launch {
        command: command.to_vec(),
        folder: folder.to_path_buf(),
        signature: nothing,
        values: BTreeMap::new(),
        period: Duration::ZERO,
        timeout: patience,
        start: patience,
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
    let runtime = runtime.map_err(|error| error.to_string())?;
    let mut program = Program::start(&launch)?;
    let signature = runtime.block_on(receive_signature(&mut program, patience, "`--for`"))?;
    program.dismiss();
    Ok(signature)
}
