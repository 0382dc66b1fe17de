//! Pictures and tables as numbers: what is drawn on the page is what stands in the JSON and the CSV.

use schemars::JsonSchema;
use serde::Serialize;

/// Panels that belong together and share their horizontal axis.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Figure {
    /// Unique within the document.
    pub(crate) id: String,
    /// Heading.
    pub(crate) title: String,
    /// What there is to see.
    pub(crate) caption: String,
    /// Name of the horizontal axis.
    pub(crate) x: Quantity,
    /// Name of the vertical axis.
    pub(crate) y: Quantity,
    /// Places on the horizontal axis.
    pub(crate) at: Vec<f64>,
    /// One picture each.
    pub(crate) panels: Vec<Panel>,
}

/// What an axis shows.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Quantity {
    /// Name.
    pub(crate) label: String,
    /// Unit; empty for none.
    pub(crate) unit: String,
    /// Whether it is drawn on a logarithmic scale.
    pub(crate) logarithmic: bool,
}

/// One picture.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Panel {
    /// Heading.
    pub(crate) title: String,
    /// What is drawn in it, from back to front.
    pub(crate) curves: Vec<Curve>,
}

/// A line, or a bundle of lines of one kind, with a band around the first where there is one.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Curve {
    /// Name.
    pub(crate) name: String,
    /// What kind of line it is.
    pub(crate) role: Role,
    /// Values at the places of the figure, a list for each line; null where there is none.
    pub(crate) lines: Vec<Vec<Option<f64>>>,
    /// Lower and upper limit at the places of the figure.
    pub(crate) band: Option<[Vec<Option<f64>>; 2]>,
}

/// What kind of line a curve is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Role {
    /// The truth.
    Truth,
    /// Single Monte Carlo runs.
    Runs,
    /// An estimate, or the first of several methods.
    First,
    /// The second method.
    Second,
    /// The third method.
    Third,
}

/// Bars in groups, as in Knudsen's figures.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Bars {
    /// Unique within the document.
    pub(crate) id: String,
    /// Heading.
    pub(crate) title: String,
    /// What there is to see.
    pub(crate) caption: String,
    /// What the length of a bar is.
    pub(crate) quantity: String,
    /// A line across at this value.
    pub(crate) reference: f64,
    /// Bars longer than this are cut, and carry their value.
    pub(crate) cut: f64,
    /// One group of bars each.
    pub(crate) groups: Vec<String>,
    /// A bar in every group.
    pub(crate) series: Vec<BarSeries>,
}

/// The bars of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct BarSeries {
    /// Name.
    pub(crate) name: String,
    /// A value for each group; null where there is none.
    pub(crate) values: Vec<Option<f64>>,
}

/// A table of numbers.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Table {
    /// Unique within the document.
    pub(crate) id: String,
    /// What it shows.
    pub(crate) title: String,
    /// What to know when reading it.
    pub(crate) caption: String,
    /// Heading of the names of the rows.
    pub(crate) rows_are: String,
    /// Headings of the numbers.
    pub(crate) columns: Vec<String>,
    /// Rows.
    pub(crate) rows: Vec<Row>,
    /// Significant digits for people.
    pub(crate) digits: usize,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Row {
    /// Name.
    pub(crate) name: String,
    /// Numbers; null where there is none.
    pub(crate) values: Vec<Option<f64>>,
    /// Whether the paper prints this row.
    pub(crate) printed: bool,
}

/// A number, or nothing where it is not finite.
pub(super) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Numbers, with nothing where one is not finite.
pub(super) fn all_finite(values: impl IntoIterator<Item = f64>) -> Vec<Option<f64>> {
    values.into_iter().map(finite).collect()
}

impl Quantity {
    /// Angular frequency on a logarithmic scale.
    pub(super) fn frequency() -> Self {
        Self {
            label: "frequency".to_owned(),
            unit: "rad/sample".to_owned(),
            logarithmic: true,
        }
    }

    /// Magnitude in decibels.
    pub(super) fn magnitude() -> Self {
        Self {
            label: "magnitude".to_owned(),
            unit: "dB".to_owned(),
            logarithmic: false,
        }
    }
}

impl Curve {
    /// One line.
    pub(super) fn line(name: &str, role: Role, values: impl IntoIterator<Item = f64>) -> Self {
        Self {
            name: name.to_owned(),
            role,
            lines: vec![all_finite(values)],
            band: None,
        }
    }

    /// One line with a band around it.
    pub(super) fn banded(
        name: &str,
        role: Role,
        values: impl IntoIterator<Item = f64>,
        lower: impl IntoIterator<Item = f64>,
        upper: impl IntoIterator<Item = f64>,
    ) -> Self {
        Self {
            band: Some([all_finite(lower), all_finite(upper)]),
            ..Self::line(name, role, values)
        }
    }

    /// Many lines of one kind.
    pub(super) fn bundle(name: &str, role: Role, lines: Vec<Vec<f64>>) -> Self {
        Self {
            name: name.to_owned(),
            role,
            lines: lines.into_iter().map(all_finite).collect(),
            band: None,
        }
    }
}

impl Row {
    /// A row of what is found here.
    pub(super) fn found(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        Self {
            name: name.to_owned(),
            values: all_finite(values),
            printed: false,
        }
    }

    /// A row as the paper prints it.
    pub(super) fn printed(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        Self {
            printed: true,
            ..Self::found(name, values)
        }
    }
}
