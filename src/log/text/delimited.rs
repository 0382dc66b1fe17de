//! A line to its fields: separators, quotes, spaces.

use std::ops::Range;

/// Cuts a line at the separators outside quotes: `fields` gets the range of each field, without its quotes and the
/// spaces around it.
pub(crate) fn split(line: &[u8], separator: u8, fields: &mut Vec<Range<usize>>) {
    fields.clear();
    let is_space = |byte: &u8| *byte == b' ' || (*byte == b'\t' && separator != b'\t');
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let mut at = 0;
    loop {
        let rest = line.get(at..).unwrap_or_default();
        let padding = rest.iter().take_while(|byte| is_space(byte)).count();
        let quoted = rest
            .get(padding..)
            .and_then(|rest| rest.strip_prefix(b"\""))
            .and_then(closing_quote);
        let search_from = quoted.map_or(0, |length| padding + length + 2);
        let end = rest
            .get(search_from..)
            .and_then(|rest| memchr::memchr(separator, rest))
            .map(|end| end + search_from);
        let mut field = match quoted {
            Some(length) => at + padding + 1..at + padding + 1 + length,
            None => at + padding..at + end.unwrap_or(rest.len()).max(padding),
        };
        while line
            .get(field.clone())
            .and_then(<[u8]>::first)
            .is_some_and(is_space)
        {
            field.start += 1;
        }
        while line
            .get(field.clone())
            .and_then(<[u8]>::last)
            .is_some_and(is_space)
        {
            field.end -= 1;
        }
        fields.push(field);
        match end {
            Some(end) => at += end + 1,
            None => return,
        }
    }
}

/// Length of what stands before the closing quote; a doubled quote does not close.
fn closing_quote(text: &[u8]) -> Option<usize> {
    let mut quotes = memchr::memchr_iter(b'"', text).peekable();
    while let Some(at) = quotes.next() {
        if quotes.next_if_eq(&(at + 1)).is_none() {
            return Some(at);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(line: &str, separator: u8) -> Vec<&str> {
        let mut ranges = Vec::new();
        split(line.as_bytes(), separator, &mut ranges);
        ranges.into_iter().map(|range| &line[range]).collect()
    }

    #[test]
    fn splits_quotes_spaces_and_empty_fields() {
        assert_eq!(
            fields("a, b ,,\"c,d\" , \" e \"\r", b','),
            ["a", "b", "", "c,d", "e"]
        );
        assert_eq!(fields("", b','), [""]);
        assert_eq!(fields(",", b','), ["", ""]);
        assert_eq!(fields("  ", b','), [""]);
        assert_eq!(fields(" \t1\t 2", b'\t'), ["", "1", "2"]);
        assert_eq!(fields("\"open,1", b','), ["\"open", "1"]);
        assert_eq!(fields("\"a \"\"b\"\"\",2", b','), ["a \"\"b\"\"", "2"]);
        assert_eq!(fields("\"\",2", b','), ["", "2"]);
    }
}
