//! The map over the equations, as a table whose cells are shaded.

use serde::Serialize;

use super::typeset_number::percent;
use crate::explain::EquationMap;

/// Rows and columns that are shown: those with the strongest tests.
const ROWS: usize = 10;
const COLUMNS: usize = 8;
/// Shades between nothing and the strongest cell.
const SHADES: f64 = 5.0;

/// The map as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct MapView {
    columns: Vec<String>,
    rows: Vec<(String, Vec<Cell>)>,
    significant: String,
}

/// How much the best term of a variable at a place would take off.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Cell {
    text: String,
    /// 0 to [`SHADES`]; 0 is not significant.
    shade: u8,
}

/// The strongest rows and columns; none where nothing was tested.
pub(super) fn equation_map(of: &EquationMap) -> Option<MapView> {
    let at = |row: usize, column: usize| {
        let share = of.share.get(row)?.get(column).copied().flatten()?;
        share.is_finite().then_some(share)
    };
    let (places, variables) = (of.places.len(), of.variables.len());
    let row_best = |row: usize| {
        (0..variables)
            .filter_map(|c| at(row, c))
            .fold(0.0, f64::max)
    };
    let column_best = |column: usize| {
        (0..places)
            .filter_map(|r| at(r, column))
            .fold(0.0, f64::max)
    };
    let mut rows = strongest(places, ROWS, row_best);
    let shaded = rows
        .iter()
        .filter(|&&r| row_best(r) > of.significant)
        .count();
    rows.truncate(shaded.max(1));
    let columns = strongest(variables, COLUMNS, column_best);
    let most = rows.iter().map(|&r| row_best(r)).fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let cell = |share: Option<f64>| match share {
        None => Cell {
            text: String::new(),
            shade: 0,
        },
        Some(share) => Cell {
            text: percent(share, 1),
            shade: match share > of.significant {
                true => (SHADES * share / most).ceil() as u8,
                false => 0,
            },
        },
    };
    Some(MapView {
        columns: columns.iter().map(|&c| of.variables[c].clone()).collect(),
        rows: rows
            .iter()
            .map(|&r| {
                let cells = columns.iter().map(|&c| cell(at(r, c)));
                (of.places[r].clone(), cells.collect())
            })
            .collect(),
        significant: percent(of.significant, 1),
    })
}

/// The indices with the largest values, largest first.
fn strongest(count: usize, most: usize, value: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut all: Vec<usize> = (0..count).collect();
    all.sort_by(|&a, &b| value(b).total_cmp(&value(a)));
    all.truncate(most);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strongest_places_and_variables_come_first_and_chance_has_no_shade() {
        let map = EquationMap {
            places: vec!["equation of x".to_owned(), "equation of v".to_owned()],
            variables: vec!["u".to_owned(), "v".to_owned(), "time".to_owned()],
            share: vec![
                vec![Some(0.001), None, Some(0.04)],
                vec![Some(0.05), Some(0.5), None],
            ],
            significant: 0.01,
        };
        let view = equation_map(&map).unwrap();
        assert_eq!(view.columns, ["v", "u", "time"]);
        assert_eq!(view.rows[0].0, "equation of v");
        let shades = |row: usize| view.rows[row].1.iter().map(|c| c.shade).collect::<Vec<_>>();
        assert_eq!(shades(0), [5, 1, 0]);
        assert_eq!(shades(1), [0, 0, 1]);
        assert_eq!(view.rows[1].1[0].text, "");
        assert_eq!(view.rows[0].1[0].text, "50.0 %");
        assert_eq!(equation_map(&EquationMap::default()), None);
    }
}
