//! The judgement of a model on a recording.

use super::fit_text::fit;
use super::roots::shortened;
use crate::report::text::number::{percent, probability, significant};
use crate::report::text::table::Table;
use crate::report::text::{count, wrapped};
use crate::validate::{Relation, ResidualTest, TooShort, Validation};

/// Verdict, fit, tests and findings.
pub fn validation_text(tests: &Validation) -> String {
    let verdict = headline(&Headline {
        what: "Model",
        relation: tests.relation,
        samples: tests.samples,
        level: tests.level,
        rejected: tests.rejected,
        too_short: tests.too_short.as_ref(),
        accepted: in_words(tests),
    });
    let mut out = wrapped("", &verdict);
    out.push_str(&fit(tests));
    out.push_str(&residual_tests(tests));
    out.push_str(&sizes(tests));
    for (index, sentence) in findings(tests).iter().enumerate() {
        if index == 0 {
            out.push('\n');
        }
        out.push_str(&wrapped("finding: ", sentence));
    }
    out
}

/// What a verdict says.
pub(crate) struct Headline<'a> {
    pub(crate) what: &'static str,
    pub(crate) relation: Relation,
    pub(crate) samples: usize,
    pub(crate) level: f64,
    pub(crate) rejected: bool,
    pub(crate) too_short: Option<&'a TooShort>,
    /// What an acceptance rests on.
    pub(crate) accepted: &'a str,
}

/// The first sentence.
pub(crate) fn headline(of: &Headline) -> String {
    let data = match of.relation {
        Relation::Estimation => "the recording it was estimated from",
        Relation::Fresh => "a recording it has not seen",
    };
    let (what, samples) = (of.what, of.samples);
    if of.rejected {
        format!(
            "{what} rejected on {data} ({samples} samples): a right {} is, in {} of cases",
            what.to_lowercase(),
            percent(100.0 * of.level)
        )
    } else if let Some(short) = of.too_short {
        format!("On {data}: {}", short.sentence())
    } else {
        format!(
            "{what} accepted on {data} ({samples} samples): {}",
            of.accepted
        )
    }
}

/// What an acceptance rests on.
pub(crate) fn in_words(tests: &Validation) -> &'static str {
    match (&tests.whiteness, &tests.linearity) {
        _ if tests.allowed_by_uncertainty().is_some() => {
            "its uncertain parameters allow the structure in the residuals"
        }
        (_, Some(_)) => "the residuals are white and show no nonlinearity",
        (Some(_), None) => "the residuals are white; linearity was not tested",
        (None, None) => "nothing speaks against it; linearity was not tested",
    }
}

/// The findings but those that the tables say already: that nothing was found, why there is no free run.
pub(crate) fn findings(tests: &Validation) -> Vec<String> {
    let said = [
        "the residuals are white",
        "no free run: ",
        "too short to judge: ",
        "linearity was ",
    ];
    let new = |finding: &&String| !said.iter().any(|said| finding.starts_with(said));
    tests.findings.iter().filter(new).cloned().collect()
}

fn residual_tests(tests: &Validation) -> String {
    let (table, strongest) = test_tables(tests);
    if table.is_empty() {
        return String::new();
    }
    format!(
        "\nTests of the residuals, {} (share: of their variance; * for information)\n{}{}\
         \nStrongest correlations\n{}",
        count(tests.lags, "lag"),
        table.lines(),
        linearity_tested(tests).map_or_else(String::new, |tested| wrapped("  ", tested)),
        strongest.lines()
    )
}

/// What the test of linearity looked at.
pub(crate) fn linearity_tested(tests: &Validation) -> Option<&str> {
    let said = |finding: &&String| finding.starts_with("linearity was ");
    tests.findings.iter().find(said).map(String::as_str)
}

/// The tests, and the correlation of each that stands out most.
pub(crate) fn test_tables(tests: &Validation) -> (Table, Table) {
    let mut table = Table::new(["explained by", "chi-square", "freedom", "p", "share"]);
    let mut strongest = Table::new([
        "explained by",
        "from",
        "to",
        "lag",
        "correlation",
        "99 % bound",
    ])
    .flush_left(1)
    .flush_left(2);
    let rows: [(&str, &Option<ResidualTest>); 5] = [
        ("past residuals", &tests.whiteness),
        ("past inputs", &tests.past_inputs),
        ("squares, products", &tests.linearity),
        ("same sample *", &tests.same_sample),
        ("feedback *", &tests.feedback),
    ];
    for (name, test) in rows {
        let Some(test) = test else { continue };
        table.row([
            name.to_owned(),
            format!("{:.1}", test.statistic),
            test.degrees_of_freedom.to_string(),
            probability(test.p_value),
            percent(100.0 * test.explained_share),
        ]);
        let Some(most) = &test.strongest else {
            continue;
        };
        strongest.row([
            name.to_owned(),
            shortened(&most.from),
            shortened(&most.to),
            most.lag.to_string(),
            format!("{:+.3}", most.correlation),
            format!("{:.3}", most.bound_99),
        ]);
    }
    (table, strongest)
}

fn sizes(tests: &Validation) -> String {
    let Some(size) = &tests.innovation_size else {
        return String::new();
    };
    let mut table = Table::new(["output", "stated", "found", "ratio", "expected", "p"]);
    for output in &size.outputs {
        table.row([
            shortened(&output.output),
            significant(output.stated_variance.sqrt(), 4),
            significant(output.residual_variance.sqrt(), 4),
            format!("{:.3}", output.ratio),
            format!("{:.3}", output.expected_ratio),
            probability(output.p_value),
        ]);
    }
    format!(
        "\nSize of the residuals (rms; ratio of variances)\n{}",
        table.lines()
    )
}
