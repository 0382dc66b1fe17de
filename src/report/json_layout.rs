//! JSON that a person can read: an object has a key a line, a matrix a row a line, long lists are wrapped.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};

/// Lines of numbers are wrapped before this column.
const LINE_WIDTH: usize = 110;

/// The document as text, ending in a line break.
///
/// Numbers are written in the shortest form that is read back exactly.
///
/// # Errors
/// [`serde_json::Error`] for a value that JSON cannot hold, such as a map whose keys are no text.
pub fn to_json<T: Serialize + ?Sized>(value: &T) -> serde_json::Result<String> {
    let mut bytes = Vec::new();
    value.serialize(&mut Serializer::with_formatter(
        &mut bytes,
        Layout::default(),
    ))?;
    bytes.push(b'\n');
    String::from_utf8(bytes).map_err(serde::ser::Error::custom)
}

/// One open array or object.
#[derive(Debug, Default)]
struct Level {
    /// Whether anything stands on lines of its own in it, so that it closes on one too.
    tall: bool,
}

/// Layout of the text.
#[derive(Debug, Default)]
struct Layout {
    levels: Vec<Level>,
    /// What is to be written before the next array element; how depends on what it is.
    before: Option<bool>,
    /// Column of the line being written.
    column: usize,
}

impl Layout {
    fn new_line<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        for _ in 0..self.levels.len() {
            writer.write_all(b"  ")?;
        }
        self.column = 2 * self.levels.len();
        Ok(())
    }

    /// Opens an array or object; in an array it stands on a line of its own.
    fn open<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        if let Some(first) = self.before.take() {
            if !first {
                writer.write_all(b",")?;
            }
            if let Some(level) = self.levels.last_mut() {
                level.tall = true;
            }
            self.new_line(writer)?;
        }
        self.levels.push(Level::default());
        self.column += 1;
        writer.write_all(bracket)
    }

    fn close<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        if self.levels.pop().is_some_and(|level| level.tall) {
            self.new_line(writer)?;
        }
        self.column += 1;
        writer.write_all(bracket)
    }

    /// Writes a number, a truth value or null: in an array beside the one before, while there is room.
    fn scalar<W: ?Sized + Write>(&mut self, writer: &mut W, text: &[u8]) -> io::Result<()> {
        self.make_room(writer, text.len())?;
        self.column += text.len();
        writer.write_all(text)
    }

    fn make_room<W: ?Sized + Write>(&mut self, writer: &mut W, width: usize) -> io::Result<()> {
        match self.before.take() {
            Some(false) if self.column + width + 3 > LINE_WIDTH => {
                writer.write_all(b",")?;
                self.new_line(writer)
            }
            Some(false) => {
                self.column += 2;
                writer.write_all(b", ")
            }
            Some(true) | None => Ok(()),
        }
    }
}

impl Formatter for Layout {
    fn write_null<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.scalar(writer, b"null")
    }

    fn write_bool<W: ?Sized + Write>(&mut self, writer: &mut W, value: bool) -> io::Result<()> {
        self.scalar(writer, if value { b"true" } else { b"false" })
    }

    fn write_i64<W: ?Sized + Write>(&mut self, writer: &mut W, value: i64) -> io::Result<()> {
        self.scalar(writer, value.to_string().as_bytes())
    }

    fn write_u64<W: ?Sized + Write>(&mut self, writer: &mut W, value: u64) -> io::Result<()> {
        self.scalar(writer, value.to_string().as_bytes())
    }

    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        // The shortest form, as serde_json writes it.
        let text = serde_json::to_string(&value)?;
        self.scalar(writer, text.as_bytes())
    }

    fn begin_string<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        match self.before.take() {
            Some(first) => {
                // A list of sentences: a line each.
                if !first {
                    writer.write_all(b",")?;
                }
                if let Some(level) = self.levels.last_mut() {
                    level.tall = true;
                }
                self.new_line(writer)?;
                writer.write_all(b"\"")
            }
            None => writer.write_all(b"\""),
        }
    }

    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, _: &mut W, first: bool) -> io::Result<()> {
        self.before = Some(first);
        Ok(())
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        if !first {
            writer.write_all(b",")?;
        }
        if let Some(level) = self.levels.last_mut() {
            level.tall = true;
        }
        self.new_line(writer)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        // The key has no line break in it; its width does not matter for wrapping.
        writer.write_all(b": ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_matrix_has_a_row_a_line() {
        let text = to_json(&json!({"A": [[1.0, 0.5], [0.0, 1e-9]], "names": ["a", "b"]})).unwrap();
        assert_eq!(
            text,
            "{\n  \"A\": [\n    [1.0, 0.5],\n    [0.0, 1e-9]\n  ],\n  \"names\": [\n    \"a\",\n    \"b\"\n  ]\n}\n"
        );
    }

    #[test]
    fn long_lists_are_wrapped_and_read_back() {
        let numbers: Vec<f64> = (0..300).map(|k| (f64::from(k) * 0.7).sin()).collect();
        let text = to_json(&numbers).unwrap();
        assert!(text.lines().count() > 10);
        assert!(text.lines().all(|line| line.len() <= LINE_WIDTH));
        assert_eq!(serde_json::from_str::<Vec<f64>>(&text).unwrap(), numbers);
    }

    #[test]
    fn empty_ones_stay_on_their_line() {
        let text =
            to_json(&json!({"list": [], "map": {}, "nothing": null, "rows": [[], []]})).unwrap();
        assert!(text.contains("\"list\": [],\n"));
        assert!(text.contains("\"map\": {},\n"));
        assert!(text.contains("\"rows\": [\n    [],\n    []\n  ]"));
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["nothing"], serde_json::Value::Null);
    }
}
