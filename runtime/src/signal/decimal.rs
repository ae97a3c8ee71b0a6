//! Decimal numbers of any length, for conversions between units that round once.

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

/// Digits of a quotient. A value halfway between two `f64` has fewer than 770, so that a digit behind these decides.
const QUOTIENT_DIGITS: usize = 800;

/// A decimal number: a sign, digits, and a power of ten.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Decimal {
    is_negative: bool,
    /// The digits from 0 to 9, the most significant first.
    digits: Vec<u8>,
    /// Power of ten of the last digit.
    ten: i64,
}

impl Decimal {
    /// Reads a number in the form of TOML, `-1_000.5e3`, at the start of a text. Returns the rest as well.
    pub(super) fn parse(text: &str) -> Option<(Self, &str)> {
        let (is_negative, unsigned) = split_sign(text);
        let (mut digits, mut rest) = split_digits(unsigned)?;
        if digits.len() > 1 && digits[0] == 0 {
            return None;
        }
        let mut ten = 0;
        if let Some(after) = rest.strip_prefix('.') {
            let fraction;
            (fraction, rest) = split_digits(after)?;
            ten = -(fraction.len() as i64);
            digits.extend(fraction);
        }
        if let Some(after) = rest.strip_prefix(['e', 'E']) {
            let (is_below, after) = split_sign(after);
            let exponent;
            (exponent, rest) = split_digits(after)?;
            let size = exponent.iter().fold(0, |size, digit| (10 * size + i64::from(*digit)).min(MAX_EXPONENT));
            ten += if is_below { -size } else { size };
        }
        Some((Self { is_negative, digits, ten }, rest))
    }

    /// Returns the number times `times / by`, times a power of ten and a power of pi.
    pub(super) fn scaled(&self, times: u64, by: u64, ten: i32, pi: i32) -> Self {
        let mut product = self.times(&times.to_string());
        for _ in 0..pi.unsigned_abs() {
            product = product.times(if pi > 0 { PI } else { INVERSE_PI });
            product.ten -= PI_DIGITS;
        }
        let quotient = if by == 1 { product } else { product.over(by) };
        Self { ten: quotient.ten + i64::from(ten), ..quotient }
    }

    /// Returns the nearest `f64`; infinity if the number is too large.
    pub(super) fn to_f64(&self) -> f64 {
        let sign = if self.is_negative { "-" } else { "" };
        let digits: String = self.digits.iter().map(|digit| char::from(b'0' + digit)).collect();
        format!("{sign}{digits}e{}", self.ten).parse().unwrap_or(f64::NAN)
    }

    /// Multiplies by a whole number.
    fn times(&self, factor: &str) -> Self {
        let factor = factor.as_bytes();
        let mut sums = vec![0_u64; self.digits.len() + factor.len()];
        for (i, a) in self.digits.iter().enumerate() {
            for (j, b) in factor.iter().enumerate() {
                sums[i + j + 1] += u64::from(*a) * u64::from(b - b'0');
            }
        }
        let mut carry = 0;
        let digits = sums.iter().rev().map(|sum| {
            let digit = (sum + carry) % 10;
            carry = (sum + carry) / 10;
            digit as u8
        });
        let mut digits: Vec<u8> = digits.collect();
        digits.reverse();
        Self { digits, ..*self }
    }

    /// Divides by a whole number. A quotient that does not end gets one more digit, which stands for all others.
    fn over(&self, by: u64) -> Self {
        let (mut rest, mut ten) = (0_u128, self.ten);
        let mut given = self.digits.iter();
        let mut digits = Vec::new();
        let length = QUOTIENT_DIGITS + self.digits.len();
        while digits.len() < length {
            let next = match given.next() {
                Some(digit) => *digit,
                None if rest == 0 => break,
                None => {
                    ten -= 1;
                    0
                }
            };
            rest = 10 * rest + u128::from(next);
            let digit = (rest / u128::from(by)) as u8;
            if digit > 0 || !digits.is_empty() {
                digits.push(digit);
            }
            rest %= u128::from(by);
        }
        if rest > 0 {
            digits.push(1);
            ten -= 1;
        }
        if digits.is_empty() {
            digits.push(0);
        }
        Self { digits, ten, ..*self }
    }
}

/// Splits off a sign, and returns whether it is a minus.
fn split_sign(text: &str) -> (bool, &str) {
    (text.starts_with('-'), text.strip_prefix(['+', '-']).unwrap_or(text))
}

/// Splits off one or more digits, with single underscores between them.
fn split_digits(text: &str) -> Option<(Vec<u8>, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '_').unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let is_good = digits.split('_').all(|group| !group.is_empty());
    is_good.then(|| (digits.bytes().filter(u8::is_ascii_digit).map(|digit| digit - b'0').collect(), rest))
}
