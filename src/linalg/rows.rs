//! A matrix in a document: an array of rows; a plain number stands for a 1 x 1 matrix.

use std::borrow::Cow;
use std::fmt;

use nalgebra::DMatrix;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{self, Deserialize, Deserializer, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeSeq, Serializer};

/// A matrix as an array of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows(pub DMatrix<f64>);

impl Rows {
    /// The matrix; one without any entry takes the shape that is expected of it, because `[]` does not say
    /// how many columns it has.
    pub(crate) fn shaped(self, rows: usize, columns: usize) -> DMatrix<f64> {
        if self.0.is_empty() && rows * columns == 0 {
            DMatrix::zeros(rows, columns)
        } else {
            self.0
        }
    }
}

impl From<&DMatrix<f64>> for Rows {
    fn from(matrix: &DMatrix<f64>) -> Self {
        Self(matrix.clone())
    }
}

impl Serialize for Rows {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.0.nrows()))?;
        for row in self.0.row_iter() {
            rows.serialize_element(&row.iter().collect::<Vec<_>>())?;
        }
        rows.end()
    }
}

impl JsonSchema for Rows {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Rows".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Vec::<Vec<f64>>::json_schema(generator)
    }
}

/// One row, for its error messages.
struct Row(Vec<f64>);

impl<'de> Deserialize<'de> for Row {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct RowVisitor;
        impl<'de> Visitor<'de> for RowVisitor {
            type Value = Row;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a row, that is an array of numbers (a matrix is an array of rows)")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Row, A::Error> {
                let mut row = Vec::new();
                while let Some(Number(value)) = seq.next_element()? {
                    row.push(value);
                }
                Ok(Row(row))
            }
        }
        deserializer.deserialize_any(RowVisitor)
    }
}

/// One entry, for its error messages.
struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = Number;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a finite number")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Number, E> {
                Ok(Number(value))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }
        }
        deserializer.deserialize_any(NumberVisitor)
    }
}

impl<'de> Deserialize<'de> for Rows {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct MatrixVisitor;
        impl<'de> Visitor<'de> for MatrixVisitor {
            type Value = Rows;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a matrix as an array of rows, such as [[1, 2], [3, 4]]")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Rows, E> {
                Ok(Rows(DMatrix::from_element(1, 1, value)))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Rows, E> {
                self.visit_f64(value as f64)
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Rows, E> {
                self.visit_f64(value as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Rows, A::Error> {
                let mut rows: Vec<Vec<f64>> = Vec::new();
                while let Some(Row(row)) = seq.next_element()? {
                    let (expected, found) = (rows.first().map_or(row.len(), Vec::len), row.len());
                    rows.push(row);
                    if expected != found {
                        return Err(de::Error::custom(format_args!(
                            "row {} of the matrix has {found} entries, but the first has {expected}",
                            rows.len()
                        )));
                    }
                }
                let columns = rows.first().map_or(0, Vec::len);
                Ok(Rows(DMatrix::from_fn(rows.len(), columns, |i, j| {
                    rows[i][j]
                })))
            }
        }
        deserializer.deserialize_any(MatrixVisitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn error(text: &str) -> String {
        serde_json::from_str::<Rows>(text).unwrap_err().to_string()
    }

    #[test]
    fn read_and_written_by_rows() {
        let rows: Rows = serde_json::from_str("[[1, 2.5], [3, -4]]").unwrap();
        assert_eq!(rows.0, dmatrix![1.0, 2.5; 3.0, -4.0]);
        assert_eq!(
            serde_json::to_string(&rows).unwrap(),
            "[[1.0,2.5],[3.0,-4.0]]"
        );
        let scalar: Rows = serde_json::from_str("7").unwrap();
        assert_eq!(scalar.0, dmatrix![7.0]);
    }

    #[test]
    fn what_is_no_matrix_is_explained() {
        assert!(error("[1, 2]").contains("expected a row, that is an array of numbers"));
        assert!(error("[[1, null]]").contains("invalid type: null, expected a finite number"));
        assert!(error("[[1, 2], [3]]").contains("row 2 of the matrix has 1 entries"));
        assert!(error("\"A\"").contains("expected a matrix as an array of rows"));
    }

    #[test]
    fn nothing_takes_any_shape_without_entries() {
        let rows: Rows = serde_json::from_str("[]").unwrap();
        assert_eq!(rows.clone().shaped(0, 3).shape(), (0, 3));
        assert_eq!(rows.shaped(2, 2).shape(), (0, 0));
    }
}
