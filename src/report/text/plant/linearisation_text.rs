//! A plant linearised at an operating point, for people.

use crate::covariance::ResponsePoint;
use crate::log::Channel;
use crate::physics::{Plant, VariableId};
use crate::report::text::model::{
    continuous_pole_table, gain_table, pole_table, responses, shortened,
};
use crate::report::text::number::{significant, with_std};
use crate::report::text::table::Table;
use crate::report::text::{Style, wrapped};
use crate::report::{IdentifiedDocument, LinearisationDocument, OperatingValue};

/// Operating point, poles, static gains and frequency responses, and beside them the linear model of the same recording.
pub(crate) fn linearisation_text(
    document: &LinearisationDocument,
    plant: &Plant,
    every_frequency: bool,
    style: Style,
) -> String {
    let values = |of: &[OperatingValue]| -> Vec<String> {
        of.iter()
            .map(|v| {
                let unit = v.unit.as_ref().map_or(String::new(), |u| format!(" {u}"));
                format!(
                    "{} = {}{unit}",
                    v.name,
                    with_std(Some(v.value), v.std, style)
                )
            })
            .collect()
    };
    let at = [values(&document.states), values(&document.inputs)].concat();
    let mut out = wrapped(
        "\n",
        &format!(
            "Linearised at {}: {}",
            document.operating_point,
            at.join(", ")
        ),
    );
    let poles = continuous_pole_table(&document.poles, style);
    if !poles.is_empty() {
        out += &format!("\nPoles (continuous time)\n{}", poles.lines());
    }
    if let Some(identified) = &document.identified {
        let poles = pole_table(&identified.poles, usize::MAX, style);
        out += &format!(
            "\nPoles of the linear model of order {} that `innovant identify` finds in the recording\n{}",
            identified.order,
            poles.lines()
        );
    }
    let channels = |of: Vec<VariableId>| -> Vec<Channel> {
        of.into_iter()
            .map(|v| Channel {
                name: plant.spec.variable(v).name.clone(),
                unit: plant.spec.variable(v).unit_text.clone(),
            })
            .collect()
    };
    let gains = gain_table(
        &document.static_gain,
        usize::MAX,
        &channels(plant.spec.inputs()),
        &channels(plant.spec.outputs()),
        style,
    );
    if !gains.is_empty() {
        out += &format!("\nStatic gains\n{}", gains.lines());
    }
    match &document.identified {
        Some(identified) => out += &compared(identified),
        None => out += &responses(&document.frequency_response, every_frequency),
    }
    out
}

/// Magnitudes of the plant and of the linear model.
fn compared(of: &IdentifiedDocument) -> String {
    let mut table = Table::new([
        "from",
        "to",
        "rad/s",
        "magnitude",
        "95 % band",
        "linear model",
        "95 % band",
    ])
    .flush_left(1);
    let band = |p: &ResponsePoint| {
        p.magnitude_95.map_or("-".to_owned(), |[low, high]| {
            format!("{} .. {}", significant(low, 4), significant(high, 4))
        })
    };
    let magnitude = |p: &ResponsePoint| p.magnitude.map_or("-".to_owned(), |m| significant(m, 4));
    let mut pairs: Vec<_> = of
        .plant_response
        .iter()
        .zip(&of.frequency_response)
        .collect();
    pairs.sort_by(|(a, _), (b, _)| (&a.input, &a.output).cmp(&(&b.input, &b.output)));
    for (plant, model) in pairs {
        table.row([
            shortened(&plant.input),
            shortened(&plant.output),
            significant(plant.rad_s, 4),
            magnitude(plant),
            band(plant),
            magnitude(model),
            band(model),
        ]);
    }
    format!(
        "\nMagnitude of the plant, sampled with its inputs held, and of the linear model\n{}",
        table.lines()
    )
}
