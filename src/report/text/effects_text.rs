//! The libraries of effects, for the terminal.

use std::fmt::Write as _;

use super::wrapped;
use crate::explain::effects::{Definition, Mimic, library};
use crate::explain::{PlantEffect, plant_effect, plant_effects};
use crate::physics::nearest;

/// An id that no library has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no effect called {id}{}; `innovant effects` lists them",
    .nearest.as_ref().map(|n| format!(", did you mean {n}?")).unwrap_or_default()
)]
#[allow(missing_docs, reason = "the message explains the fields")]
pub(crate) struct UnknownId {
    pub(crate) id: String,
    pub(crate) nearest: Option<String>,
}

/// All effects, or one of them in full.
///
/// # Errors
/// When there is no effect of this id.
pub(crate) fn effects_text(id: Option<&str>) -> Result<String, UnknownId> {
    let Some(id) = id else {
        return Ok(list());
    };
    let of_plants = plant_effect(id);
    let others: Vec<&Definition> = library().filter(|d| d.id == id).collect();
    if of_plants.is_none() && others.is_empty() {
        let ids = plant_effects().map(|e| e.id).chain(library().map(|d| d.id));
        return Err(UnknownId {
            id: id.to_owned(),
            nearest: nearest(id, ids),
        });
    }
    let mut text = String::new();
    if let Some(effect) = of_plants {
        of_plant(&mut text, effect);
    }
    if !others.is_empty() {
        if !text.is_empty() {
            text.push('\n');
        }
        of_models(&mut text, &others);
    }
    Ok(text)
}

fn list() -> String {
    let mut text = String::from("Plants in equations (explain --simulation plant.mo)\n");
    let width = plant_effects()
        .map(|e| e.id.len())
        .chain(library().map(|d| d.id.len()))
        .max()
        .unwrap_or(0);
    for effect in plant_effects() {
        let _ = writeln!(text, "  {:width$}  {}", effect.id, effect.title);
    }
    text.push_str(
        "\nLinear models and columns of outputs (explain --simulation model.json or outputs.csv)\n",
    );
    let mut last = "";
    for definition in library().filter(|d| std::mem::replace(&mut last, d.id) != d.id) {
        let _ = writeln!(
            text,
            "  {:width$}  {}",
            definition.id,
            title(definition.name)
        );
    }
    text
}

fn of_plant(text: &mut String, effect: &PlantEffect) {
    let _ = writeln!(text, "{}: {}", effect.id, effect.title);
    text.push_str("In plants in equations\n");
    for (what, says) in [
        ("equation", effect.equation),
        ("enters", effect.enters),
        ("function of", effect.depends),
    ] {
        line(text, what, says);
    }
    for i in effect.imitations {
        line(
            text,
            "imitated by",
            &format!("{}: {}", i.effect, i.experiment),
        );
    }
}

fn of_models(text: &mut String, definitions: &[&Definition]) {
    if let Some(first) = definitions.first() {
        let _ = writeln!(text, "{}: {}", first.id, title(first.name));
    }
    text.push_str("With linear models and columns of outputs\n");
    for definition in definitions {
        let what = match definition.variant {
            "" => "equation".to_owned(),
            variant => format!("{variant}:"),
        };
        line(text, &what, definition.equation);
    }
    let mut said: Vec<&Mimic> = Vec::new();
    for mimic in definitions.iter().flat_map(|d| d.mimics) {
        if !said.iter().any(|m| m.effect == mimic.effect) {
            line(
                text,
                "imitated by",
                &format!("{}: {}", mimic.effect, mimic.experiment),
            );
            said.push(mimic);
        }
    }
}

fn line(text: &mut String, what: &str, says: &str) {
    text.push_str(&wrapped(&format!("  {what:<11} "), says));
}

/// The name of an effect without the comma after which a sentence goes on.
fn title(name: &str) -> &str {
    name.trim_end_matches(',')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_listed_and_described() {
        let all = effects_text(None).unwrap();
        let ids = plant_effects().map(|e| e.id).chain(library().map(|d| d.id));
        for id in ids {
            assert!(all.contains(&format!("  {id} ")), "{id}");
            let one = effects_text(Some(id)).unwrap();
            assert!(one.starts_with(&format!("{id}: ")), "{one}");
            assert!(one.lines().count() > 2, "{one}");
        }
    }

    #[test]
    fn an_unknown_id_gives_the_nearest() {
        let said = effects_text(Some("quadratic_drg")).unwrap_err().to_string();
        assert!(said.contains("did you mean quadratic_drag?"), "{said}");
    }
}
