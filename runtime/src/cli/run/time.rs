//! Arguments that are times.

/// Parses a time with its unit that is greater than 0, and returns it in seconds.
///
/// # Errors
/// If the text is not such a time.
pub fn duration(text: &str) -> Result<f64, String> {
    time(text, "greater than 0", |number| number > 0.0)
}

/// Parses a time with its unit whose number is in a range.
fn time(text: &str, range: &str, is_in_range: impl Fn(f64) -> bool) -> Result<f64, String> {
    const UNITS: [(&str, f64); 4] = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("h", 3600.0)];
    let found = UNITS.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let (number, seconds) = found.ok_or("give a time with its unit: 20s, 500ms, 2min, 1h")?;
    match number.trim().parse::<f64>() {
        Ok(number) if is_in_range(number) && number.is_finite() => Ok(number * seconds),
        _ => Err(format!("`{number}` is not a number {range}")),
    }
}

/// Parses a time and a word: `2s:resume`.
pub(crate) fn word(text: &str) -> Result<(f64, String), String> {
    match text.split_once(':') {
        Some((at, word)) if !word.trim().is_empty() => {
            Ok((time(at, "from 0", |number| number >= 0.0)?, word.trim().to_owned()))
        }
        _ => Err("give a time and a word: 2s:resume".into()),
    }
}

/// Parses a time, a parameter and a number: `2s:pid.gains.x.kp=3`.
pub(crate) fn change(text: &str) -> Result<(f64, String, f64), String> {
    let form = "give a time, a parameter and a number: 2s:pid.gains.x.kp=3";
    let (at, change) = text.split_once(':').ok_or(form)?;
    let (name, number) = change.split_once('=').ok_or(form)?;
    let value: f64 = number.trim().parse().map_err(|_| format!("`{}` is not a number: {form}", number.trim()))?;
    if name.trim().is_empty() {
        return Err(form.into());
    }
    Ok((time(at, "from 0", |number| number >= 0.0)?, name.trim().to_owned(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, seconds) in [("20s", 20.0), ("500ms", 0.5), ("2min", 120.0), ("1.5 h", 5400.0)] {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for text in ["20", "", "s", "-1s", "0s", "nans", "infs", "3 days"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_change_has_a_time_a_parameter_and_a_number() {
        assert_eq!(change("2s:pid.gains.x.kp=3"), Ok((2.0, "pid.gains.x.kp".to_owned(), 3.0)));
        assert_eq!(change("5ms: a.b = -1e-3 "), Ok((0.005, "a.b".to_owned(), -0.001)));
        for text in ["a.b=1", "2s:a.b", "2s:=1", "2s:a.b=", "2s:a.b=x", "2:a.b=1", "-1s:a.b=1", ""] {
            assert!(change(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_word_has_a_time() {
        for (text, at, expected) in
            [("2s:resume", 2.0, "resume"), ("0s: stop ", 0.0, "stop"), ("5ms:a:b", 0.005, "a:b")]
        {
            assert_eq!(word(text), Ok((at, expected.to_owned())), "{text}");
        }
        for text in ["resume", "2s", "2s:", "2s: ", ":stop", "2:stop", "-1s:stop", "nans:stop", "infs:stop"] {
            assert!(word(text).is_err(), "{text}");
        }
    }
}
