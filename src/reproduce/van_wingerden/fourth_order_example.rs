//! Example I: fourth order, two inputs, two outputs, in closed loop; the table as repaired, and the system that it
//! seems to be copied from.

use super::bode::{DRAWN, Outcome, Plan};
use super::estimation_run::Setting;
use super::measure::share_expected_of_others;
use super::sign::unexplained;
use super::{PAPER, REALISTIC, similar};
use crate::linalg::{LinalgError, spectral_radius};
use crate::reproduce::document::{Agreement, Comparison, Fact, Reproduction};
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::plain_numbers::{number, percent, percent_with_error};
use crate::reproduce::statistics::logarithmic_grid;
use crate::reproduce::{Experiment, ReproduceError, document_of};
use crate::systems::{TestSystem, pbsid_toolbox, van_wingerden_one};

/// Example I of van Wingerden.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VanWingerdenOne;

const SETTING: Setting = Setting {
    samples: 2000,
    past: 100,
    future: 100,
    order: 4,
};
/// Frequencies of the figure, from two decades below the Nyquist frequency.
const FREQUENCIES: usize = 121;
/// Every so many of them bounds are measured: neighbours say the same.
const MEASURED_EVERY: usize = 5;
/// Windows and length for the check of the sign: `|At^20|` is 1e-6 here, and a long record makes the terms of
/// second order small.
const SIGN_CHECK: Setting = Setting {
    samples: 20_000,
    past: 20,
    future: 20,
    order: 4,
};
/// `|At^p|` as printed.
const PRINTED_NORM: f64 = 1e-23;

impl Experiment for VanWingerdenOne {
    fn name(&self) -> &'static str {
        "van-wingerden-1"
    }

    fn title(&self) -> &'static str {
        "PBSID_opt and its bounds: a fourth-order plant in closed loop"
    }

    fn paper_runs(&self) -> usize {
        DRAWN
    }

    fn runs_of(&self, runs: usize) -> usize {
        2 * runs
    }

    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(self.paper_runs())?;
        let grid = logarithmic_grid(
            0.01 * std::f64::consts::PI,
            std::f64::consts::PI,
            FREQUENCIES,
        );
        let measured: Vec<usize> = (0..FREQUENCIES).step_by(MEASURED_EVERY).collect();
        let mut document = document_of(self, PAPER, runs, study);
        document.setup = setup();
        document.comparison = printed_numbers(study)?;
        let variants = [
            ("table", "Table 1 repaired", van_wingerden_one()),
            ("toolbox", "Toolbox system", pbsid_toolbox()),
        ];
        for (id, name, plant) in variants {
            let plan = Plan {
                plant: &plant,
                setting: SETTING,
                grid: grid.clone(),
                measured: measured.clone(),
                defaults: true,
            };
            let outcome = plan.carry_out(study, runs)?;
            document
                .comparison
                .extend(bounds_and_likeness(name, &outcome));
            document
                .figures
                .push(plan.figure(study, &outcome, id, &format!("{name}: Fig. 1"))?);
            document.tables.push(outcome.table(
                &format!("bounds-{id}"),
                &format!("{name}: do the bounds hold?"),
            ));
            document.remarks.extend(outcome.failures());
        }
        document.remarks.push(
            "p = f = 100 spends 400 regressors on 1900 windows of a plant whose predictor has forgotten everything after \
             10 samples. First-order variances come out too small then. A \
             window chosen by Akaike's criterion, f < p, and the polish repair it: last row of the tables."
                .to_owned(),
        );
        Ok(document)
    }
}

fn setup() -> Vec<Fact> {
    vec![
        Fact::paper("Samples N", SETTING.samples.to_string()),
        Fact::paper("Windows", format!("p = f = {}", SETTING.past)),
        Fact::paper("Order", SETTING.order.to_string()),
        Fact::paper("Reference and innovation", "white, normal, unit covariance"),
        Fact::paper("Weight W", "identity"),
        Fact::ours(
            "Table 1",
            "C(1,1) = -0.3749: the printed sign makes the loop unstable; Fb = +0.5 I",
        ),
        Fact::ours(
            "Toolbox system",
            "example 1 of the public PBSID toolbox, from whose rows Table 1 seems to be scrambled; u = r - 0.25 y",
        ),
        Fact::ours("Terms beta of (B.2), (B.4)", "with a plus"),
        Fact::ours(
            "Innovation covariance",
            "residual sum of squares / (Nc - p q); the paper is silent",
        ),
        Fact::ours("Bounds at", "25 frequencies, 4 entries of the response"),
    ]
}

fn closed_loop_radius(plant: &TestSystem) -> Result<f64, LinalgError> {
    let system = &plant.system;
    spectral_radius(&(&system.a + &system.b * &plant.feedback * &system.c))
}

/// What the paper prints about the system and the variance.
fn printed_numbers(study: &Study) -> Result<Vec<Comparison>, ReproduceError> {
    let repaired = van_wingerden_one();
    let mut printed = repaired.clone();
    printed.system.c[(0, 0)] = -printed.system.c[(0, 0)];
    let radius = closed_loop_radius(&printed)?;
    let repaired_radius = closed_loop_radius(&repaired)?;
    let radius_row = Comparison::new(
        "Table 1, C(1,1)",
        "+0.3749",
        format!(
            "as printed the loop is unstable, with a spectral radius of {}; with -0.3749 it is {}",
            number(radius, 4),
            number(repaired_radius, 3)
        ),
        if radius < 1.0 {
            Agreement::Yes
        } else {
            Agreement::Misprint
        },
        "the sign was lost in print",
    );
    let predictor = repaired.system.predictor_matrix();
    let mut power = predictor.clone();
    let mut norms = Vec::new();
    for _ in 0..SETTING.past {
        norms.push(crate::linalg::svd_thin(&power)?.values[0]);
        power *= &predictor;
    }
    let norm = norms[SETTING.past - 1];
    let nearest = (0..norms.len())
        .min_by(|&a, &b| {
            let distance = |k: usize| (norms[k] / PRINTED_NORM).ln().abs();
            distance(a).total_cmp(&distance(b))
        })
        .unwrap_or(0);
    let norm_row = Comparison::new(
        "Section 5.1, norm of At^100",
        number(PRINTED_NORM, 1),
        number(norm, 2),
        Agreement::of((norm / PRINTED_NORM).ln().abs() < 10f64.ln()),
        format!(
            "p = {} would give {}; either way the predictor forgets everything",
            nearest + 1,
            number(norms[nearest], 2)
        ),
    );
    let [plus, minus] = unexplained(&repaired, &SIGN_CHECK, study.seed).map_err(|first| {
        ReproduceError::Failed {
            method: "the check of the sign".to_owned(),
            failed: 1,
            runs: 1,
            first,
        }
    })?;
    let sign_row = Comparison::new(
        "(B.2), (B.4), sign of beta",
        "minus",
        format!(
            "plus: in one record of {} samples the formula with a plus leaves {} of the parameters' error unexplained, with \
             the minus {}",
            SIGN_CHECK.samples,
            percent(plus),
            percent(minus)
        ),
        if plus < minus {
            Agreement::Misprint
        } else {
            Agreement::Yes
        },
        "Ehat = E - E Pi_Z, so its error is -E Pi_Z",
    );
    Ok(vec![radius_row, norm_row, sign_row])
}

/// What the paper says of its figure, and of prediction-error methods.
pub(super) fn bounds_and_likeness(name: &str, outcome: &Outcome) -> Vec<Comparison> {
    let [subspace, polished, ..] = outcome.methods.as_slice() else {
        return Vec::new();
    };
    let bounds = &subspace.bounds;
    let ratio = bounds.variance_ratio.sqrt();
    let worse = bounds.relative_error / polished.bounds.relative_error;
    let factor = number(REALISTIC, 3);
    vec![
        Comparison::new(
            &format!("{name}, 99 % bounds"),
            "\"the bounds give realistic values\"",
            format!(
                "the predicted standard deviation is {} times the Monte Carlo one; the bounds hold the truth in {} of the cases",
                number(ratio, 3),
                percent_with_error(bounds.linear)
            ),
            Agreement::of(similar(ratio)),
            format!("standard deviations within a factor of {factor}"),
        ),
        Comparison::new(
            &format!("{name}, the band in the figure"),
            "20 estimates around one band",
            format!(
                "{} of the other estimates lie in the band of the first run, on average {} in the band of a run",
                percent(bounds.others_in_first),
                percent(bounds.others)
            ),
            Agreement::of(bounds.others >= 0.9 * share_expected_of_others()),
            format!(
                "two estimates differ by more than one differs from the truth, so {} are expected; at least nine tenths of that",
                percent(share_expected_of_others())
            ),
        ),
        Comparison::new(
            &format!("{name}, against prediction error"),
            "\"similar results are obtained\"",
            format!(
                "the rms error is {} times that of the maximum-likelihood model ({} against {})",
                number(worse, 3),
                percent(bounds.relative_error),
                percent(polished.bounds.relative_error)
            ),
            Agreement::of(similar(worse)),
            format!("within a factor of {factor}"),
        ),
    ]
}
