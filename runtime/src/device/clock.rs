//! Maps the times of a device's own clock to the clock of the graph.
//!
//! A sample arrives later than it was measured, by a delay that varies. The samples with the smallest delays show the
//! offset and the drift between the two clocks: the map is the highest line below all points (time of the device, time
//! of arrival), as in Moon, Skelly and Towsley, "Estimation and removal of clock skew from network delay measurements",
//! INFOCOM 1999. The smallest delay itself cannot be observed, so an age is the true age less the smallest delay.

/// Time after which a line is estimated anew [ns]. It uses the samples of one to two such times.
const WINDOW: i64 = 10_000_000_000;
/// Largest drift between the clocks that is usual [1].
const MAX_DRIFT: f64 = 0.1;
/// Time after which another rate of the clock is certain, and the bounds of the rate [ns, 1].
const RATE_TIME: f64 = 1e9;
const RATES: [f64; 2] = [0.1, 10.0];
/// Largest number of points in which a line is stored.
const MAX_POINTS: usize = 256;
/// Deviation from the line that only a step of the device's clock explains [ns].
const STEP: i64 = 50_000_000;
/// Time for which all samples must be that late before this is taken for a step [ns].
const STEP_TIME: i64 = 2_000_000_000;

/// What the own clock of a device shows, against the clock of the graph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockReading {
    /// Time of the newest sample in the clock of the device [ns].
    pub device: i64,
    /// The same time in the clock of the graph, later by the smallest delay of a sample [ns].
    pub graph: i64,
    /// Seconds of the device for each second of the graph; `None` until there are steady samples of a second.
    pub rate: Option<f64>,
    /// Time over which the rate was measured [s].
    pub seconds: f64,
}

/// Maps the times of a device to the clock of the graph.
#[derive(Debug, Clone)]
pub(crate) struct DeviceClock {
    /// Time that a sample may go back, as reordered datagrams do [ns].
    reordered: i64,
    /// The line in use, and the one that replaces it.
    lines: [Option<Envelope>; 2],
    /// The last time of the device, and the stamp that was made of it [ns].
    last: Option<(i64, i64)>,
    /// Since when every sample arrives too late [ns].
    late_since: Option<i64>,
    /// How often the clock of the device has made a step.
    pub(crate) steps: u64,
    /// Whether a wrong rate was returned before.
    has_told: bool,
}

impl DeviceClock {
    /// The clock of a device that samples every `period` [ns].
    pub(crate) fn new(period: i64) -> Self {
        let reordered = STEP.max(period.saturating_mul(5));
        Self { reordered, lines: [None, None], last: None, late_since: None, steps: 0, has_told: false }
    }

    /// Returns the rate of the device's clock, in its seconds for each second, if it is wrong and was not returned before.
    pub(crate) fn take_wrong_rate(&mut self) -> Option<f64> {
        let line = self.lines[0].as_ref().filter(|line| !self.has_told && line.is_long())?;
        let rate = line.slope().recip();
        self.has_told = (rate - 1.0).abs() > MAX_DRIFT;
        self.has_told.then_some(rate)
    }

    /// Returns what the clock of the device shows; `None` before its first sample.
    pub(crate) fn reading(&self) -> Option<ClockReading> {
        let ((device, graph), line) = (self.last?, self.lines[0].as_ref()?);
        let rate = line.is_long().then(|| line.slope().recip());
        Some(ClockReading { device, graph, rate, seconds: line.last[1] * 1e-9 })
    }

    /// Returns the stamp of a sample that the device measured at `device` [ns in its own clock], and that arrived at
    /// `arrived` [ns].
    ///
    /// A sample with the time of the last one gets its stamp. The stamp of a later one is later. It is not after its
    /// arrival, except by a nanosecond for each of several samples that arrive at once.
    pub(crate) fn stamp(&mut self, device: i64, arrived: i64) -> i64 {
        let last = self.last.filter(|(time, _)| time.saturating_sub(device) < self.reordered);
        if let Some((time, stamp)) = last.filter(|(time, _)| device <= *time) {
            return stamp.saturating_sub(time - device);
        }
        if self.has_stepped(device, arrived) {
            self.steps += 1;
            (self.lines, self.late_since) = ([None, None], None);
        }
        for line in self.lines.iter_mut().flatten() {
            line.add(device, arrived);
        }
        let is_due = |line: &Envelope| arrived - line.origin[1] >= WINDOW;
        if self.lines[0].as_ref().is_none_or(is_due) {
            let new = self.lines[1].take_if(|line| is_due(line));
            if new.is_some() || self.lines[0].is_none() {
                self.lines[0] = Some(new.unwrap_or_else(|| Envelope::new(device, arrived)));
            }
            self.lines[1].get_or_insert_with(|| Envelope::new(device, arrived));
        }
        let mapped = self.lines[0].as_ref().map_or(arrived, |line| line.at(device)).min(arrived);
        let stamp = self.last.map_or(mapped, |(_, stamp)| mapped.max(stamp.saturating_add(1)));
        self.last = Some((device, stamp));
        stamp
    }

    /// Whether only a step of the device's clock explains a sample: its time went back, it arrived before it was
    /// measured, or all samples have been late for some time.
    fn has_stepped(&mut self, device: i64, arrived: i64) -> bool {
        let (Some(line), Some((last, _))) = (&self.lines[0], self.last) else { return false };
        // A line through few samples says little about a time that is far away.
        let unsure = (MAX_DRIFT * (device.saturating_sub(last)) as f64) as i64;
        let late = arrived.saturating_sub(line.at(device));
        if late < STEP {
            self.late_since = None;
        }
        let is_late = late >= STEP && arrived - *self.late_since.get_or_insert(arrived) >= STEP_TIME;
        device < last || late < -STEP - unsure || is_late
    }
}

/// The points of a time, and the highest line below them.
#[derive(Debug, Clone)]
struct Envelope {
    /// The first point [ns], from which the others are counted.
    origin: [i64; 2],
    /// The lower convex hull of the points [ns].
    hull: Vec<[f64; 2]>,
    /// Sum of the times of the device [ns], and their number.
    sum: f64,
    count: f64,
    /// The last point [ns], and whether a point came so much later than the one before that its delay or its clock, and
    /// not its rate, has changed.
    last: [f64; 2],
    has_jump: bool,
}

impl Envelope {
    fn new(device: i64, arrived: i64) -> Self {
        let mut hull = Vec::with_capacity(MAX_POINTS);
        hull.push([0.0; 2]);
        Self { origin: [device, arrived], hull, sum: 0.0, count: 1.0, last: [0.0; 2], has_jump: false }
    }

    /// Adds a point that is to the right of all others.
    fn add(&mut self, device: i64, arrived: i64) {
        let point =
            [device.saturating_sub(self.origin[0]), arrived.saturating_sub(self.origin[1])].map(|time| time as f64);
        self.has_jump |= (point[1] - self.last[1]) - (point[0] - self.last[0]) > STEP as f64;
        self.last = point;
        self.sum += point[0];
        self.count += 1.0;
        while let [.., a, b] = self.hull[..]
            && (b[0] - a[0]) * (point[1] - a[1]) <= (b[1] - a[1]) * (point[0] - a[0])
        {
            self.hull.pop();
        }
        if self.hull.len() == MAX_POINTS {
            self.hull.remove(0);
        }
        self.hull.push(point);
    }

    /// Whether the line is long and steady enough to tell any rate of the clock.
    fn is_long(&self) -> bool {
        !self.has_jump && self.last[1] - self.hull[0][1] >= RATE_TIME
    }

    /// Returns the slope of the line: seconds of the graph for each second of the device.
    ///
    /// Of all lines below the points, it is the one with the smallest sum of distances: the side of the hull below the
    /// mean of the points.
    fn slope(&self) -> f64 {
        let mean = self.sum / self.count;
        let side = self.hull.windows(2).find(|side| side[1][0] >= mean);
        let slope = side.map_or(1.0, |side| (side[1][1] - side[0][1]) / (side[1][0] - side[0][0]));
        let [slowest, fastest] = if self.is_long() { RATES } else { [1.0 - MAX_DRIFT, 1.0 + MAX_DRIFT] };
        slope.clamp(slowest, fastest)
    }

    /// Returns the height of the line at a time of the device [ns].
    fn at(&self, device: i64) -> i64 {
        let slope = self.slope();
        let height = self.hull.iter().map(|[x, y]| y - slope * x).fold(f64::INFINITY, f64::min);
        let x = device.saturating_sub(self.origin[0]) as f64;
        self.origin[1].saturating_add((height + slope * x).round() as i64)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: i64 = 1_000_000;

    /// The samples of a device: when each was measured, in the clock of the graph and in its own, and when it arrived
    /// [ns]. `delays` are beyond the smallest one, which is 3 ms.
    fn samples(drift: f64, period: i64, count: i64, delay: impl Fn(i64) -> i64) -> Vec<[i64; 3]> {
        let mut arrived = 0;
        let sample = |i: i64| {
            let measured = 1_000 * MS + i * period;
            let own = 77_000_000 * MS + (i as f64 * period as f64 * (1.0 + drift)) as i64;
            // A stream keeps its order.
            arrived = (measured + 3 * MS + delay(i)).max(arrived);
            [measured, own, arrived]
        };
        (0..count).map(sample).collect()
    }

    /// Returns the largest error of an age after `from` [ns], against the true age less the smallest delay.
    fn error_after(from: i64, samples: &[[i64; 3]]) -> i64 {
        let mut clock = DeviceClock::new(4 * MS);
        let errors = samples.iter().map(|[measured, own, arrived]| {
            let stamp = clock.stamp(*own, *arrived);
            // Of samples that arrive together, each is a nanosecond later than the one before.
            assert!(stamp <= *arrived + 20, "a sample is not measured after its arrival");
            if *arrived - samples[0][2] < from { 0 } else { (stamp - (measured + 3 * MS)).abs() }
        });
        let largest = errors.max().unwrap();
        assert_eq!(clock.steps, 0);
        largest
    }

    /// A number from 0 to 1 for each sample, always the same.
    fn noise(i: i64) -> f64 {
        ((i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / (1_u64 << 24) as f64
    }

    #[test]
    fn drift_jitter_bursts_and_silence_leave_an_age_within_a_millisecond() {
        let jitter = |i: i64| (noise(i) * 8.0 * MS as f64) as i64;
        // Ten samples wait for the last one of them.
        let burst = |i: i64| if (i / 500) % 2 == 0 { (9 - i % 10) * 4 * MS } else { jitter(i) };
        for drift in [0.0, 1e-4, -1e-4, 0.005, -0.005, 0.05, -0.05] {
            for delay in [&jitter as &dyn Fn(i64) -> i64, &burst] {
                let all = samples(drift, 4 * MS, 15_000, delay);
                let silent: Vec<[i64; 3]> =
                    all.iter().enumerate().filter(|(i, _)| (i / 250) % 4 != 3).map(|(_, sample)| *sample).collect();
                for samples in [all, silent] {
                    let error = error_after(5_000 * MS, &samples);
                    assert!(error < MS, "drift {drift}: {} ms", error as f64 / MS as f64);
                }
            }
        }
    }

    #[test]
    fn a_repeated_sample_has_the_stamp_of_the_first_and_an_older_one_goes_back() {
        let mut clock = DeviceClock::new(4 * MS);
        clock.stamp(0, 5 * MS);
        let stamp = clock.stamp(4 * MS, 9 * MS);
        assert_eq!(stamp, 9 * MS);
        assert_eq!(clock.stamp(4 * MS, 20 * MS), stamp);
        assert_eq!(clock.stamp(MS, 21 * MS), stamp - 3 * MS);
        assert!(clock.stamp(8 * MS, 22 * MS) > stamp);
    }

    #[test]
    fn a_clock_that_is_set_is_followed_at_once_and_one_that_paused_after_two_seconds() {
        // By how much it is set, for how long it pauses [ms], and how many samples look too old.
        for (jump, pause, patience) in [(-50_000, 0, 0), (1_000_000_000, 0, 0), (0, 1_000, 502)] {
            let mut clock = DeviceClock::new(4 * MS);
            (0..1_000).for_each(|i| _ = clock.stamp(i * 4 * MS, i * 4 * MS + MS));
            let ages = (1_000..2_000).map(|i| {
                let arrived = i * 4 * MS + MS + pause * MS;
                arrived - clock.stamp(i * 4 * MS + jump * MS, arrived)
            });
            let late = ages.filter(|age| *age > MS).count();
            assert!(late <= patience, "{late} samples are late after a jump of {jump} ms and a pause of {pause} ms");
            assert_eq!(clock.steps, 1, "after a jump of {jump} ms and a pause of {pause} ms");
            assert_eq!(clock.take_wrong_rate(), None, "a pause is no rate");
        }
    }

    #[test]
    fn a_drift_that_changes_is_followed_and_the_window_slides() {
        let (mut clock, mut own) = (DeviceClock::new(4 * MS), 0.0);
        for i in 0..30_000_i64 {
            let measured = i * 4 * MS;
            own += 4e6 * if measured < 60_000 * MS { 1.0002 } else { 1.0 };
            let arrived = measured + 3 * MS + (noise(i) * 4.0 * MS as f64) as i64;
            let error = (clock.stamp(own as i64, arrived) - (measured + 3 * MS)).abs();
            assert!(measured < 5_000 * MS || error < 2 * MS, "{error} ns at {measured} ns");
            let age = arrived - clock.lines[0].as_ref().unwrap().origin[1];
            assert!(age <= 2 * WINDOW + 5 * MS, "the line is {age} ns old");
        }
        assert_eq!(clock.steps, 0);
    }

    #[test]
    fn a_clock_at_half_the_speed_is_followed_and_told() {
        let mut clock = DeviceClock::new(4 * MS);
        let late = (0..2_000_i64).filter(|i| i * 8 - clock.stamp(i * 4 * MS, i * 8 * MS) / MS > 20).count();
        assert!(late < 250, "{late} samples look old");
        let rate = clock.take_wrong_rate().unwrap();
        assert!((rate - 0.5).abs() < 0.01, "{rate}");
        assert_eq!(clock.take_wrong_rate(), None, "once");
    }

    #[test]
    fn a_drift_is_read_after_a_second() {
        let mut clock = DeviceClock::new(4 * MS);
        assert_eq!(clock.reading(), None);
        for (i, [_, own, arrived]) in samples(3e-4, 4 * MS, 750, |_| 0).into_iter().enumerate() {
            let stamp = clock.stamp(own, arrived);
            let reading = clock.reading().expect("there are samples");
            assert_eq!((reading.device, reading.graph), (own, stamp));
            assert_eq!(reading.rate.is_some(), i >= 250, "sample {i}");
        }
        let reading = clock.reading().expect("there are samples");
        let rate = reading.rate.expect("there are three seconds of samples");
        assert!((rate - 1.0003).abs() < 1e-6, "{rate}");
        assert!((reading.seconds - 2.996).abs() < 1e-9, "{} s", reading.seconds);
    }

    #[test]
    fn a_datagram_that_comes_late_is_no_step_of_the_clock() {
        let mut clock = DeviceClock::new(100 * MS);
        (0..100).for_each(|i| _ = clock.stamp(i * 100 * MS, i * 100 * MS + MS));
        let newest = clock.stamp(10_000 * MS, 10_001 * MS);
        assert!(clock.stamp(9_800 * MS, 10_002 * MS) < newest - 150 * MS);
        assert_eq!(clock.steps, 0);
    }

    proptest! {
        #[test]
        fn no_time_of_a_device_is_too_large(times in prop::collection::vec((any::<i64>(), 0..1_000_000_000_000_i64), 1..50)) {
            let mut clock = DeviceClock::new(4 * MS);
            let mut arrived = 0;
            for (own, later) in times {
                arrived += later;
                clock.stamp(own, arrived);
            }
        }

        #[test]
        fn stamps_of_later_samples_are_later_and_memory_is_bounded(
            steps in prop::collection::vec((1..50_000_000_i64, 0..50_000_000_i64), 1..600),
        ) {
            let (mut clock, mut own, mut arrived, mut last) = (DeviceClock::new(4 * MS), 0, 0, i64::MIN);
            for (forth, later) in steps {
                own += forth;
                arrived += later;
                let stamp = clock.stamp(own, arrived);
                prop_assert!(stamp > last);
                last = stamp;
                prop_assert!(clock.lines.iter().flatten().all(|line| line.hull.len() <= MAX_POINTS));
            }
        }
    }
}
