//! How late the ticks of a run in real time began, and what made them late.

use std::cmp::Reverse;
use std::fmt::Write;
use std::time::Duration;

use crate::cli::text::number::seconds;
use crate::cli::text::table::table;
use crate::engine::{Engine, Punctuality, TickUse};

/// Maximum number of other nodes and devices that are listed.
const MAX_LISTED: usize = 3;

/// Writes the histogram of the lateness, the latest tick and what made ticks late; nothing in virtual time.
pub(crate) fn lateness(engine: &Engine) -> String {
    if engine.began().is_none() { String::new() } else { text(engine.punctuality()) }
}

fn text(punctuality: &Punctuality) -> String {
    let all = punctuality.counts.iter().sum::<u64>().max(1) as f64;
    let mut rows = vec![["ticks began late by", "ticks", "part"].map(String::from)];
    for (i, count) in punctuality.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        rows.push([bin(i), count.to_string(), format!("{:.1} %", 100.0 * *count as f64 / all)]);
    }
    let mut text = table(&rows, 1, usize::MAX);
    let worst = &punctuality.worst;
    if worst.by == 0 {
        return text;
    }
    let cause = worst.cause.as_ref();
    // Writing to a string cannot fail.
    let _ = write!(text, "latest tick: {:.1} ms late at {:.3} s", worst.by as f64 * 1e-6, seconds(worst.time));
    let _ = writeln!(text, "{}", cause.map(reason).unwrap_or_default());
    let named = cause.filter(|cause| cause.has_culprit()).map_or("", |cause| &cause.slowest);
    let mut others: Vec<&(String, Duration)> = punctuality.culprits.iter().filter(|(name, _)| name != named).collect();
    others.sort_by_key(|(_, took)| Reverse(*took));
    let omitted = others.len().saturating_sub(MAX_LISTED);
    let others = others.iter().take(MAX_LISTED).map(|(name, took)| format!("{name} took up to {}", ms(*took)));
    let mut others = others.collect::<Vec<_>>().join(", ");
    if omitted > 0 {
        let _ = write!(others, ", and {omitted} more");
    }
    if !others.is_empty() {
        let _ = writeln!(text, "other late ticks: {others}");
    }
    text
}

/// Describes what took the time before the latest tick.
fn reason(cause: &TickUse) -> String {
    let TickUse { time, lasted, slowest, took, together, output } = cause;
    let at = format!("at {:.3} s", seconds(*time));
    let (took, total, written) = (ms(*took), ms(*together), ms(*output));
    if cause.has_culprit() {
        format!("; {slowest} took {took} {at}")
    } else if *together * 2 >= *lasted {
        format!("; the nodes and devices took {total} together {at}, the longest was {slowest} with {took}")
    } else if *output * 2 >= *lasted {
        format!("; the output of the run took {written} {at}")
    } else if (*together + *output) * 10 < *lasted {
        format!("; nodes, devices and output took only {} {at}, so the machine was busy", ms(*together + *output))
    } else {
        format!("; of {} {at}, the nodes and devices took {total} and the output {written}", ms(*lasted))
    }
}

/// Describes a bin of the histogram.
fn bin(i: usize) -> String {
    let bounds = Punctuality::BOUNDS_NS.map(|bound| bound as f64 / 1e6);
    match (i.checked_sub(1).map(|below| bounds[below]), bounds.get(i)) {
        (None, Some(to)) => format!("less than {to} ms"),
        (Some(from), Some(to)) => format!("{from} to {to} ms"),
        (from, None) => format!("{} ms or more", from.unwrap_or_default()),
    }
}

fn ms(time: Duration) -> String {
    format!("{:.1} ms", time.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::LateTick;

    #[test]
    fn the_histogram_has_the_bins_with_ticks_and_the_latest_tick_has_a_reason() {
        let mut punctuality = Punctuality::default();
        punctuality.counts = [480, 0, 15, 4, 0, 1];
        let table = "ticks began late by  ticks    part\n\
                     less than 0.1 ms       480  96.0 %\n\
                     0.3 to 1 ms             15   3.0 %\n\
                     1 to 3 ms                4   0.8 %\n\
                     10 ms or more            1   0.2 %\n";
        assert_eq!(text(&punctuality), table);
        let mut with = |cause: Option<TickUse>| {
            punctuality.worst = LateTick { time: 4_210_000_000, by: 12_340_000, cause };
            text(&punctuality).split_off(table.len())
        };
        let late = "latest tick: 12.3 ms late at 4.210 s";
        assert_eq!(with(None), format!("{late}\n"));
        let us = Duration::from_micros;
        let measured = |took, together, output| TickUse {
            time: 4_198_000_000,
            lasted: us(14_000),
            slowest: "node `filter`".into(),
            took: us(took),
            together: us(together),
            output: us(output),
        };
        let cases = [
            (measured(11_900, 12_000, 0), "node `filter` took 11.9 ms at 4.198 s"),
            (
                measured(4_000, 12_000, 0),
                "the nodes and devices took 12.0 ms together at 4.198 s, the longest was node `filter` with 4.0 ms",
            ),
            (measured(100, 300, 12_500), "the output of the run took 12.5 ms at 4.198 s"),
            (measured(100, 300, 200), "nodes, devices and output took only 0.5 ms at 4.198 s, so the machine was busy"),
            (
                measured(1_000, 4_000, 3_000),
                "of 14.0 ms at 4.198 s, the nodes and devices took 4.0 ms and the output 3.0 ms",
            ),
        ];
        for (cause, expected) in cases {
            assert_eq!(with(Some(cause)), format!("{late}; {expected}\n"));
        }
        let culprit = |name: &str, took| (name.to_owned(), us(took));
        punctuality.culprits =
            vec![culprit("node `filter`", 11_900), culprit("node `b`", 3_000), culprit("device `d`", 4_000)];
        punctuality.worst.cause = Some(measured(11_900, 12_000, 0));
        let others = "other late ticks: device `d` took up to 4.0 ms, node `b` took up to 3.0 ms\n";
        assert!(text(&punctuality).ends_with(&format!("at 4.198 s\n{others}")), "{}", text(&punctuality));
    }
}
