//! Which tactel bore which force, frame by frame.
//!
//! A *probe* presses one tactel at a time: between two unloaded frames the whole force is on one tactel. A *uniform* load, a bladder, is shared by all tactels alike. Either way the zero of a tactel is the median
//! of what it reads while nothing presses.

use std::ops::Range;

use super::log::Log;

/// How the pad was loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Load {
    /// One tactel at a time bears the whole force.
    Probe,
    /// All tactels share the force.
    Uniform,
}

/// One frame of one tactel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The force on it [N].
    pub force: f64,
    /// What it reads beyond its zero, counted so that it rises with the force [reading].
    pub s: f64,
    /// Whether the force was rising.
    pub is_loading: bool,
}

/// What one tactel read, and what is known of it before a curve is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// What it reads unloaded [reading].
    pub offset: f32,
    /// Standard deviation of that, from the median deviation [reading].
    pub noise: f64,
    /// How much it answers to the largest forces on it [reading].
    pub response: f64,
    /// 1 if it rises with the force, -1 if it falls.
    pub sign: f32,
    /// Whether it never answers.
    pub is_dead: bool,
}

/// Least response of a live tactel, as a part of the greatest one.
pub const DEAD_BELOW: f64 = 0.05;

/// A press that stays below this part of the largest force says nothing of which tactel it is on.
const LEAST_PRESS: f64 = 0.05;

/// How far the force must turn back to be a new rise or fall, as a part of the largest one.
const TURN: f64 = 0.03;

/// The upper part of the forces, from which on a response is taken.
const TOP: f64 = 0.8;

/// Tactels that answer by parts of their greatest responses that differ by no more than this answer alike.
const ALIKE: f64 = 0.85;

/// How much more a tactel answers to a press on it than to one beside it, at least.
const WEAK: f64 = 1.5;

/// A tactel that answers with at least this part of the greatest response to a press may be pressed itself; foam passes
/// less of it on.
const PRESSED: f64 = 0.3;

/// Who bears the force of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bearer {
    All,
    One(usize),
    Unknown,
}

/// A stretch of frames between two unloaded ones.
struct Press {
    log: usize,
    frames: Range<usize>,
    /// Its largest force [N].
    peak: f64,
    /// The tactel it is on, and how much that answered.
    tactel: usize,
    response: f64,
}

/// Logs with what is known of each tactel.
pub struct Samples<'l> {
    logs: &'l [Log],
    /// Per log and frame: who bears the force, and whether it rises.
    frames: Vec<Vec<(Bearer, bool)>>,
    /// What is known of each tactel.
    pub answers: Vec<Answer>,
    /// The largest force of all logs [N].
    pub most: f64,
    /// The part of a frame's force that is on one tactel.
    pub share: f64,
    /// Whether a load that should be on one tactel at a time is on most of them at once.
    pub is_shared: bool,
}

impl<'l> Samples<'l> {
    /// Looks through logs of one array. A live tactel answers with at least `dead_below` [reading]; `bearing` tactels
    /// share a uniform load, the live ones unless it is given.
    #[must_use]
    pub fn new(logs: &'l [Log], load: Load, dead_below: Option<f64>, bearing: Option<usize>) -> Self {
        let most = logs.iter().fold(0.0, |most: f64, log| most.max(log.most()));
        let tactels = logs.first().map_or(0, Log::tactels);
        let bearer = if load == Load::Uniform { Bearer::All } else { Bearer::Unknown };
        let frame = |is_loading: bool| (bearer, is_loading);
        let frames = logs.iter().map(|log| log.is_loading(TURN * most).into_iter().map(frame).collect()).collect();
        let answers = (0..tactels).map(|i| zero(logs, most, i)).collect();
        let mut samples = Self { logs, frames, answers, most, share: 1.0, is_shared: false };
        match load {
            Load::Uniform => samples.share_out(dead_below, bearing),
            Load::Probe => samples.find_presses(dead_below),
        }
        samples
    }

    /// Everything about a load that all tactels share.
    fn share_out(&mut self, dead_below: Option<f64>, bearing: Option<usize>) {
        for i in 0..self.answers.len() {
            let response = self.mean_beyond(i, |log, frame| log.force[frame] >= TOP * self.most);
            self.set_response(i, response);
        }
        self.bury(dead_below);
        let live = self.answers.iter().filter(|answer| !answer.is_dead).count();
        self.share = 1.0 / bearing.unwrap_or(live).max(1) as f64;
    }

    /// Everything about a load that is on one tactel at a time.
    fn find_presses(&mut self, dead_below: Option<f64>) {
        let stretches: Vec<(usize, Range<usize>)> = (0..self.logs.len()).flat_map(|log| self.stretches(log)).collect();
        for (log, frames) in &stretches {
            for (tactel, response) in self.responses(*log, frames).into_iter().enumerate() {
                if response.abs() > self.answers[tactel].response {
                    self.set_response(tactel, response);
                }
            }
        }
        self.bury(dead_below);
        let shared = stretches.iter().filter(|(log, frames)| self.is_on_most(*log, frames)).count();
        self.is_shared = 2 * shared > stretches.len();
        let presses = stretches.into_iter().filter_map(|(log, frames)| self.press(log, frames));
        let presses: Vec<Press> = presses.collect();
        // A press on a dead tactel makes a neighbour answer, but less than the presses on that one itself do.
        let is_weak = |press: &Press| {
            presses.iter().any(|other| {
                other.tactel == press.tactel
                    && other.peak <= 1.05 * press.peak
                    && other.response > WEAK * press.response
            })
        };
        for press in presses.iter().filter(|press| !is_weak(press)) {
            for frame in &mut self.frames[press.log][press.frames.clone()] {
                frame.0 = Bearer::One(press.tactel);
            }
        }
        for (log, frames) in self.logs.iter().zip(&mut self.frames) {
            for i in (0..frames.len()).filter(|i| log.is_unloaded(*i, self.most)) {
                frames[i].0 = Bearer::All;
            }
        }
    }

    /// The stretches of a log between unloaded frames in which the force is more than a touch.
    fn stretches(&self, log: usize) -> Vec<(usize, Range<usize>)> {
        let from = &self.logs[log];
        let (mut stretches, mut start) = (Vec::new(), 0);
        for i in 0..=from.frames() {
            if i == from.frames() || from.is_unloaded(i, self.most) {
                if peak(&from.force[start..i]) >= LEAST_PRESS * self.most {
                    stretches.push((log, start..i));
                }
                start = i + 1;
            }
        }
        stretches
    }

    /// What each tactel reads beyond its zero, on average over the upper forces of a stretch.
    fn responses(&self, log: usize, frames: &Range<usize>) -> Vec<f64> {
        let from = &self.logs[log];
        let top = TOP * peak(&from.force[frames.clone()]);
        let (mut sums, mut count) = (vec![0.0; self.answers.len()], 0.0);
        for frame in frames.clone().filter(|frame| from.force[*frame] >= top) {
            count += 1.0;
            for (i, (sum, answer)) in sums.iter_mut().zip(&self.answers).enumerate() {
                *sum += f64::from(from.reading(frame, i) - answer.offset);
            }
        }
        sums.into_iter().map(|sum| sum / count).collect()
    }

    /// Whether most live tactels answer to a stretch as if they were pressed all at once: about as much as they ever
    /// do, and not much less than the one that answers the most.
    fn is_on_most(&self, log: usize, frames: &Range<usize>) -> bool {
        let responses = self.responses(log, frames);
        let live: Vec<usize> = (0..responses.len()).filter(|i| !self.answers[*i].is_dead).collect();
        let size = |i: &usize| responses[*i].abs();
        let part = |i: &usize| size(i) / self.answers[*i].response;
        let greatest = |of: &dyn Fn(&usize) -> f64| live.iter().map(of).fold(0.0, f64::max);
        let (most, best) = (greatest(&size), greatest(&part));
        let pressed = live.iter().filter(|i| size(i) >= PRESSED * most && part(i) >= ALIKE * best).count();
        pressed > 1 && 2 * pressed > live.len()
    }

    /// The tactel that a stretch is a press on: of those that answer about as much as they ever do, the one that
    /// answers the most. Foam couples neighbours, and a sensitive one may read more than the tactel that is pressed.
    fn press(&self, log: usize, frames: Range<usize>) -> Option<Press> {
        let responses = self.responses(log, &frames);
        let live = || (0..responses.len()).filter(|i| !self.answers[*i].is_dead);
        let part = |i: &usize| responses[*i].abs() / self.answers[*i].response;
        let best = live().map(|i| part(&i)).fold(0.0, f64::max);
        let alike = live().filter(|i| part(i) >= ALIKE * best);
        let tactel = alike.max_by(|a, b| responses[*a].abs().total_cmp(&responses[*b].abs()))?;
        let peak = peak(&self.logs[log].force[frames.clone()]);
        Some(Press { log, frames, peak, tactel, response: responses[tactel].abs() })
    }

    fn set_response(&mut self, tactel: usize, response: f64) {
        let answer = &mut self.answers[tactel];
        (answer.response, answer.sign) = (response.abs(), if response < 0.0 { -1.0 } else { 1.0 });
    }

    /// Says which tactels are dead.
    fn bury(&mut self, dead_below: Option<f64>) {
        let greatest = self.answers.iter().fold(0.0, |greatest: f64, answer| greatest.max(answer.response));
        for answer in &mut self.answers {
            let least = dead_below.unwrap_or_else(|| (DEAD_BELOW * greatest).max(4.0 * answer.noise));
            answer.is_dead = answer.response <= 0.0 || answer.response < least;
        }
        for i in self.logs.iter().flat_map(|log| &log.absent) {
            self.answers[*i].is_dead = true;
        }
    }

    /// Mean of what a tactel reads beyond its zero, over some frames.
    fn mean_beyond(&self, tactel: usize, is_meant: impl Fn(&Log, usize) -> bool) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for log in self.logs {
            for frame in (0..log.frames()).filter(|frame| is_meant(log, *frame)) {
                sum += f64::from(log.reading(frame, tactel) - self.answers[tactel].offset);
                count += 1;
            }
        }
        if count > 0 { sum / f64::from(count) } else { 0.0 }
    }

    /// The samples of a tactel; the reading goes with each, as it stands in the log.
    #[must_use]
    pub fn of(&self, tactel: usize) -> Vec<(Sample, f32)> {
        let Answer { offset, sign, .. } = self.answers[tactel];
        let mut samples = Vec::new();
        for (log, frames) in self.logs.iter().zip(&self.frames) {
            for (i, (bearer, is_loading)) in frames.iter().enumerate() {
                if *bearer == Bearer::All || *bearer == Bearer::One(tactel) {
                    let reading = log.reading(i, tactel);
                    let s = f64::from((reading - offset) * sign);
                    let force = log.force[i] * self.share;
                    samples.push((Sample { force, s, is_loading: *is_loading }, reading));
                }
            }
        }
        samples
    }
}

/// The zero of a tactel; nothing more is known yet.
fn zero(logs: &[Log], most: f64, tactel: usize) -> Answer {
    let mut readings: Vec<f64> = Vec::new();
    for log in logs {
        let unloaded = (0..log.frames()).filter(|frame| log.is_unloaded(*frame, most));
        readings.extend(unloaded.map(|frame| f64::from(log.reading(frame, tactel))));
    }
    let offset = median(&mut readings);
    readings.iter_mut().for_each(|reading| *reading = (*reading - offset).abs());
    let noise = 1.4826 * median(&mut readings);
    Answer { offset: offset as f32, noise, response: 0.0, sign: 1.0, is_dead: true }
}

/// The largest force of some frames.
fn peak(force: &[f64]) -> f64 {
    force.iter().fold(0.0, |peak: f64, force| peak.max(*force))
}

/// The median; the numbers are sorted on the way. Zero of none.
pub fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    match numbers.len() {
        0 => 0.0,
        count if count % 2 == 1 => numbers[count / 2],
        count => 0.5 * (numbers[count / 2 - 1] + numbers[count / 2]),
    }
}
