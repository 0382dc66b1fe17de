//! Example II: a 19th-order acoustic duct in closed loop.

use super::PAPER;
use super::bode::{DRAWN, Plan};
use super::estimation_run::Setting;
use super::fourth_order_example::bounds_and_likeness;
use super::measure::{Bounds, bounds};
use crate::linalg::{discrete_lyapunov, spectral_radius, svd_thin};
use crate::reproduce::document::{Agreement, Comparison, Fact, Reproduction};
use crate::reproduce::figure::{Row, Table};
use crate::reproduce::monte_carlo_runs::Study;
use crate::reproduce::plain_numbers::{number, percent_with_error};
use crate::reproduce::statistics::logarithmic_grid;
use crate::reproduce::{Experiment, ReproduceError, document_of};
use crate::systems::{TestSystem, acoustic_duct};

/// Example II of van Wingerden.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VanWingerdenTwo;

const SETTING: Setting = Setting {
    samples: 2000,
    past: 100,
    future: 100,
    order: 19,
};
/// Frequencies of the figure.
const FREQUENCIES: usize = 241;
/// Every so many of them bounds are measured.
const MEASURED_EVERY: usize = 6;
/// A response this far below its largest is weak: about the level of the noise of an estimate here.
const WEAK_DB: f64 = -20.0;
/// What the nilpotency `At^p = 0` of section 2.2 may leave to be called so.
const NILPOTENT: f64 = 1e-3;

impl Experiment for VanWingerdenTwo {
    fn name(&self) -> &'static str {
        "van-wingerden-2"
    }

    fn title(&self) -> &'static str {
        "PBSID_opt and its bounds: a 19th-order acoustic duct in closed loop"
    }

    fn paper_runs(&self) -> usize {
        DRAWN
    }

    fn reproduce(&self, study: &Study) -> Result<Reproduction, ReproduceError> {
        let runs = study.count(self.paper_runs())?;
        let plant = acoustic_duct()?;
        let grid = logarithmic_grid(
            0.01 * std::f64::consts::PI,
            std::f64::consts::PI,
            FREQUENCIES,
        );
        let measured: Vec<usize> = (0..FREQUENCIES).step_by(MEASURED_EVERY).collect();
        let plan = Plan {
            plant: &plant,
            setting: SETTING,
            grid,
            measured: measured.clone(),
            defaults: false,
        };
        let outcome = plan.carry_out(study, runs)?;
        let size = |k: usize| outcome.truth[k].amax_norm();
        let largest = (0..FREQUENCIES).map(size).fold(0.0, f64::max);
        let (weak, strong): (Vec<usize>, Vec<usize>) = measured
            .iter()
            .partition(|&&k| size(k) < largest * 10f64.powf(WEAK_DB / 20.0));
        let subspace = &outcome.methods[0];
        let of = |at: &[usize]| bounds(&subspace.runs, &outcome.truth, at);
        let (on_strong, on_weak) = (of(&strong), of(&weak));

        let mut document = document_of(self, PAPER, runs, study);
        document.setup = setup();
        document.comparison = vec![noise_row(&plant)?, memory_row(&plant)?];
        document
            .comparison
            .extend(bounds_and_likeness("Fig. 2", &outcome));
        document.comparison.push(suitable_row(&on_strong, &on_weak));
        document
            .figures
            .push(plan.figure(study, &outcome, "duct", "Acoustic duct: Fig. 2")?);
        document
            .tables
            .push(outcome.table("bounds", "Do the bounds hold?"));
        document
            .tables
            .push(by_strength(strong.len(), &on_strong, weak.len(), &on_weak));
        document.remarks.extend(outcome.failures());
        document.remarks.push(
            "The paper prints neither matrices nor noise nor feedback of this example: only the transfer function, the \
             order, the windows and the signal-to-noise ratio are given, so Fig. 2 can be repeated in kind, not in number."
                .to_owned(),
        );
        Ok(document)
    }
}

/// Largest modulus of the entries of a complex matrix.
trait LargestModulus {
    fn amax_norm(&self) -> f64;
}

impl LargestModulus for nalgebra::DMatrix<num_complex::Complex64> {
    fn amax_norm(&self) -> f64 {
        self.iter().fold(0.0, |m, g| m.max(g.norm()))
    }
}

fn setup() -> Vec<Fact> {
    vec![
        Fact::paper("Samples N", SETTING.samples.to_string()),
        Fact::paper("Windows", format!("p = f = {}", SETTING.past)),
        Fact::paper("Order", SETTING.order.to_string()),
        Fact::paper("Signal to noise", "approximately 8 dB"),
        Fact::paper("Reference", "white, normal"),
        Fact::ours(
            "Plant",
            "transfer function of the duct of Verhaegen & Verdult, as the public PBSID toolbox has it, scaled to unit \
             output variance for white input",
        ),
        Fact::ours(
            "Noise",
            "70 % white noise through the toolbox's noise path, 30 % white at the output, together 8 dB below the \
             output in open loop; K and Lambda from the stationary Kalman filter",
        ),
        Fact::ours("Feedback", "u = -0.1 y + r"),
        Fact::ours("Terms beta of (B.2), (B.4)", "with a plus"),
        Fact::ours(
            "Innovation covariance",
            "residual sum of squares / (Nc - p q)",
        ),
    ]
}

/// The signal-to-noise ratio that the noise gives, open loop and closed.
fn noise_row(plant: &TestSystem) -> Result<Comparison, ReproduceError> {
    let system = &plant.system;
    let lambda = &plant.innovation_covariance;
    let variance = |a: &nalgebra::DMatrix<f64>, source: nalgebra::DMatrix<f64>| {
        discrete_lyapunov(a, &source).map(|p| (&system.c * p * system.c.transpose())[(0, 0)])
    };
    let ratio = |a: &nalgebra::DMatrix<f64>, k: &nalgebra::DMatrix<f64>| {
        let signal = variance(a, &system.b * system.b.transpose())?;
        let noise = variance(a, k * lambda * k.transpose())? + lambda[(0, 0)];
        Ok::<f64, ReproduceError>(10.0 * (signal / noise).log10())
    };
    let open = ratio(&system.a, &system.k)?;
    let closed = ratio(
        &(&system.a + &system.b * &plant.feedback * &system.c),
        &(&system.k + &system.b * &plant.feedback),
    )?;
    Ok(Comparison::new(
        "Section 5.2, signal to noise",
        "approximately 8 dB",
        format!(
            "{} dB open loop, {} dB closed",
            number(open, 3),
            number(closed, 3)
        ),
        Agreement::of((7.0..9.0).contains(&closed)),
        "by our choice of the noise, which the paper does not print",
    ))
}

/// The assumption that the predictor forgets within the past window.
fn memory_row(plant: &TestSystem) -> Result<Comparison, ReproduceError> {
    let predictor = plant.system.predictor_matrix();
    let radius = spectral_radius(&predictor)?;
    // In balanced-like coordinates: the norm in the basis in which the states of the predictor are white.
    let drive = &plant.system.k * &plant.innovation_covariance * plant.system.k.transpose()
        + &plant.system.b * plant.system.b.transpose();
    let gram = discrete_lyapunov(&predictor, &drive)?;
    let root = crate::linalg::symmetric_square_root_factor(&gram)?;
    let power = (0..SETTING.past).fold(root.clone(), |m, _| &predictor * m);
    let left = svd_thin(&(&plant.system.c * &power))?.values[0];
    let whole = svd_thin(&(&plant.system.c * &root))?.values[0];
    let share = left / whole;
    Ok(Comparison::new(
        "Section 2.2, At^p = 0",
        "assumed",
        format!(
            "the spectral radius is {}, so that a share of {} of the prediction's standard deviation comes from before the window",
            number(radius, 3),
            number(share, 2)
        ),
        Agreement::of(share < NILPOTENT),
        format!(
            "a share below {} would count as nothing",
            number(NILPOTENT, 1)
        ),
    ))
}

fn suitable_row(strong: &Bounds, weak: &Bounds) -> Comparison {
    Comparison::new(
        "Section 5.2, a realistic complex model",
        "\"also suitable to work with a realistic complex model\"",
        format!(
            "the 99 % bound holds the truth in {} of the cases where |G| is strong, in {} where it is more than {} dB below its peak",
            percent_with_error(strong.linear),
            percent_with_error(weak.linear),
            number(-WEAK_DB, 2)
        ),
        Agreement::of_all([strong.linear.0 > 0.95, weak.linear.0 > 0.95]),
        "at least 95 % for a nominal 99 %",
    )
}

fn by_strength(strong: usize, on_strong: &Bounds, weak: usize, on_weak: &Bounds) -> Table {
    let row = |name: String, b: &Bounds| {
        Row::found(
            &name,
            [
                100.0 * b.linear.0,
                100.0 * b.logarithmic.0,
                100.0 * b.ellipse.0,
                b.variance_ratio,
                100.0 * b.relative_error,
            ],
        )
    };
    Table {
        id: "strength".to_owned(),
        title: "Where the bounds hold".to_owned(),
        caption: format!(
            "PBSID_opt as in the paper. Weak: more than {} dB below the largest response.",
            number(-WEAK_DB, 2)
        ),
        rows_are: "Response".to_owned(),
        columns: [
            "|G|, linear [%]",
            "|G|, logarithmic [%]",
            "complex G [%]",
            "predicted / Monte Carlo variance",
            "rms error of |G| [%]",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: vec![
            row(format!("strong, {strong} frequencies"), on_strong),
            row(format!("weak, {weak} frequencies"), on_weak),
        ],
        digits: 3,
    }
}
