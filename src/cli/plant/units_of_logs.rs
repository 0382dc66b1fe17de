//! Units of the columns of a recording beside those of a plant in equations.

use crate::identify::IdentifiedChannel;
use crate::log::{Channel, Log};
use crate::physics::{Comparison, ModelSpec, compare, rounded};

/// Inputs and outputs by name.
pub(crate) type Channels = (Vec<IdentifiedChannel>, Vec<IdentifiedChannel>);

/// Compares the units of columns with those of the plant's inputs and outputs, which are in the same order. Returns warnings, each once:
/// of temperatures with another zero, which linear equations may bear, of percents, and of units that are another quantity, which may
/// be misread.
///
/// # Errors
/// A column in another scale than the plant: km/h where the plant has m/s.
pub(crate) fn units_of_logs(
    spec: &ModelSpec,
    (inputs, outputs): &Channels,
    logs: &[Log],
) -> anyhow::Result<Vec<String>> {
    let mut said: Vec<String> = Vec::new();
    let mut seen: Vec<&Channel> = Vec::new();
    for log in logs {
        let columns = inputs.iter().zip(&log.inputs);
        for (of_plant, column) in columns.chain(outputs.iter().zip(&log.outputs)) {
            let name = &of_plant.channel.name;
            let variable = spec.variables.iter().find(|v| v.column() == name);
            let declared = variable.and_then(|v| v.unit_text.as_deref());
            let (Some(declared), Some(unit)) = (declared, column.unit.as_deref()) else {
                continue;
            };
            if seen.contains(&column) {
                continue;
            }
            seen.push(column);
            let file = log.name.split(" [part ").next().unwrap_or(&log.name);
            let begin = format!(
                "{file}: column `{}` is in {unit}, and `{name}` of the plant in {declared}",
                column.name
            );
            // A valve in percent may be meant by both.
            let pure = matches!(declared.trim(), "1" | "%" | "-");
            match compare(unit, declared) {
                Comparison::Alike => {}
                Comparison::Factor(factor) => {
                    let (what, remedy) = match factor < 1.0 {
                        true => (
                            format!("{} is {} {unit}", one(declared), rounded(1.0 / factor)),
                            format!("divide the column by {}", rounded(1.0 / factor)),
                        ),
                        false => (
                            format!("{} is {} {declared}", one(unit), rounded(factor)),
                            format!("multiply the column by {}", rounded(factor)),
                        ),
                    };
                    if pure {
                        said.push(format!(
                            "{begin}: {what}; {remedy} unless the equations do"
                        ));
                        continue;
                    }
                    anyhow::bail!(
                        "{begin}: {what}; {remedy} and write {declared} into its header, or write the plant in {unit}; if the \
                         header is wrong, take the unit out of it"
                    )
                }
                Comparison::Line(factor, offset) => anyhow::bail!(
                    "{begin}: multiply the column by {}, add {} and write {declared} into its header; if the header is wrong, take \
                     the unit out of it",
                    rounded(factor),
                    rounded(offset)
                ),
                Comparison::Offset(offset) => said.push(format!(
                    "{begin}: add {} to the column, unless the equations have only differences of temperatures",
                    rounded(offset)
                )),
                Comparison::Dimension => said.push(format!(
                    "{begin}, which is another quantity; correct one of the two"
                )),
            }
        }
    }
    Ok(said)
}

/// One of a unit.
fn one(unit: &str) -> String {
    match unit {
        "1" | "-" => "1".to_owned(),
        _ => format!("1 {unit}"),
    }
}
