//! The loop of a run: tick after tick, until something ends it. The edge to real time paces it; in virtual time alone
//! nothing does.

use std::time::Instant;

use super::engine::Engine;
use super::outcome::{End, Outcome};
use crate::fault::Fault;

/// What paces a run, and what comes in between two ticks.
pub(crate) trait Pace {
    /// Whether the operator wants the end.
    fn is_interrupted(&self) -> bool;

    /// The tick that is next [ns], with what came from outside since the last. Whether there was one: not if the operator
    /// wants the end.
    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault>;

    /// Looks at what the tick has left; the reason to give up, if nothing can end a halt any more.
    fn after(&mut self, engine: &Engine) -> Option<Fault>;
}

/// Ticks until `until` [ns], or until something ends it before. `observe` is called after every tick.
pub(crate) fn drive(engine: &mut Engine, until: i64, pace: &mut impl Pace, observe: &mut dyn FnMut(&Engine)) -> End {
    loop {
        if pace.is_interrupted() {
            return End::Interrupted;
        }
        let Some(next) = engine.next() else { return End::Finished };
        if next > until {
            return End::Duration;
        }
        match pace.tick(engine, next) {
            Ok(true) => observe(engine),
            Ok(false) => return End::Interrupted,
            Err(fault) => return End::Fault(fault.into()),
        }
        let fault = pace.after(engine);
        if engine.is_done() {
            return End::Done;
        }
        if let Some(fault) = fault {
            return End::Fault(fault.into());
        }
    }
}

/// The reason of a halt that nothing can end any more: a stop when no word can come, or, in a run without an end, the
/// loss of a device. Such a run would go on for ever.
pub(crate) fn hopeless(engine: &Engine, may_hear: bool, is_endless: bool) -> Option<Fault> {
    let waits = engine.is_stopped() && !may_hear;
    let has_lost = || engine.devices.iter().any(|device| device.failed.is_some());
    let is_lost = is_endless && has_lost() && !engine.has_end();
    let is_still = || engine.devices.iter().all(|device| device.commands.are_zero());
    let last = engine.halts().last().filter(|_| (waits || is_lost) && is_still())?;
    Some(last.fault.clone())
}

/// Runs for `duration` [s] of virtual time, as fast as it can and without anything from outside: no signal is caught, no
/// word is heard and no thread is started, so that many can run side by side. Then the commands ramp to zero.
///
/// # Panics
/// If a device runs in real time: [`Compiled::is_live`](crate::graph::Compiled::is_live) tells.
pub fn run_virtual(
    engine: &mut Engine,
    duration: f64,
    is_interrupted: &dyn Fn() -> bool,
    observe: &mut dyn FnMut(&Engine),
) -> Outcome {
    assert!(!engine.is_live(), "a live device runs in real time");
    let epoch = Instant::now();
    let end = drive(engine, (duration * 1e9) as i64, &mut Virtual { is_interrupted }, observe);
    let (time, ticks) = (engine.now(), engine.ticks());
    while !engine.wind_down() {}
    engine.wind_down();
    engine.finish(&end.to_string());
    Outcome { end, time, ticks, wall: epoch.elapsed(), late: 0 }
}

struct Virtual<'a> {
    is_interrupted: &'a dyn Fn() -> bool,
}

impl Pace for Virtual<'_> {
    fn is_interrupted(&self) -> bool {
        (self.is_interrupted)()
    }

    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault> {
        engine.tick(next).map(|()| true)
    }

    fn after(&mut self, engine: &Engine) -> Option<Fault> {
        hopeless(engine, false, false)
    }
}
