//! The window of a check: the ticks of a run that its figures use.
//!
//! Without `during` and `until`, it is every tick from time 0 on. A tick belongs to the mode in which its nodes have
//! stepped, so the tick that takes an exit still belongs to the mode that ends.

use super::measure::Reading;

/// A mode of the task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ModeName {
    pub(super) name: String,
    /// The index of its task, and its number there from 0 in the order of the file.
    pub(super) place: (usize, usize),
}

/// What ends a window.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Event {
    /// The task enters the mode.
    Enters(ModeName),
    /// The flag becomes true.
    BecomesTrue {
        /// Its name in the file.
        name: String,
        /// Its name in a recording.
        column: String,
    },
}

/// The window of a check, as its section states it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Window {
    /// The mode to which the check is restricted.
    pub(super) during: Option<ModeName>,
    /// The event that ends the window.
    pub(super) until: Option<Event>,
}

impl Event {
    /// Returns the mode or the flag by its name in the file.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Enters(mode) => &mode.name,
            Self::BecomesTrue { name, .. } => name,
        }
    }
}

impl Window {
    /// Returns why no tick is in the window, or why it has no end, if that is so.
    pub(super) fn missing(&self, clock: &WindowClock, readings: &Readings) -> Option<String> {
        if let Some(mode) = self.during.as_ref().filter(|_| readings.all().is_empty()) {
            let before = self.until.as_ref().filter(|_| clock.is_over);
            let before = before.map_or_else(String::new, |event| format!(" and before `{}`", event.name()));
            return Some(format!("the run is never in mode `{}` after time 0{before}", mode.name));
        }
        let event = self.until.as_ref().filter(|_| !clock.is_over)?;
        let (what, holding) = match event {
            Event::Enters(mode) => (format!("the run never enters mode `{}` after time 0", mode.name), "being in it"),
            Event::BecomesTrue { name, .. } => (format!("`{name}` never becomes true after time 0"), "being true"),
        };
        let hint = if clock.held_at_zero { format!(" ({holding} at time 0 does not count)") } else { String::new() };
        Some(what + &hint)
    }

    /// Returns why `after_s` leaves no tick, for a window that `during` or `until` limits.
    pub(super) fn too_short(&self) -> Option<String> {
        match (&self.during, &self.until) {
            (Some(mode), _) => Some(format!("no visit of mode `{}` lasts longer than `after_s`", mode.name)),
            (None, Some(event)) => Some(format!("`after_s` is later than `{}`", event.name())),
            (None, None) => None,
        }
    }
}

/// Decides for each tick from time 0 on whether it is in the window, and measures its time there.
#[derive(Debug, Default)]
pub(super) struct WindowClock {
    /// Whether the event held in the last tick; `None` before time 0.
    has_held: Option<bool>,
    /// Whether the event held at time 0.
    held_at_zero: bool,
    /// Whether the event has happened.
    is_over: bool,
    /// Time of the last tick if it was in the window [ns].
    last: Option<i64>,
    /// Time in the window up to its last tick [ns].
    elapsed: Option<i64>,
}

/// The place of a tick in its window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    /// Time since time 0 [ns], or the time in the mode of `during`.
    pub(super) time: i64,
    /// Whether the tick before was not in the window.
    pub(super) is_entry: bool,
}

impl WindowClock {
    /// Returns the place of a tick at time `now` [ns], or `None` if it is not in the window.
    ///
    /// The event happens when it holds and did not hold in the tick before; the tick of time 0 has none before.
    /// `None` stands for an absent flag, which does not change.
    pub(super) fn tick(&mut self, now: i64, period: i64, is_in_mode: bool, holds: Option<bool>) -> Option<Place> {
        let holds = holds.unwrap_or(self.has_held == Some(true));
        self.is_over |= holds && self.has_held == Some(false);
        self.held_at_zero |= holds && self.has_held.is_none();
        self.has_held = Some(holds);
        let before = self.last.take();
        if self.is_over || !is_in_mode {
            return None;
        }
        // Another visit continues one period after the last tick of the visit before it.
        let passed = before.map_or(period, |before| now - before);
        let time = self.elapsed.map_or(0, |elapsed| elapsed + passed);
        (self.last, self.elapsed) = (Some(now), Some(time));
        Some(Place { time, is_entry: before.is_none() })
    }
}

/// The readings of a check in the ticks of its window.
#[derive(Debug, Clone, Default)]
pub(super) struct Readings {
    list: Vec<Reading>,
    /// Index of the first reading of each visit of the mode; the only visit without `during` begins at time 0.
    starts: Vec<usize>,
}

impl Readings {
    /// Adds a reading.
    pub(super) fn push(&mut self, reading: Reading, is_entry: bool) {
        if is_entry {
            self.starts.push(self.list.len());
        }
        self.list.push(reading);
    }

    /// Returns all readings, in the order of their times.
    pub(super) fn all(&self) -> &[Reading] {
        &self.list
    }

    /// Returns the readings of each visit.
    pub(super) fn visits(&self) -> impl Iterator<Item = &[Reading]> {
        let ends = self.starts.iter().skip(1).copied().chain([self.list.len()]);
        self.starts.iter().zip(ends).map(|(start, end)| &self.list[*start..end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: i64 = 4;

    /// The place of each tick: its time, and `true` at an entry. A letter of `ticks` is a tick: `m` in the mode, `e` in
    /// it while the event holds, `?` in it while the flag is absent, `-` outside, `E` outside while the event holds.
    fn places(ticks: &str) -> (Vec<Option<(i64, bool)>>, bool) {
        let mut clock = WindowClock::default();
        let place = |(i, tick): (usize, char)| {
            let holds = Some("eE".contains(tick)).filter(|_| tick != '?');
            let place = clock.tick(100 + i as i64 * PERIOD, PERIOD, "me?".contains(tick), holds)?;
            Some((place.time, place.is_entry))
        };
        let places = ticks.chars().enumerate().map(place).collect();
        (places, clock.is_over)
    }

    #[test]
    fn the_clock_of_a_mode_runs_only_in_the_mode() {
        let first = [None, Some((0, true)), Some((4, false))];
        let second = [None, None, Some((8, true)), Some((12, false))];
        assert_eq!(places("-mm--mm"), ([&first[..], &second[..]].concat(), false));
        assert_eq!(places("---"), (vec![None; 3], false));
    }

    #[test]
    fn the_first_event_after_time_0_ends_the_window() {
        let ticks = |count: i64| (0..count).map(|i| Some((i * PERIOD, i == 0)));
        let cases = [
            ("mmmm", 4, false),
            ("mmem", 2, true),
            ("mmEm", 2, true),
            // What holds at time 0 has to end first.
            ("eemm", 4, false),
            ("eeme", 3, true),
            // What is absent does not change.
            ("ee?e", 4, false),
            ("m?e-", 2, true),
            ("?e--", 1, true),
        ];
        for (text, count, is_over) in cases {
            let rest = vec![None; text.len() - count as usize];
            assert_eq!(places(text), (ticks(count).chain(rest).collect(), is_over), "{text}");
        }
        assert_eq!(places("-Emm"), (vec![None; 4], true), "the event before the mode");
    }

    #[test]
    fn the_readings_of_a_visit_are_those_between_two_entries() {
        let mut readings = Readings::default();
        assert_eq!(readings.visits().count(), 0);
        for (i, is_entry) in [true, false, true, true, false, false].into_iter().enumerate() {
            readings.push(Reading { time: i as f64, value: 0.0, is_new: true }, is_entry);
        }
        assert_eq!(readings.visits().map(<[_]>::len).collect::<Vec<_>>(), [2, 1, 3]);
        assert_eq!(readings.visits().flatten().copied().collect::<Vec<_>>(), readings.all());
    }
}
