//! `--watch`: a graph that was saved is loaded again. In virtual time the run ends for it at once. In real time the graph
//! is checked first, and the run ends only while nothing moves and nothing touches its sensors.

use std::mem::discriminant;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, scope, sleep};
use std::time::Duration;

use super::saved::SavedFiles;
use super::{Job, JobOptions, slow};
use crate::cli::shell::Shell;
use crate::cli::text::number::seconds;
use crate::engine::{Engine, Interrupt, Unquiet};
use crate::graph::{self, Compiled, Request};

/// Time between two looks at a flag.
const LOOK: Duration = Duration::from_millis(50);
/// Time of the graph between two looks whether the run is quiet [s].
const PAUSE: f64 = 0.1;

/// Whether a run ends for a graph that was saved.
#[derive(Debug, Default)]
pub(super) struct Reload {
    /// Whether it must be quiet before: it moves an arm in real time.
    needs_quiet: bool,
    /// Whether it began halted.
    begins_halted: bool,
    /// Ends the run.
    pub(super) end: Arc<AtomicBool>,
    /// Whether a graph waits that was saved and has no mistake.
    is_waiting: AtomicBool,
    /// Whether the run has ended.
    is_over: AtomicBool,
}

impl Reload {
    /// Looks for saved files until the run is over. Returns the file for which another run begins.
    fn look(&self, saved: &mut SavedFiles, checks: impl Fn(&mut SavedFiles) -> bool, is_real: bool) -> Option<PathBuf> {
        let mut found = None;
        while !self.is_over.load(Ordering::Relaxed) {
            sleep(LOOK);
            let Some(path) = saved.saved() else { continue };
            if !is_real {
                self.end.store(true, Ordering::Relaxed);
                return Some(path);
            }
            self.is_waiting.store(false, Ordering::Relaxed);
            saved.begin();
            found = checks(saved).then_some(path);
            self.is_waiting.store(found.is_some(), Ordering::Relaxed);
        }
        found
    }

    /// Whether it has ended the run.
    pub(super) fn has_ended(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }
}

/// Notes that a run is over, also when it unwinds.
struct OverAtDrop<'a>(&'a AtomicBool);

impl Drop for OverAtDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The side of the ticks: ends the run once it is quiet.
pub(super) struct Exchange<'r> {
    reload: &'r Reload,
    /// Whether the operator knows that it began halted.
    has_announced: bool,
    /// The reason against it that was printed last.
    said: Option<Unquiet>,
    /// When to look again [s].
    next: f64,
}

impl<'r> Exchange<'r> {
    pub(super) const fn new(reload: &'r Reload) -> Self {
        Self { reload, has_announced: false, said: None, next: f64::NEG_INFINITY }
    }

    /// Called after each tick.
    pub(super) fn after(&mut self, engine: &Engine, shell: &Shell) {
        // Not before the first tick: what is typed from now on counts.
        if !std::mem::replace(&mut self.has_announced, true) && self.reload.begins_halted {
            shell.say_beside("the graph begins as after `stop`: nothing moves before `resume` is typed");
        }
        if !self.reload.is_waiting.load(Ordering::Relaxed) {
            self.said = None;
            return;
        }
        let now = seconds(engine.now());
        if now < self.next || self.reload.has_ended() {
            return;
        }
        self.next = now + PAUSE;
        match if self.reload.needs_quiet { engine.check_quiet() } else { Ok(()) } {
            Ok(()) => self.reload.end.store(true, Ordering::Relaxed),
            Err(why) if self.said.as_ref().is_some_and(|said| discriminant(said) == discriminant(&why)) => {}
            Err(why) => {
                shell.warning(format_args!(
                    "the saved graph has no mistake, and is not loaded before the run is halted, at rest and untouched: {why}"
                ));
                self.said = Some(why);
            }
        }
    }
}

impl JobOptions {
    /// Returns the options of a run after a graph was saved, in real time: a graph that moves begins halted, and its files
    /// replace none.
    fn after_saving(&self, moves: bool) -> Self {
        let numbered = |path: &PathBuf| super::target::numbered(path);
        let mut points = self.points.clone();
        points.iter_mut().for_each(|points| points.path = numbered(&points.path));
        Self {
            send: if moves { vec![(0.0, "stop".into())] } else { Vec::new() },
            change: Vec::new(),
            out: self.out.as_ref().map(numbered),
            #[cfg(feature = "mcap")]
            record: self.record.as_ref().map(numbered),
            points,
            svg: self.svg.as_ref().map(numbered),
            ..self.clone()
        }
    }
}

impl Job {
    /// Runs the graph again each time that one of its files is saved, until a signal ends it. Returns the exit code of the
    /// last run.
    pub(super) fn watch(&self, shell: &Shell) -> u8 {
        let interrupt = match Interrupt::catch() {
            Ok(interrupt) => interrupt,
            Err(error) => return shell.refuse(format_args!("cannot run: {error}")),
        };
        let (mut saved, mut is_first) = (SavedFiles::new(&self.request.graph), true);
        loop {
            saved.begin();
            let (code, next) = match slow::compile(&self.request, shell, &mut |sources| saved.follow(sources)) {
                Ok((plan, request)) => match self.run_watched(plan, &request, is_first, &mut saved, shell) {
                    Ok(end) => end,
                    Err(message) if is_first => return shell.refuse(message),
                    // Another save can mend it.
                    Err(message) => (shell.refuse(message), None),
                },
                Err(code) => (code, None),
            };
            if !interrupt.is_requested() && next.is_none() {
                shell.say_beside("`--watch`: waiting until a file of the graph is saved; Ctrl-C ends it");
            }
            let next = next.filter(|_| !interrupt.is_requested());
            let Some(path) = next.or_else(|| saved.wait(&interrupt)) else { return code };
            shell.say_beside(&format!("`{}` was saved", path.display()));
            is_first = false;
        }
    }

    /// Runs a plan, either the first one or that of a graph that was saved. Returns the exit code, and the file for which
    /// another run begins, if one was saved.
    fn run_watched(
        &self,
        plan: Compiled,
        request: &Request,
        is_first: bool,
        saved: &mut SavedFiles,
        shell: &Shell,
    ) -> Result<(u8, Option<PathBuf>), String> {
        let (is_real, moves) = (self.options.is_real(&plan), plan.moves());
        if is_real && moves && !self.options.listen {
            let why = "a graph that is loaded again begins halted, and `resume` is typed";
            return Err(format!("`--watch` of a graph that moves in real time needs `--listen`: {why}"));
        }
        let mut job = Self {
            request: self.request.clone(),
            title: self.title.clone(),
            options: self.options.clone(),
            print: self.print,
        };
        if !is_first && is_real {
            job.options = self.options.after_saving(moves);
        }
        let checks = |saved: &mut SavedFiles| {
            let compiled = graph::compile(shell.catalogue(), request);
            saved.follow(compiled.as_ref().map_or_else(|report| &report.sources, |plan| &plan.sources));
            compiled.inspect_err(|report| shell.show(report)).is_ok()
        };
        let needs_quiet = is_real && moves;
        let reload = Reload { needs_quiet, begins_halted: needs_quiet && !is_first, ..Reload::default() };
        scope(|scope| {
            let look = || reload.look(saved, checks, is_real);
            let thread = Builder::new().name("saved files".into()).spawn_scoped(scope, look);
            let thread = thread.map_err(|error| format!("cannot watch the files of the graph: {error}"))?;
            let over = OverAtDrop(&reload.is_over);
            let code = job.run_plan(plan, request, shell, Some(&reload));
            drop(over);
            let next = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            Ok((code?, next))
        })
    }
}
