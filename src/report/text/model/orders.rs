//! What speaks for and against each order.

use crate::identify::{OrderEvidence, Summary};
use crate::report::text::number::{probability, significant};
use crate::report::text::table::Table;

/// Orders shown on either side of the choice.
const NEIGHBOURS: usize = 2;

/// The evidence around the chosen order, and on every order that was tested.
pub(super) fn order_evidence(summary: &Summary) -> String {
    titled("Order", &order_table(summary))
}

/// The same as a table; the chosen order has a star.
pub(crate) fn order_table(summary: &Summary) -> Table {
    let chosen = summary.order;
    let shown = |e: &&OrderEvidence| e.order.abs_diff(chosen) <= NEIGHBOURS || e.p_value.is_some();
    table(summary, summary.diagnostics.orders.iter().filter(shown))
}

/// The comparison of the orders that were asked for.
pub(crate) fn comparison(summary: &Summary, asked: &[usize]) -> String {
    let among = |e: &&OrderEvidence| asked.contains(&e.order);
    let evidence = summary.diagnostics.orders.iter();
    titled("Orders asked for", &table(summary, evidence.filter(among)))
}

fn titled(title: &str, table: &Table) -> String {
    if table.is_empty() {
        return String::new();
    }
    format!(
        "\n{title} (* chosen; small p speaks against an order, small criteria for it)\n{}",
        table.lines()
    )
}

fn table<'a>(summary: &Summary, evidence: impl Iterator<Item = &'a OrderEvidence>) -> Table {
    let mut table = Table::new([
        "order",
        "correlation",
        "criterion",
        "chi-square",
        "freedom",
        "p",
        "BIC",
        "spectral radius",
    ]);
    let number = |value: Option<f64>, digits: usize| {
        value.map_or("-".to_owned(), |value| significant(value, digits))
    };
    let mut sorted: Vec<&OrderEvidence> = evidence.collect();
    sorted.sort_by_key(|e| e.order);
    for e in sorted {
        let mark = if e.order == summary.order { " *" } else { "" };
        // An order beyond what the singular values reach has no criterion.
        let known = e.singular_value_criterion < f64::MAX;
        table.row([
            format!("{}{mark}", e.order),
            number(known.then_some(e.canonical_correlation), 3),
            number(known.then_some(e.singular_value_criterion), 3),
            e.chi_square.map_or("-".to_owned(), |c| format!("{c:.1}")),
            e.degrees_of_freedom
                .map_or("-".to_owned(), |d| d.to_string()),
            e.p_value.map_or("-".to_owned(), probability),
            e.schwarz.map_or("-".to_owned(), |s| format!("{s:.1}")),
            e.spectral_radius
                .map_or("-".to_owned(), |r| format!("{r:.4}")),
        ]);
    }
    table
}
