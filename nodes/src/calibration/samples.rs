//! Finds which tactel bore which force, frame by frame.
//!
//! A *probe* presses one tactel at a time: between two unloaded frames the whole force is on one tactel. A *uniform*
//! load, a bladder, is shared equally by all tactels. In both cases the zero of a tactel is the median of its unloaded
//! readings.

use std::ops::Range;

#[cfg(feature = "cli")]
use tactflow_runtime::cli::clap;

use super::log::Log;

/// How the pad was loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum LoadKind {
    /// One tactel at a time bears the whole force.
    Probe,
    /// All tactels share the force.
    Uniform,
}

/// One frame of one tactel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TactelSample {
    /// The force on it [N].
    pub force: f64,
    /// Reading beyond the offset, with the sign that makes it rise with the force [reading].
    pub s: f64,
    /// Whether the force was rising.
    pub is_loading: bool,
}

/// The response of one tactel, before a curve is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Unloaded reading [reading].
    pub offset: f32,
    /// Standard deviation of the unloaded reading, from the median deviation [reading].
    pub noise: f64,
    /// Response to the largest forces on it [reading].
    pub response: f64,
    /// 1 if the reading rises with the force, -1 if it falls.
    pub sign: f32,
    /// Whether it does not respond.
    pub is_dead: bool,
}

/// Minimum response of a live tactel, as a fraction of the maximum response.
pub const MIN_LIVE_RESPONSE: f64 = 0.05;

/// Minimum force of a press that is assigned to a tactel, as a fraction of the maximum force.
const MIN_PRESS: f64 = 0.05;

/// Minimum reversal of the force that starts a new rise or fall, as a fraction of the maximum force.
const MIN_REVERSAL: f64 = 0.03;

/// Minimum force at which a response is measured, as a fraction of the maximum force.
const MIN_RESPONSE_FORCE: f64 = 0.8;

/// Minimum ratio of two responses that count as alike, each as a fraction of the tactel's maximum response.
const MIN_ALIKE: f64 = 0.85;

/// Minimum ratio of the response to a press on a tactel and to a press next to it.
const MIN_OWN_PRESS_RATIO: f64 = 1.5;

/// Minimum response of a tactel that may itself be pressed, as a fraction of the maximum response to the press. Foam
/// transmits less.
const MIN_PRESSED: f64 = 0.3;

/// The tactels that bear the force of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bearer {
    All,
    One(usize),
    Unknown,
}

/// A log and a range of its frames.
type Stretch = (usize, Range<usize>);

/// A stretch between two unloaded frames with the force on one tactel.
struct ProbePress {
    stretch: Stretch,
    /// Maximum force [N].
    peak: f64,
    /// The pressed tactel, and its response.
    tactel: usize,
    response: f64,
}

/// Logs with the response of each tactel.
pub struct LogAnalysis<'l> {
    logs: &'l [Log],
    /// Bearer of the force and whether it rises, by log and frame.
    frames: Vec<Vec<(Bearer, bool)>>,
    /// Response of each tactel.
    pub answers: Vec<Answer>,
    /// Maximum force of all logs [N].
    pub most: f64,
    /// Fraction of a frame's force that is on one tactel.
    pub share: f64,
    /// Whether a load for one tactel at a time is on most of them at once.
    pub is_shared: bool,
}

impl<'l> LogAnalysis<'l> {
    /// Analyses logs of one array. A live tactel responds with at least `dead_below` [reading]. A uniform load is
    /// shared by `bearing` tactels, or by the live ones.
    #[must_use]
    pub fn new(logs: &'l [Log], load: LoadKind, dead_below: Option<f64>, bearing: Option<usize>) -> Self {
        let most = logs.iter().fold(0.0, |most: f64, log| most.max(peak(&log.force)));
        let tactels = logs.first().map_or(0, Log::tactels);
        let bearer = if load == LoadKind::Uniform { Bearer::All } else { Bearer::Unknown };
        let frame = |is_loading: bool| (bearer, is_loading);
        let frames =
            logs.iter().map(|log| log.is_loading(MIN_REVERSAL * most).into_iter().map(frame).collect()).collect();
        let answers = (0..tactels).map(|i| zero(logs, most, i)).collect();
        let mut samples = Self { logs, frames, answers, most, share: 1.0, is_shared: false };
        match load {
            LoadKind::Uniform => samples.share_out(dead_below, bearing),
            LoadKind::Probe => samples.find_presses(dead_below),
        }
        samples
    }

    /// Analyses a load that all tactels share.
    fn share_out(&mut self, dead_below: Option<f64>, bearing: Option<usize>) {
        let all: Vec<Stretch> = self.logs.iter().map(|log| 0..log.frames()).enumerate().collect();
        for (tactel, response) in self.responses(&all).into_iter().enumerate() {
            self.set_response(tactel, response);
        }
        self.mark_dead(dead_below);
        let live = self.answers.iter().filter(|answer| !answer.is_dead).count();
        self.share = 1.0 / bearing.unwrap_or(live).max(1) as f64;
    }

    /// Analyses a load that is on one tactel at a time.
    fn find_presses(&mut self, dead_below: Option<f64>) {
        let stretches: Vec<Stretch> = (0..self.logs.len()).flat_map(|log| self.stretches(log)).collect();
        for stretch in &stretches {
            for (tactel, response) in self.responses([stretch]).into_iter().enumerate() {
                if response.abs() > self.answers[tactel].response {
                    self.set_response(tactel, response);
                }
            }
        }
        self.mark_dead(dead_below);
        let shared = stretches.iter().filter(|stretch| self.is_on_most(stretch)).count();
        self.is_shared = 2 * shared > stretches.len();
        let presses: Vec<ProbePress> = stretches.into_iter().filter_map(|stretch| self.press(stretch)).collect();
        // A press on a dead tactel makes a neighbour respond, but less than a press on the neighbour itself.
        let is_weak = |press: &ProbePress| {
            presses.iter().any(|other| {
                other.tactel == press.tactel
                    && other.peak <= 1.05 * press.peak
                    && other.response > MIN_OWN_PRESS_RATIO * press.response
            })
        };
        for press in presses.iter().filter(|press| !is_weak(press)) {
            let (log, frames) = press.stretch.clone();
            for frame in &mut self.frames[log][frames] {
                frame.0 = Bearer::One(press.tactel);
            }
        }
        for (log, frames) in self.logs.iter().zip(&mut self.frames) {
            for i in (0..frames.len()).filter(|i| log.is_unloaded(*i, self.most)) {
                frames[i].0 = Bearer::All;
            }
        }
    }

    /// Returns the ranges of a log between unloaded frames with at least the minimum force of a press.
    fn stretches(&self, log: usize) -> Vec<Stretch> {
        let from = &self.logs[log];
        let is_unloaded = |frame: &usize| from.is_unloaded(*frame, self.most);
        let frames: Vec<usize> = (0..from.frames()).collect();
        let runs = frames.chunk_by(|a, b| is_unloaded(a) == is_unloaded(b)).filter(|run| !is_unloaded(&run[0]));
        let stretches = runs.map(|run| (log, run[0]..run[0] + run.len()));
        stretches.filter(|stretch| self.peak(stretch) >= MIN_PRESS * self.most).collect()
    }

    /// Returns the maximum force of a stretch.
    fn peak(&self, (log, frames): &Stretch) -> f64 {
        peak(&self.logs[*log].force[frames.clone()])
    }

    /// Returns each tactel's mean reading beyond the offset, over the largest forces of some stretches.
    fn responses<'s>(&self, stretches: impl IntoIterator<Item = &'s Stretch> + Clone) -> Vec<f64> {
        let top =
            MIN_RESPONSE_FORCE * stretches.clone().into_iter().map(|stretch| self.peak(stretch)).fold(0.0, f64::max);
        let frames =
            stretches.into_iter().flat_map(|(log, frames)| frames.clone().map(|frame| (&self.logs[*log], frame)));
        let (mut sums, mut count) = (vec![0.0; self.answers.len()], 0);
        for (log, frame) in frames.filter(|(log, frame)| log.force[*frame] >= top) {
            count += 1;
            for (i, (sum, answer)) in sums.iter_mut().zip(&self.answers).enumerate() {
                *sum += f64::from(log.reading(frame, i) - answer.offset);
            }
        }
        sums.into_iter().map(|sum| sum / f64::from(count.max(1))).collect()
    }

    /// Whether most live tactels respond as if all were pressed at once: near their maximum response, and not much less
    /// than the tactel with the largest response.
    fn is_on_most(&self, stretch: &Stretch) -> bool {
        let responses = self.responses([stretch]);
        let live: Vec<usize> = (0..responses.len()).filter(|i| !self.answers[*i].is_dead).collect();
        let size = |i: &usize| responses[*i].abs();
        let part = |i: &usize| size(i) / self.answers[*i].response;
        let maximum = |of: &dyn Fn(&usize) -> f64| live.iter().map(of).fold(0.0, f64::max);
        let (most, best) = (maximum(&size), maximum(&part));
        let pressed = live.iter().filter(|i| size(i) >= MIN_PRESSED * most && part(i) >= MIN_ALIKE * best).count();
        pressed > 1 && 2 * pressed > live.len()
    }

    /// Returns the press of a range of frames: of the tactels near their maximum response, the one with the largest.
    /// Foam couples neighbours, and a sensitive neighbour may read more than the pressed tactel.
    fn press(&self, stretch: Stretch) -> Option<ProbePress> {
        let responses = self.responses([&stretch]);
        let live = || (0..responses.len()).filter(|i| !self.answers[*i].is_dead);
        let part = |i: &usize| responses[*i].abs() / self.answers[*i].response;
        let best = live().map(|i| part(&i)).fold(0.0, f64::max);
        let alike = live().filter(|i| part(i) >= MIN_ALIKE * best);
        let tactel = alike.max_by(|a, b| responses[*a].abs().total_cmp(&responses[*b].abs()))?;
        Some(ProbePress { peak: self.peak(&stretch), stretch, tactel, response: responses[tactel].abs() })
    }

    fn set_response(&mut self, tactel: usize, response: f64) {
        let answer = &mut self.answers[tactel];
        (answer.response, answer.sign) = (response.abs(), if response < 0.0 { -1.0 } else { 1.0 });
    }

    /// Marks the dead tactels.
    fn mark_dead(&mut self, dead_below: Option<f64>) {
        let maximum = self.answers.iter().fold(0.0, |maximum: f64, answer| maximum.max(answer.response));
        for answer in &mut self.answers {
            let minimum = dead_below.unwrap_or_else(|| (MIN_LIVE_RESPONSE * maximum).max(4.0 * answer.noise));
            answer.is_dead = answer.response <= 0.0 || answer.response < minimum;
        }
        for i in self.logs.iter().flat_map(|log| &log.absent) {
            self.answers[*i].is_dead = true;
        }
    }

    /// Returns the samples of a tactel, each with its reading in the log.
    #[must_use]
    pub fn of(&self, tactel: usize) -> Vec<(TactelSample, f32)> {
        let Answer { offset, sign, .. } = self.answers[tactel];
        let mut samples = Vec::new();
        for (log, frames) in self.logs.iter().zip(&self.frames) {
            for (i, (bearer, is_loading)) in frames.iter().enumerate() {
                if *bearer == Bearer::All || *bearer == Bearer::One(tactel) {
                    let reading = log.reading(i, tactel);
                    let s = f64::from((reading - offset) * sign);
                    let force = log.force[i] * self.share;
                    samples.push((TactelSample { force, s, is_loading: *is_loading }, reading));
                }
            }
        }
        samples
    }
}

/// Returns the response of a tactel with its zero only.
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

/// Returns the maximum force of some frames.
fn peak(force: &[f64]) -> f64 {
    force.iter().fold(0.0, |peak: f64, force| peak.max(*force))
}

/// Returns the median, or 0 without numbers. Sorts the numbers.
pub fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    match numbers.len() {
        0 => 0.0,
        count if count % 2 == 1 => numbers[count / 2],
        count => 0.5 * (numbers[count / 2 - 1] + numbers[count / 2]),
    }
}
