//! Which column is what: the flags that every command which reads a log has.

use clap::{Args, ValueEnum};

use super::numbers;
use crate::cli::Verbosity;
use crate::cli::terminal::note;
use crate::identify::IdentifiedChannel;
use crate::log::{Channel, Missing, Roles, TimeUnit};

/// Columns and time base.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Columns")]
pub(crate) struct RoleFlags {
    /// Input columns, comma-separated; `none` if the simulated columns of `explain` have none [default: headers that start with u]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    inputs: Option<Vec<String>>,
    /// Output columns, comma-separated [default: headers that start with y]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    outputs: Option<Vec<String>>,
    /// Time column: numbers, dates or times of day; `none` if there is none [default: t, time, timestamp, seconds; an index without a name]
    #[arg(long, value_name = "NAME")]
    time: Option<String>,
    /// Sample time in seconds; it must agree with the time column, if there is one
    #[arg(long, value_name = "SECONDS", value_parser = numbers::seconds, allow_negative_numbers = true)]
    dt: Option<f64>,
    /// What to do with missing samples (rows or cells) [default: interpolate up to two in a row, split the recording at longer
    /// gaps; a plant in equations is compared with the outputs that are there]
    #[arg(long, value_enum, value_name = "HOW")]
    missing: Option<MissingFlag>,
    /// Resample to a uniform grid with this step, without aliasing: for jitter and other rates
    #[arg(long, value_name = "SECONDS", value_parser = numbers::seconds, allow_negative_numbers = true)]
    resample: Option<f64>,
    /// Unit of the time column; overrides the header: s, ms, us, ns, min, h or d
    #[arg(long, value_name = "UNIT", value_parser = time_unit)]
    time_unit: Option<TimeUnit>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MissingFlag {
    /// Stop with an error that says where
    Error,
    /// Split the recording at every gap
    Split,
    /// Interpolate every gap
    Interpolate,
}

fn time_unit(text: &str) -> Result<TimeUnit, String> {
    TimeUnit::parse(text).ok_or_else(|| "it is one of s, ms, us, ns, min, h and d".to_owned())
}

/// Says on standard error what was recognised in a file, unless it is plain.
pub(crate) fn tell_reading(name: &str, said: Option<&str>, say: Verbosity) {
    if let Some(said) = said.filter(|_| !say.quiet) {
        note(&format!("{name}: {said}\n"));
    }
}

impl RoleFlags {
    /// Whether inputs or outputs are named.
    pub(crate) fn names_columns(&self) -> bool {
        self.inputs.is_some() || self.outputs.is_some()
    }

    /// The same with gaps bridged, where nothing else is asked for.
    pub(crate) fn bridged(&self) -> Option<Self> {
        self.missing.is_none().then(|| Self {
            missing: Some(MissingFlag::Interpolate),
            ..self.clone()
        })
    }

    /// The roles as asked for.
    pub(crate) fn roles(self) -> Roles {
        Roles {
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            ..self.rows()
        }
    }

    /// How the rows are read, whatever the columns are.
    fn rows(&self) -> Roles {
        Roles {
            time: self.time.clone(),
            sample_time: self.dt,
            missing: match self.missing {
                None => Missing::Auto,
                Some(MissingFlag::Error) => Missing::Error,
                Some(MissingFlag::Split) => Missing::Split,
                Some(MissingFlag::Interpolate) => Missing::Interpolate,
            },
            resample: self.resample,
            time_unit: self.time_unit,
            ..Roles::default()
        }
    }

    /// The roles that a model asks for by the names of its channels; flags replace them one to one.
    pub(crate) fn of_model(
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
                // `none`, of a model that has none.
                Some(names) if of.is_empty() && names == ["none"] => Ok(None),
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
        let rows = self.rows();
        Ok(Roles {
            inputs: replaced("inputs", self.inputs, inputs)?.or(named.inputs),
            outputs: replaced("outputs", self.outputs, outputs)?.or(named.outputs),
            ..rows
        })
    }
}
