//! What the stamps of a device are made of: its own clock, or the arrival of its samples.

use tactflow_runtime::device::ClockReading;

use super::Finding;

/// Part by which a clock may differ from that of this computer; crystals differ by less than a thousandth.
const MAX_OFF: f64 = 0.01;

/// Describes the clock of a device. `latency` is the stated one, and `age` is the median age of its samples, both [s].
pub(super) fn describe(reading: Option<ClockReading>, latency: f64, age: f64) -> Vec<Finding> {
    let Some(ClockReading { device, graph, rate, seconds }) = reading else {
        let less =
            if latency > 0.0 { format!(", less the stated latency of {} ms", latency * 1e3) } else { String::new() };
        return vec![Finding::fine(format!(
            "clock: the stamp of a sample is its arrival{less}: its age is not measured"
        ))];
    };
    let [device, graph] = [device, graph].map(|time| time as f64 * 1e-9);
    let text = format!(
        "clock: stamps are times of the device's own clock, which showed {device:.3} s after {graph:.3} s here"
    );
    let Some(rate) = rate else {
        return vec![Finding::fine(
            text + "; its rate is not known without a second of steady samples: use `--for 30s`",
        )];
    };
    let off = rate - 1.0;
    // The rate is that of the samples with the smallest delays. Half of all samples are delayed by less than the median.
    let error = (age - latency).max(1e-6) / seconds;
    let side = if off < 0.0 { "slower" } else { "faster" };
    let text = format!(
        "{text}; it runs {} {side} than the clock of this computer (measured for {seconds:.1} s, to within {}); ages are \
         above the smallest delay, which cannot be observed",
        part(off.abs()),
        part(error)
    );
    let mut findings = vec![Finding::fine(text)];
    if off.abs() > MAX_OFF + error {
        findings.push(Finding::warning(format!(
            "its clock is off by {}: check the unit of its stamps in the bench, or leave its clock out",
            part(off.abs())
        )));
    }
    findings
}

/// Writes a part of 1 in ppm or in percent.
fn part(part: f64) -> String {
    if part < 1e-3 { format!("{:.0} ppm", part * 1e6) } else { format!("{:.2} %", part * 100.0) }
}

#[cfg(test)]
mod tests {
    use super::super::Severity;
    use super::*;

    fn reading(rate: Option<f64>) -> Option<ClockReading> {
        Some(ClockReading { device: 1_003_000_000_000, graph: 3_100_000_000, rate, seconds: 2.0 })
    }

    #[test]
    fn a_device_without_a_clock_has_stamps_of_arrival() {
        let text = |latency| describe(None, latency, 0.0).remove(0).text;
        assert_eq!(text(0.0), "clock: the stamp of a sample is its arrival: its age is not measured");
        assert!(text(0.004).contains("less the stated latency of 4 ms"));
    }

    #[test]
    fn a_rate_is_said_with_its_error() {
        let findings = describe(reading(Some(1.0003)), 0.0, 0.0002);
        assert!(findings[0].text.contains("showed 1003.000 s after 3.100 s here"), "{findings:?}");
        assert!(findings[0].text.contains("runs 300 ppm faster"), "{findings:?}");
        assert!(findings[0].text.contains("to within 100 ppm"), "{findings:?}");
        assert_eq!(findings.len(), 1);
        assert!(describe(reading(None), 0.0, 0.0)[0].text.contains("its rate is not known"));
    }

    #[test]
    fn a_wrong_unit_is_a_warning() {
        let findings = describe(reading(Some(0.1)), 0.0, 0.0002);
        assert!(findings[0].text.contains("runs 90.00 % slower"), "{findings:?}");
        assert_eq!(findings[1].severity, Severity::Warning);
        assert_eq!(describe(reading(Some(1.02)), 0.0, 0.2).len(), 1, "the error is larger");
    }
}
