//! Where in the equations physics is missing: for every place and every variable the strongest score test.

use super::screen::Lead;
use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::explanation::EquationMap;
use crate::physics::ModelSpec;

/// What functions of time alone stand under.
const TIME: &str = "time";

/// The map of the tests of a screen; `values` is how many values the residual has, `significant` the statistic that chance
/// reaches with the probability at which structure is called so.
pub(in crate::explain::engine) fn map(
    leads: &[Lead],
    spec: &ModelSpec,
    arguments: &[Argument],
    values: usize,
    significant: f64,
) -> EquationMap {
    let part = |statistic: f64| statistic / values.max(1) as f64;
    let mut map = EquationMap {
        significant: part(significant),
        ..EquationMap::default()
    };
    for lead in leads {
        let of = lead
            .argument
            .map_or(TIME, |a| arguments[a].expression.as_str());
        let row = position(&mut map.places, &label(lead.place, lead.sensor, spec));
        let column = position(&mut map.variables, of);
        map.share.resize(map.places.len(), vec![]);
        let row = &mut map.share[row];
        if row.len() <= column {
            row.resize(column + 1, None);
        }
        let strongest = row[column].unwrap_or(0.0).max(part(lead.statistic));
        row[column] = Some(strongest);
    }
    let columns = map.variables.len();
    map.share
        .iter_mut()
        .for_each(|row| row.resize(columns, None));
    map
}

/// Where a name stands in a list, at whose end it is put if it is new.
fn position(names: &mut Vec<String>, name: &str) -> usize {
    names.iter().position(|n| n == name).unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    })
}

fn label(place: Place, sensor: bool, spec: &ModelSpec) -> String {
    let name = &spec.variable(place.variable(spec)).name;
    match place {
        Place::Equation(_) if sensor => format!("sensor {name}"),
        Place::Equation(_) => format!("equation of {name}"),
        Place::Input(_) => format!("input {name}"),
        Place::Parameter(_) => format!("parameter {name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::terms::arguments_of_plant::arguments;
    use crate::explain::engine::terms::library::TERMS;
    use crate::physics::parse;

    #[test]
    fn a_cell_is_the_strongest_test_of_a_variable_at_a_place() {
        let spec = parse(
            "model M input Real u; output Real y; Real x;
             equation der(x) = u - x; y = x; end M;",
        )
        .unwrap();
        let arguments = arguments(&spec);
        let of_x = arguments.iter().position(|a| a.expression == "x");
        let lead = |id: &str, argument: Option<usize>, statistic: f64| {
            let term = TERMS.iter().find(|t| t.id == id).unwrap();
            let mut lead =
                Lead::untested(term, Place::Equation(0)).at(Place::Equation(0), argument, &[]);
            lead.statistic = statistic;
            lead
        };
        let leads = [
            lead("square", of_x, 8.0),
            lead("cube", of_x, 12.0),
            lead("load_ramp", None, 2.0),
        ];
        let map = map(&leads, &spec, &arguments, 100, 10.0);
        assert_eq!(map.places, ["equation of x"]);
        assert_eq!(map.variables, ["x", "time"]);
        assert_eq!(map.share, [[Some(0.12), Some(0.02)]]);
        assert_eq!(map.significant, 0.1);
    }
}
