//! Which column is what: the flags that every command which reads a log has.

use clap::Args;

use super::numbers;
use crate::identify::IdentifiedChannel;
use crate::log::{Channel, Roles};

/// Columns and time base.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Columns")]
pub(super) struct RoleFlags {
    /// Input columns, comma-separated [default: headers that start with u]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    inputs: Option<Vec<String>>,
    /// Output columns, comma-separated [default: headers that start with y]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    outputs: Option<Vec<String>>,
    /// Time column [default: t or time]
    #[arg(long, value_name = "NAME")]
    time: Option<String>,
    /// Sample time in seconds; the time column is then not read
    #[arg(long, value_name = "SECONDS", value_parser = numbers::seconds, allow_negative_numbers = true)]
    dt: Option<f64>,
}

impl RoleFlags {
    /// The roles as asked for.
    pub(super) fn roles(self) -> Roles {
        Roles {
            inputs: self.inputs,
            outputs: self.outputs,
            time: self.time,
            sample_time: self.dt,
            ..Roles::default()
        }
    }

    /// The roles that a model asks for by the names of its channels; flags replace them one to one.
    pub(super) fn of_model(
        self,
        inputs: &[IdentifiedChannel],
        outputs: &[IdentifiedChannel],
    ) -> anyhow::Result<Roles> {
        let channels = |of: &[IdentifiedChannel]| -> Vec<Channel> {
            of.iter().map(|c| c.channel.clone()).collect()
        };
        let named = Roles::named(&channels(inputs), &channels(outputs));
        let replaced = |flag: &str,
                        asked: Option<Vec<String>>,
                        of: &[IdentifiedChannel]|
         -> anyhow::Result<Option<Vec<String>>> {
            match asked {
                Some(names) if names.len() != of.len() => {
                    let wanted: Vec<String> = of.iter().map(|c| c.channel.to_string()).collect();
                    anyhow::bail!(
                        "--{flag} names {} columns, but the model has {}: {}; name one for each, in this order",
                        names.len(),
                        of.len(),
                        wanted.join(", ")
                    )
                }
                asked => Ok(asked),
            }
        };
        Ok(Roles {
            inputs: replaced("inputs", self.inputs, inputs)?.or(named.inputs),
            outputs: replaced("outputs", self.outputs, outputs)?.or(named.outputs),
            time: self.time,
            sample_time: self.dt,
            ..Roles::default()
        })
    }
}
