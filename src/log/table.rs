//! A table in memory, such as a data frame of another language: which of its columns is what.

use super::channel::Channel;
use super::error::LogError;
use super::header::Header;
use super::reader::time_base;
use super::roles::{Assigned, RoleNeed, Roles, assign};

/// Columns of a table by role, found by the same rules as those of a file.
#[derive(Debug)]
pub struct TableRoles {
    header: Header,
    assigned: Assigned,
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
        let header = Header {
            name: name.to_owned(),
            channels: headers.iter().map(|h| Channel::parse(h)).collect(),
            raw: headers.to_vec(),
            separator: b',',
            headerless: false,
            line: 0,
        };
        let assigned = assign(roles, need, &header)?;
        Ok(Self { header, assigned })
    }

    /// Indices of the input columns, from 0.
    pub fn inputs(&self) -> &[usize] {
        &self.assigned.inputs
    }

    /// Indices of the output columns, from 0.
    pub fn outputs(&self) -> &[usize] {
        &self.assigned.outputs
    }

    /// Index of the time column, from 0, if there is one.
    pub fn time(&self) -> Option<usize> {
        self.assigned.time
    }

    /// Sample time and time of the first sample in seconds, from the time stamps in the unit of their column. Rows
    /// are numbered from 1 in messages.
    ///
    /// # Errors
    /// [`LogError`] when there is no time column, its unit is not known, or the stamps are not uniform.
    pub fn time_base(&self, stamps: &[f64]) -> Result<(f64, f64), LogError> {
        let Some(index) = self.assigned.time else {
            return Err(LogError::NoTime {
                name: self.header.name.clone(),
                headers: self.header.list(),
            });
        };
        let mut sampling = time_base(&self.header, index, 1)?;
        sampling.push(&self.header, stamps)?;
        sampling.finish(&self.header)
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
        assert_eq!((found.inputs(), found.outputs()), (&[1][..], &[2][..]));
        assert_eq!(found.time(), Some(0));
        assert_eq!(found.time_base(&[5.0, 7.0, 9.0]).unwrap(), (0.002, 0.005));
        let error = found.time_base(&[5.0, 7.0, 9.0, 15.0]).unwrap_err();
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
