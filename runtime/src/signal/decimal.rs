//! Decimal numbers of any length, for conversions between units that round once.

use num_bigint::BigUint;

/// The digits of pi, of which 100 stand behind the decimal point.
const PI: &str =
    "31415926535897932384626433832795028841971693993751058209749445923078164062862089986280348253421170679";
/// The digits of 1 / pi behind the decimal point.
const INVERSE_PI: &str =
    "3183098861837906715377675267450287240689192914809128974953346881177935952684530701802276055325061719";
/// Digits behind the decimal point of both.
const PI_DIGITS: i64 = 100;

/// Greater exponents have the same `f64`: zero or infinity.
const MAX_EXPONENT: i64 = 1 << 40;

/// Digits that a quotient has more than its dividend. A value halfway between two `f64` has fewer than 770 digits, so that
/// a digit behind these decides.
const QUOTIENT_DIGITS: u32 = 800;

/// A decimal number: a sign, a whole number, and a power of ten.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Decimal {
    is_negative: bool,
    digits: BigUint,
    /// Power of ten of the last digit.
    ten: i64,
}

impl Decimal {
    /// Reads a number in the form of TOML, `-1_000.5e3`, at the start of a text. Returns the rest as well.
    pub(super) fn parse(text: &str) -> Option<(Self, &str)> {
        let (is_negative, unsigned) = split_sign(text);
        let (mut digits, mut rest) = split_digits(unsigned)?;
        if digits.len() > 1 && digits.starts_with('0') {
            return None;
        }
        let mut ten = 0;
        if let Some(after) = rest.strip_prefix('.') {
            let fraction;
            (fraction, rest) = split_digits(after)?;
            ten = -(fraction.len() as i64);
            digits += &fraction;
        }
        if let Some(after) = rest.strip_prefix(['e', 'E']) {
            let (is_below, after) = split_sign(after);
            let exponent;
            (exponent, rest) = split_digits(after)?;
            let size = exponent.parse().unwrap_or(MAX_EXPONENT).min(MAX_EXPONENT);
            ten += if is_below { -size } else { size };
        }
        Some((Self { is_negative, digits: digits.parse().ok()?, ten }, rest))
    }

    /// Returns the number times `times / by`, times a power of ten and a power of pi.
    pub(super) fn scaled(&self, times: u64, by: u64, ten: i32, pi: i32) -> Self {
        let (mut digits, mut ten) = (&self.digits * times, self.ten + i64::from(ten));
        for _ in 0..pi.unsigned_abs() {
            digits *= if pi > 0 { PI } else { INVERSE_PI }.parse::<BigUint>().expect("these are digits");
            ten -= PI_DIGITS;
        }
        if by > 1 {
            digits *= BigUint::from(10_u8).pow(QUOTIENT_DIGITS);
            // A quotient that does not end gets one more digit, which stands for all others.
            let is_cut = &digits % by > BigUint::ZERO;
            digits = digits / by * 10_u8 + u8::from(is_cut);
            ten -= i64::from(QUOTIENT_DIGITS) + 1;
        }
        Self { is_negative: self.is_negative, digits, ten }
    }

    /// Returns the nearest `f64`; infinity if the number is too large.
    pub(super) fn to_f64(&self) -> f64 {
        let sign = if self.is_negative { "-" } else { "" };
        format!("{sign}{}e{}", self.digits, self.ten).parse().unwrap_or(f64::NAN)
    }
}

/// Splits off a sign, and returns whether it is a minus.
fn split_sign(text: &str) -> (bool, &str) {
    (text.starts_with('-'), text.strip_prefix(['+', '-']).unwrap_or(text))
}

/// Splits off one or more digits, with single underscores between them.
fn split_digits(text: &str) -> Option<(String, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '_').unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let is_good = digits.split('_').all(|group| !group.is_empty());
    is_good.then(|| (digits.replace('_', ""), rest))
}
