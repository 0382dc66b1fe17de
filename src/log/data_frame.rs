//! A table in memory, such as a data frame of another language: which of its columns is what.

use super::log_error::LogError;
use super::roles::{RoleNeed, Roles, assign};
use super::text::{Channel, Header};
use super::time::time_base;

/// Columns of a table by role, found by the same rules as those of a file. Indices count from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableRoles {
    /// Input columns.
    pub inputs: Vec<usize>,
    /// Output columns.
    pub outputs: Vec<usize>,
    /// The time column, if there is one.
    pub time: Option<usize>,
}

impl TableRoles {
    /// Finds the columns that `roles` and `need` ask for among `headers`; `name` is what messages call the table.
    ///
    /// # Errors
    /// [`LogError`] when there is no such column, or no column with a role that is needed.
    pub fn find(
        name: &str,
        headers: &[String],
        roles: &Roles,
        need: RoleNeed,
    ) -> Result<Self, LogError> {
        let found = assign(roles, need, &header(name, headers))?;
        Ok(Self {
            inputs: found.inputs,
            outputs: found.outputs,
            time: found.time,
        })
    }
}

/// Sample time and time of the first sample in seconds, from the time stamps of a column called `column`, which may
/// carry their unit: `t [ms]`. Rows are numbered from 1 in messages.
///
/// # Errors
/// [`LogError`] when the unit is not known or the stamps are not uniform.
pub fn time_base_of(name: &str, column: &str, stamps: &[f64]) -> Result<(f64, f64), LogError> {
    let header = header(name, &[column.to_owned()]);
    let mut sampling = time_base(&header, 0, 1, None)?;
    sampling.push(&header, stamps)?;
    sampling.finish(&header)
}

fn header(name: &str, headers: &[String]) -> Header {
    Header {
        name: name.to_owned(),
        channels: headers.iter().map(|h| Channel::parse(h)).collect(),
        raw: headers.to_vec(),
        separator: b',',
        headerless: false,
        line: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_follows_the_rules_of_files() {
        let headers = ["time [ms]", "u", "y [m]", "temperature"].map(str::to_owned);
        let found =
            TableRoles::find("frame", &headers, &Roles::default(), RoleNeed::Identify).unwrap();
        assert_eq!((found.inputs, found.outputs), (vec![1], vec![2]));
        assert_eq!(found.time, Some(0));
        let base = |stamps: &[f64]| time_base_of("frame", &headers[0], stamps);
        assert_eq!(base(&[5.0, 7.0, 9.0]).unwrap(), (0.002, 0.005));
        let error = base(&[5.0, 7.0, 9.0, 15.0]).unwrap_err();
        assert!(error.to_string().contains("frame, line 4"), "{error}");
        let asked = Roles {
            outputs: Some(vec!["temprature".to_owned()]),
            ..Roles::default()
        };
        let error = TableRoles::find("frame", &headers, &asked, RoleNeed::Identify).unwrap_err();
        assert!(
            error.to_string().contains("did you mean `temperature`?"),
            "{error}"
        );
    }
}
