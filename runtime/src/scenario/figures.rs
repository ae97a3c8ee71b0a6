//! The figures of one check, from its readings.

use super::figure::Figure;
use super::measure::{self, Reading, since};
use super::model::Check;
use super::window::Readings;

impl Check {
    /// Shifts the direction of a line by half turns, so that it is nearest to `about`.
    fn shifted(&self, value: f64, about: f64) -> f64 {
        self.period.map_or(value, |period| value - period * ((value - about) / period).round())
    }

    /// Shifts the direction of a line by half turns, so that it is nearest to the target of the check, or to 0.
    pub(super) fn nearest(&self, value: f64) -> f64 {
        self.shifted(value, self.settles.map_or(0.0, |(target, _)| target))
    }

    /// Returns the figures of the readings in the window.
    pub(super) fn figures(&self, readings: &Readings) -> Vec<Option<f64>> {
        let all = readings.all();
        let response = self
            .settles
            .and_then(|(target, within)| readings.visits().find_map(|visit| measure::response(visit, target, within)));
        let end = all.last().map_or(0.0, |last| last.time);
        let steady = since(all, (end - self.steady).max(response.unwrap_or(0.0)));
        let after = self.after(readings);
        let change = || Some(self.shifted(measure::change(&after)?, self.changes.unwrap_or(0.0)));
        let figure = |figure: &Figure| match figure {
            Figure::Response => response,
            Figure::Error => measure::mean(steady).zip(self.settles).map(|(mean, (target, _))| (mean - target).abs()),
            Figure::Mean => measure::mean(&after),
            // A value that has not settled has no deviation around its target, unless the check sets `after_s`.
            Figure::Std if self.after.is_some() || self.settles.is_none() => measure::std(&after),
            Figure::Std => measure::std(since(all, response?)),
            Figure::Max => measure::max(&after),
            Figure::Min => measure::min(&after),
            Figure::Change => change(),
            Figure::Return => change().map(f64::abs),
            Figure::Lost | Figure::Away | Figure::Ends => None,
        };
        self.figures.iter().map(figure).collect()
    }

    /// Returns the readings of every visit from `after_s` on, which counts from the begin of the visit.
    pub(super) fn after(&self, readings: &Readings) -> Vec<Reading> {
        let from = self.after.unwrap_or(0.0);
        let after = |visit: &[Reading]| Some(since(visit, visit.first()?.time + from).to_vec());
        readings.visits().filter_map(after).flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::window::Window;

    /// A decay from 2 with a time constant of 0.5 s, for 4 s.
    fn decay() -> Readings {
        visits(&[1001], |time, _| 2.0 * (-time / 0.5).exp())
    }

    /// Readings of visits of so many ticks of 4 ms. The value follows from the time in the window, and from the time
    /// since the begin of the visit.
    fn visits(ticks: &[u32], value: impl Fn(f64, f64) -> f64) -> Readings {
        let (mut readings, mut all) = (Readings::default(), 0);
        for count in ticks {
            for tick in 0..*count {
                let (time, since_entry) = (f64::from(all) * 0.004, f64::from(tick) * 0.004);
                readings.push(Reading { time, value: value(time, since_entry), is_new: true }, tick == 0);
                all += 1;
            }
        }
        readings
    }

    fn check(figures: &[Figure]) -> Check {
        Check {
            name: String::new(),
            column: String::new(),
            minus: None,
            period: None,
            unit: 1.0,
            settles: None,
            changes: None,
            after: None,
            steady: 10.0,
            window: Window::default(),
            figures: figures.to_vec(),
        }
    }

    /// Mean and variance of the decay from time `from` on, as integrals.
    fn expected(from: f64) -> (f64, f64) {
        let (length, start, end) = (4.0 - from, (-from / 0.5).exp(), (-4.0f64 / 0.5).exp());
        let mean = 2.0 * 0.5 * (start - end) / length;
        (mean, 4.0 * 0.25 * (start * start - end * end) / length - mean * mean)
    }

    #[test]
    fn the_steady_state_begins_after_the_response_and_the_deviation_at_after_s() {
        let figures = [Figure::Response, Figure::Error, Figure::Std];
        let check = |after, steady| Check { settles: Some((0.0, 0.3)), after, steady, ..check(&figures) };
        let response = check(None, 10.0).figures(&decay())[0].unwrap();
        assert!((response - 0.967).abs() < 0.005, "{response}");
        // `after_s`, `steady_s`, and the times from which the error and the deviation are measured.
        let cases = [
            (None, 10.0, response, response),
            (None, 2.0, 2.0, response),
            (Some(2.5), 10.0, response, 2.5),
            (Some(0.1), 1.0, 3.0, 0.1),
        ];
        for (after, steady, of_error, of_std) in cases {
            let figures = check(after, steady).figures(&decay());
            let (error, std) = (expected(of_error).0, expected(of_std).1.sqrt());
            assert!(
                (figures[1].unwrap() / error - 1.0).abs() < 0.01,
                "{after:?} {steady}: {:?}, not {error}",
                figures[1]
            );
            assert!((figures[2].unwrap() / std - 1.0).abs() < 0.01, "{after:?} {steady}: {:?}, not {std}", figures[2]);
        }
    }
    #[test]
    fn a_response_lies_within_one_visit_and_counts_the_time_in_the_mode() {
        let response = |ticks: &[u32]| {
            let check = Check { settles: Some((0.0, 0.1)), ..check(&[Figure::Response]) };
            check.figures(&visits(ticks, |_, _| 0.0))[0]
        };
        // Ten samples, and then half a second: 135 ticks.
        assert_eq!(response(&[135]), Some(9.0 * 0.004));
        assert_eq!(response(&[134, 134]), None, "the visits together are long enough, but none of them is");
        assert_eq!(response(&[100, 50, 135]), Some(159.0 * 0.004));
    }

    #[test]
    fn after_s_leaves_out_the_begin_of_every_visit() {
        let figures = [Figure::Max, Figure::Min, Figure::Mean, Figure::Change];
        // The value is the time since the entry, so a visit of n ticks ends at 4 (n - 1) ms.
        let readings = visits(&[50, 10, 30], |_, since_entry| since_entry);
        let after = |after| Check { after, ..check(&figures) }.figures(&readings);
        let sum = |ticks: std::ops::Range<u32>| ticks.sum::<u32>();
        let near = |found: Vec<Option<f64>>, expected: [f64; 4]| {
            found.iter().zip(expected).all(|(found, expected)| (found.unwrap() - expected).abs() < 1e-12)
        };
        let mean = f64::from(sum(0..50) + sum(0..10) + sum(0..30)) / 90.0 * 0.004;
        assert!(near(after(None), [0.196, 0.0, mean, 0.116]), "{:?}", after(None));
        // The second visit is too short. The first value is that of the first visit, and the last that of the third.
        let mean = f64::from(sum(20..50) + sum(20..30)) / 40.0 * 0.004;
        assert!(near(after(Some(0.08)), [0.196, 0.08, mean, 0.116 - 0.08]), "{:?}", after(Some(0.08)));
        assert_eq!(after(Some(0.2)), [None; 4]);
    }

    #[test]
    fn the_change_of_a_decay_equals_the_closed_form_and_needs_two_values() {
        let figures = [Figure::Change, Figure::Return];
        for after in [0.0, 0.1, 1.0] {
            let found = Check { after: Some(after), ..check(&figures) }.figures(&decay());
            let expected = 2.0 * ((-4.0f64 / 0.5).exp() - (-after / 0.5).exp());
            assert!((found[0].unwrap() - expected).abs() < 1e-12 && found[1] == Some(-found[0].unwrap()), "{found:?}");
        }
        let present = |from: f64, to: f64| {
            let value = |time: f64, _| if (from..to).contains(&time) { time } else { f64::NAN };
            check(&figures).figures(&visits(&[100], value))
        };
        // The first and the last present value: at ticks 25 and 49.
        assert!((present(0.0999, 0.1999)[0].unwrap() - 24.0 * 0.004).abs() < 1e-12);
        assert_eq!(present(0.0999, 0.1001), [None, None], "one value");
        assert_eq!(present(9.0, 9.0), [None, None], "none");
    }

    #[test]
    fn the_change_of_the_direction_of_a_line_is_the_smallest_angle() {
        // From 170 to 190 degrees, which is the line at 10 degrees.
        let line = |time: f64, _| if time < 0.1 { 170.0 } else { 10.0 };
        let change = |changes| Check { period: Some(180.0), changes, ..check(&[Figure::Change, Figure::Return]) };
        let readings = visits(&[50], line);
        assert_eq!(change(None).figures(&readings), [Some(20.0), Some(20.0)]);
        assert_eq!(change(Some(200.0)).figures(&readings)[0], Some(200.0), "nearest to what is expected");
    }
}
