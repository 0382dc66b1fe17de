//! Bytes to text: UTF-8, UTF-16 or Windows-1252.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::log::LogError;

/// Bytes that are looked at to tell UTF-16 without a byte order mark.
const LOOKED_AT: usize = 4096;

/// The text of a file and what is to be said of its encoding; nothing is said of UTF-8.
///
/// # Errors
/// [`LogError::NotText`] for a workbook or an archive, and where NUL bytes stand between other text.
pub(crate) fn decode<'a>(
    name: &str,
    bytes: &'a [u8],
) -> Result<(Cow<'a, str>, Option<&'static str>), LogError> {
    let not_text = |line: u64, hint: &'static str| LogError::NotText {
        name: name.to_owned(),
        line,
        hint,
    };
    if bytes.starts_with(b"PK\x03\x04") {
        let hint = "it is a zip archive or an Excel workbook; export it as CSV";
        return Err(not_text(1, hint));
    }
    let encoding = match Encoding::for_bom(bytes) {
        Some((encoding, _)) => encoding,
        None => utf_16_without_mark(bytes).unwrap_or(UTF_8),
    };
    if encoding != UTF_8 {
        let (text, _, broken) = encoding.decode(bytes);
        if broken || text.contains('\0') {
            return Err(not_text(
                1,
                "it looks like UTF-16 and is not whole; export the recording as CSV",
            ));
        }
        return Ok((text, Some("UTF-16")));
    }
    if let Some(at) = memchr::memchr(0, bytes) {
        let line = 1 + bytes.iter().take(at).filter(|byte| **byte == b'\n').count() as u64;
        let hint =
            "the line holds NUL bytes (a logger that lost power?); delete it and what follows";
        return Err(not_text(line, hint));
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Ok((Cow::Borrowed(text), None));
    }
    let (text, _, _) = WINDOWS_1252.decode(bytes);
    // Control characters other than tabs and line ends are in no log: these bytes are no text in any encoding.
    let odd = |c: char| c.is_control() && !matches!(c, '\t' | '\n' | '\r' | '\u{c}' | '\u{1a}');
    if let Some(at) = text.find(odd) {
        let line = 1 + text.get(..at).map_or(0, |head| head.matches('\n').count()) as u64;
        return Err(not_text(
            line,
            "it holds control characters; export the recording as CSV",
        ));
    }
    Ok((text, Some("Windows-1252")))
}

/// ASCII characters, which logs are made of, have a NUL for every other byte.
fn utf_16_without_mark(bytes: &[u8]) -> Option<&'static Encoding> {
    let head = bytes.get(..bytes.len().min(LOOKED_AT) & !1)?;
    let pairs = head.len() / 2;
    let nuls = |odd: usize| {
        head.iter()
            .skip(odd)
            .step_by(2)
            .filter(|b| **b == 0)
            .count()
    };
    if pairs < 8 {
        return None;
    }
    match (nuls(0) * 10 > pairs * 9, nuls(1) * 10 > pairs * 9) {
        (false, true) => Some(UTF_16LE),
        (true, false) => Some(UTF_16BE),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_the_same_in_every_encoding() {
        let text = "Zeit;Temp [°C]\n0;1,5\n1;2,5\n";
        let utf_16 =
            |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
        let (little, big) = (utf_16(u16::to_le_bytes), utf_16(u16::to_be_bytes));
        let (windows, _, _) = WINDOWS_1252.encode(text);
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
            [b"\xFF\xFE".as_slice(), &little].concat(),
            [b"\xFE\xFF".as_slice(), &big].concat(),
            little,
            big,
            windows.to_vec(),
        ] {
            assert_eq!(decode("x", &bytes).unwrap().0, text);
        }
        assert!(decode("x", b"PK\x03\x04").is_err());
        assert!(decode("x", b"t,u\n0,\0\n").is_err());
        assert!(decode("x", b"t,\xB0\x01\n0,1\n").is_err());
    }
}
