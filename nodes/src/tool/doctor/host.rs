//! Whether this computer can run a graph in real time.

use std::fs;
use std::time::{Duration, Instant};

use super::Finding;
use super::timing::quantile;

/// Sleeps in the measurement of the scheduler, and the length of each.
const SLEEPS: usize = 300;
const SLEEP: Duration = Duration::from_millis(1);
/// Lateness of a sleep for 99 % from which on fast graphs are late [s].
const MAX_LATENESS_S: f64 = 0.001;

pub(super) fn examine() -> Vec<Finding> {
    let lateness: Vec<f64> = (0..SLEEPS)
        .map(|_| {
            let begin = Instant::now();
            std::thread::sleep(SLEEP);
            (begin.elapsed() - SLEEP).as_secs_f64()
        })
        .collect();
    let [median, most, worst] = [0.5, 0.99, 1.0].map(|part| quantile(&lateness, part));
    let text = format!(
        "a sleep of 1 ms ends {:.2} ms late at the median, {:.2} ms for 99 %, {:.2} ms at worst",
        median * 1e3,
        most * 1e3,
        worst * 1e3
    );
    let mut findings = vec![Finding::fine(text)];
    if most > MAX_LATENESS_S {
        findings.push(Finding::warning(
            "ticks will begin late at 250 Hz: close other programs, or use a kernel with PREEMPT_RT",
        ));
    }
    findings.extend(kernel(fs::read_to_string("/sys/kernel/realtime").ok().as_deref()));
    findings.extend(fs::read_to_string("/proc/self/limits").ok().as_deref().and_then(priority));
    findings
}

/// Describes the kernel, from `/sys/kernel/realtime`, which only kernels with PREEMPT_RT have.
fn kernel(realtime: Option<&str>) -> Option<Finding> {
    let is_realtime = realtime.is_some_and(|text| text.trim() == "1");
    cfg!(target_os = "linux").then(|| match is_realtime {
        true => Finding::fine("the kernel has PREEMPT_RT"),
        false => Finding::fine("the kernel has no PREEMPT_RT, which an arm with a cycle of 1 ms needs"),
    })
}

/// Describes the permission for real-time priorities, from `/proc/self/limits`.
fn priority(limits: &str) -> Option<Finding> {
    let line = limits.lines().find(|line| line.starts_with("Max realtime priority"))?;
    let soft = line.split_whitespace().nth(3)?;
    Some(match soft {
        "0" => Finding::fine(
            "this user may not raise its priority; add `@realtime - rtprio 99` to /etc/security/limits.conf and join the \
             group `realtime`, then start with `chrt -f 50 tactflow …`",
        ),
        soft => Finding::fine(format!("this user may use real-time priorities up to {soft}: `chrt -f 50 tactflow …`")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_permission_is_read_from_the_limits_of_the_process() {
        let limits =
            |soft: &str| format!("Limit  Soft Limit  Hard Limit  Units\nMax realtime priority     {soft}   0   \n");
        assert!(priority(&limits("0")).unwrap().text.contains("may not raise"));
        assert!(priority(&limits("99")).unwrap().text.contains("up to 99"));
        assert_eq!(priority("Max cpu time  unlimited unlimited seconds"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_kernel_is_known_by_its_file() {
        assert_eq!(kernel(Some("1\n")).unwrap().text, "the kernel has PREEMPT_RT");
        assert!(kernel(None).unwrap().text.contains("no PREEMPT_RT"));
    }
}
