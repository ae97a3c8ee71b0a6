//! Bytes that a description writes as text, or in hexadecimal digits after `hex:`.

/// Reads bytes: `hex:F0C4` for two bytes, any other text for its own bytes.
///
/// # Errors
/// What is wrong, and what to write instead.
pub(crate) fn bytes_of(text: &str) -> Result<Vec<u8>, (String, String)> {
    let Some(digits) = text.strip_prefix("hex:") else {
        return Ok(text.as_bytes().to_vec());
    };
    let digits: Vec<char> = digits.chars().filter(|digit| !digit.is_whitespace()).collect();
    let help = || "write two hexadecimal digits for each byte, such as `hex:AA55`".to_owned();
    if let Some(strange) = digits.iter().find(|digit| !digit.is_ascii_hexdigit()) {
        return Err((format!("`{strange}` is not a hexadecimal digit"), help()));
    }
    if !digits.len().is_multiple_of(2) {
        return Err((format!("{} hexadecimal digits are not whole bytes", digits.len()), help()));
    }
    let value = |digit: char| digit.to_digit(16).unwrap_or_default() as u8;
    Ok(digits.as_chunks::<2>().0.iter().map(|[high, low]| value(*high) << 4 | value(*low)).collect())
}

/// Whether a text looks like bytes in hexadecimal digits without their prefix.
pub(crate) fn is_bare_hex(text: &str) -> bool {
    text.len().is_multiple_of(2) && text.len() >= 2 && text.chars().all(|digit| digit.is_ascii_hexdigit())
}

/// Whether a text is bytes in hexadecimal digits with spaces between them: `01 04 00`.
pub(crate) fn is_spaced_hex(text: &str) -> bool {
    let is_byte = |word: &str| word.len() == 2 && word.chars().all(|digit| digit.is_ascii_hexdigit());
    text.contains(' ') && text.split(' ').all(is_byte)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_text_or_hexadecimal() {
        assert_eq!(bytes_of("hex:F0C400F1C5"), Ok(vec![0xF0, 0xC4, 0x00, 0xF1, 0xC5]));
        assert_eq!(bytes_of("hex:aa 55"), Ok(vec![0xAA, 0x55]));
        assert_eq!(bytes_of("A\n"), Ok(b"A\n".to_vec()));
        assert_eq!(bytes_of("hex:AA5").unwrap_err().0, "3 hexadecimal digits are not whole bytes");
        assert_eq!(bytes_of("hex:0xAA").unwrap_err().0, "`x` is not a hexadecimal digit");
        assert!(is_spaced_hex("01 04 F1") && !is_spaced_hex("01") && !is_spaced_hex("go 01"));
        assert!(is_bare_hex("AA55") && !is_bare_hex("wr") && !is_bare_hex("AA5"));
    }
}
