//! How late the ticks of a run in real time began, and what made them late.

use std::fmt::Write;

use crate::cli::text::number::seconds;
use crate::cli::text::table::table;
use crate::engine::{Engine, Punctuality};

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
    let worst = punctuality.worst;
    if worst.by == 0 {
        return text;
    }
    // Writing to a string cannot fail.
    let _ = write!(text, "latest tick: {} ms late at {:.3} s", ms(worst.by), seconds(worst.time));
    if let Some(culprit) = &punctuality.culprit {
        let took = culprit.took.as_secs_f64() * 1e3;
        let _ = write!(text, "; {} took {took:.1} ms at {:.3} s", culprit.name, seconds(culprit.time));
    } else if punctuality.unexplained > 0 {
        let _ = write!(text, "; no node and no device took so long, so the machine was busy");
    }
    text + "\n"
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

fn ms(nanos: i64) -> String {
    format!("{:.1}", nanos as f64 * 1e-6)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::engine::{Culprit, LateTick};

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
        punctuality.worst = LateTick { time: 4_210_000_000, by: 12_340_000 };
        assert_eq!(text(&punctuality), format!("{table}latest tick: 12.3 ms late at 4.210 s\n"));
        punctuality.unexplained = 1;
        assert!(text(&punctuality).ends_with("4.210 s; no node and no device took so long, so the machine was busy\n"));
        let (name, took) = ("node `filter`".to_owned(), Duration::from_micros(11_900));
        punctuality.culprit = Some(Culprit { name, took, time: 4_198_000_000 });
        assert!(text(&punctuality).ends_with("late at 4.210 s; node `filter` took 11.9 ms at 4.198 s\n"));
    }
}
