//! What a reproduction delivers: the document that JSON, CSV, terminal and page are all written from.

use schemars::JsonSchema;
use serde::Serialize;

use super::figure::{Bars, Figure, Table};

/// Kind and version of the document.
pub(crate) const REPRODUCTION_FORMAT: &str = "innovant-reproduction/1";

/// One experiment of a paper, run again.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Reproduction {
    /// `innovant-reproduction/1`.
    pub(crate) format: String,
    /// Version of innovant that wrote it.
    pub(crate) version: String,
    /// Name of the experiment on the command line.
    pub(crate) experiment: String,
    /// What is reproduced.
    pub(crate) title: String,
    /// The paper.
    pub(crate) paper: String,
    /// Number of Monte Carlo runs.
    pub(crate) runs: usize,
    /// Number of runs that the paper used.
    pub(crate) paper_runs: usize,
    /// Seed that the runs are drawn from.
    pub(crate) seed: u64,
    /// The set-up, and which of it is the paper's.
    pub(crate) setup: Vec<Fact>,
    /// What the paper says, what is found here, and whether they agree.
    pub(crate) comparison: Vec<Comparison>,
    /// Line pictures.
    pub(crate) figures: Vec<Figure>,
    /// Bar charts.
    pub(crate) bars: Vec<Bars>,
    /// Tables of numbers.
    pub(crate) tables: Vec<Table>,
    /// What to know when reading the numbers.
    pub(crate) remarks: Vec<String>,
}

/// A line of the set-up.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Fact {
    /// What it is.
    pub(crate) name: String,
    /// Its value.
    pub(crate) value: String,
    /// Where it comes from.
    pub(crate) source: Origin,
}

/// Where a choice comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Origin {
    /// The paper prints it.
    Paper,
    /// Chosen here, because the paper is silent or in error.
    Ours,
}

/// What the paper says against what is found here.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(crate) struct Comparison {
    /// Where in the paper.
    pub(crate) place: String,
    /// What the paper says.
    pub(crate) paper: String,
    /// What is found here.
    pub(crate) here: String,
    /// Whether they agree.
    pub(crate) agreement: Agreement,
    /// Why not, or by which measure.
    pub(crate) why: String,
}

/// Whether paper and reproduction agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Agreement {
    /// Within the stated measure.
    Yes,
    /// Some of it.
    Partly,
    /// Outside the stated measure.
    No,
    /// What is printed cannot be right, and what is meant can be told.
    Misprint,
}

impl Agreement {
    /// Yes or no.
    pub(crate) fn of(agrees: bool) -> Self {
        if agrees { Self::Yes } else { Self::No }
    }

    /// Yes where all agree, no where none does, partly otherwise.
    pub(crate) fn of_all(each: impl IntoIterator<Item = bool>) -> Self {
        let (mut some, mut all) = (false, true);
        for agrees in each {
            some |= agrees;
            all &= agrees;
        }
        match (all, some) {
            (true, _) => Self::Yes,
            (false, true) => Self::Partly,
            (false, false) => Self::No,
        }
    }

    /// In a word or two.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::Partly => "partly",
            Self::No => "no",
            Self::Misprint => "error in print",
        }
    }
}

impl Fact {
    /// A choice of the paper.
    pub(super) fn paper(name: &str, value: impl Into<String>) -> Self {
        Self {
            name: name.to_owned(),
            value: value.into(),
            source: Origin::Paper,
        }
    }

    /// A choice of ours.
    pub(super) fn ours(name: &str, value: impl Into<String>) -> Self {
        Self {
            name: name.to_owned(),
            value: value.into(),
            source: Origin::Ours,
        }
    }
}

impl Comparison {
    /// A row of the comparison.
    pub(super) fn new(
        place: &str,
        paper: impl Into<String>,
        here: impl Into<String>,
        agreement: Agreement,
        why: impl Into<String>,
    ) -> Self {
        Self {
            place: place.to_owned(),
            paper: paper.into(),
            here: here.into(),
            agreement,
            why: why.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreement_of_many() {
        assert_eq!(Agreement::of_all([true, true]), Agreement::Yes);
        assert_eq!(Agreement::of_all([true, false]), Agreement::Partly);
        assert_eq!(Agreement::of_all([false, false]), Agreement::No);
    }
}
