//! How well a model fits its recordings.

use super::roots::shortened;
use crate::report::text::number::{percent, significant};
use crate::report::text::table::Table;
use crate::report::text::wrapped;
use crate::validate::{FitMeasure, Validation};

/// Fit of each output.
pub(crate) fn fit(tests: &Validation) -> String {
    let mut out = format!("\nFit\n{}", fit_table(tests).lines());
    if let Some(reason) = &tests.free_run_unavailable {
        out.push_str(&wrapped("  no free run: ", reason));
    }
    out
}

/// The same as a table.
pub(crate) fn fit_table(tests: &Validation) -> Table {
    fit_measures(&tests.one_step, tests.free_run.as_ref())
}

/// Fits one step ahead and in free run.
pub(crate) fn fit_measures(one_step: &FitMeasure, free_run: Option<&FitMeasure>) -> Table {
    let mut table = Table::new([
        "output",
        "one step ahead",
        "rms error",
        "free run",
        "rms error",
    ]);
    for (index, one) in one_step.outputs.iter().enumerate() {
        let free = free_run.and_then(|f| f.outputs.get(index));
        table.row([
            shortened(&one.output),
            percent(one.fit_percent),
            significant(one.rms_error, 4),
            free.map_or("-".to_owned(), |f| percent(f.fit_percent)),
            free.map_or("-".to_owned(), |f| significant(f.rms_error, 4)),
        ]);
    }
    table
}
