//! The Monte Carlo study that both examples share, and its figure: 20 estimates, the truth, one 99 % band.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::estimation_run::{Failure, Response, Setting, Subspace, truth};
use super::measure::{Bounds, bounds};
use crate::covariance::{Path, response_bands};
use crate::identify::variance::subspace_covariance;
use crate::reproduce::figure::{Curve, Figure, Panel, Quantity, Role, Row, Table};
use crate::reproduce::monte_carlo_runs::{Study, successes};
use crate::reproduce::{ReproduceError, plain_numbers};
use crate::systems::TestSystem;
use crate::{Options, identify};

/// Runs that are drawn, as in the paper.
pub(super) const DRAWN: usize = 20;

/// A study of one plant.
pub(super) struct Plan<'a> {
    pub(super) plant: &'a TestSystem,
    pub(super) setting: Setting,
    /// Frequencies of the figure, rad/sample.
    pub(super) grid: Vec<f64>,
    /// Those of them at which bounds are measured.
    pub(super) measured: Vec<usize>,
    /// Whether innovant's own choices are studied beside the paper's.
    pub(super) defaults: bool,
}

/// One method over all runs.
#[derive(Debug)]
pub(super) struct Method {
    pub(super) name: &'static str,
    pub(super) runs: Vec<Response>,
    pub(super) failed: usize,
    pub(super) bounds: Bounds,
}

/// What the study found.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) truth: Vec<DMatrix<Complex64>>,
    /// The paper's method first, then its polish, then innovant's defaults.
    pub(super) methods: Vec<Method>,
    pub(super) runs: usize,
}

struct Run {
    subspace: Result<Response, Failure>,
    polished: Result<Response, Failure>,
    defaults: Option<Result<Response, Failure>>,
}

impl Plan<'_> {
    fn run(&self, seed: u64) -> Run {
        let log = self.plant.record(self.setting.samples, seed);
        let subspace = Subspace::new(&log, &self.setting);
        let of = |f: &dyn Fn(&Subspace) -> Result<Response, Failure>| {
            subspace.as_ref().map_err(Clone::clone).and_then(f)
        };
        let defaults = || {
            let model = identify(&[log], &Options::default()).map_err(|e| e.to_string())?;
            let covariance = model.covariance.ok_or("no covariance")?;
            Response::new(&model.system, &covariance, &self.grid)
        };
        Run {
            subspace: of(&|s| s.response(&self.grid)),
            polished: of(&|s| s.polished(&self.grid)),
            defaults: self.defaults.then(defaults),
        }
    }

    /// Carries the study out.
    pub(super) fn carry_out(&self, study: &Study, runs: usize) -> Result<Outcome, ReproduceError> {
        let truth = truth(&self.plant.system, &self.grid);
        let (mut subspace, mut polished, mut defaults) = (Vec::new(), Vec::new(), Vec::new());
        for run in study.monte_carlo(runs, |seed| self.run(seed)) {
            subspace.push(run.subspace);
            polished.push(run.polished);
            defaults.extend(run.defaults);
        }
        let mut all = vec![
            ("PBSID_opt, as in the paper", subspace),
            ("the same, polished to maximum likelihood", polished),
        ];
        if self.defaults {
            all.push(("innovant's own choices", defaults));
        }
        let methods = all
            .into_iter()
            .map(|(name, results)| {
                let (runs, failed) = successes(name, results)?;
                Ok(Method {
                    name,
                    bounds: bounds(&runs, &truth, &self.measured),
                    runs,
                    failed,
                })
            })
            .collect::<Result<_, ReproduceError>>()?;
        Ok(Outcome {
            truth,
            methods,
            runs,
        })
    }

    /// The band of the first run, as innovant draws it: symmetric on `log|G|`, or by draws where that fails.
    fn first_band(&self, study: &Study) -> Result<Vec<DMatrix<[f64; 2]>>, ReproduceError> {
        let seed = study.monte_carlo_seeds(1)[0];
        let log = self.plant.record(self.setting.samples, seed);
        let failed = |first| ReproduceError::Failed {
            method: "PBSID_opt".to_owned(),
            failed: 1,
            runs: 1,
            first,
        };
        let subspace = Subspace::new(&log, &self.setting).map_err(failed)?;
        let covariance = subspace_covariance(&subspace.estimate, &subspace.varx)?;
        let bands = response_bands(
            &subspace.estimate.system,
            &covariance,
            &self.grid,
            Path::Input,
            study.seed,
        )?;
        Ok(bands
            .into_iter()
            .map(|at| at.map(|band| band.magnitude_99))
            .collect())
    }

    /// The figure of the paper: a panel for each pair of input and output.
    pub(super) fn figure(
        &self,
        study: &Study,
        outcome: &Outcome,
        id: &str,
        title: &str,
    ) -> Result<Figure, ReproduceError> {
        let band = self.first_band(study)?;
        let method = &outcome.methods[0];
        let decibels = |g: f64| 20.0 * g.log10();
        let system = &self.plant.system;
        let pairs = (0..system.outputs()).flat_map(|o| (0..system.inputs()).map(move |i| (o, i)));
        let panels = pairs
            .map(|(o, i)| {
                let line = |values: &[DMatrix<Complex64>]| -> Vec<f64> {
                    values.iter().map(|g| decibels(g[(o, i)].norm())).collect()
                };
                let limit = |k: usize| band.iter().map(move |b| decibels(b[(o, i)][k]));
                let drawn = method.runs.iter().take(DRAWN);
                let curves = vec![
                    Curve::bundle(
                        &format!("{} estimates", drawn.len()),
                        Role::Runs,
                        drawn.clone().map(|run| line(&run.value)).collect(),
                    ),
                    Curve::banded(
                        "first run, 99 % band",
                        Role::First,
                        line(&method.runs[0].value),
                        limit(0),
                        limit(1),
                    ),
                    Curve::line("true system", Role::Truth, line(&outcome.truth)),
                ];
                Panel {
                    title: format!("u{} to y{}", i + 1, o + 1),
                    curves,
                }
            })
            .collect();
        Ok(Figure {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: format!(
                "Bode magnitude: the true system, {} estimates from recordings of their own, and around the first of \
                 them its 99 % band.",
                method.runs.len().min(DRAWN)
            ),
            x: Quantity::frequency(),
            y: Quantity::magnitude(),
            at: self.grid.clone(),
            panels,
        })
    }
}

impl Outcome {
    /// How the bounds of each method hold.
    pub(super) fn table(&self, id: &str, title: &str) -> Table {
        let rows = self
            .methods
            .iter()
            .map(|m| {
                let b = &m.bounds;
                let percent = |share: f64| 100.0 * share;
                Row::found(
                    m.name,
                    [
                        percent(b.linear.0),
                        percent(b.logarithmic.0),
                        percent(b.ellipse.0),
                        percent(b.others),
                        b.variance_ratio,
                        percent(b.relative_error),
                    ],
                )
            })
            .collect();
        let columns = [
            "|G|, linear [%]",
            "|G|, logarithmic [%]",
            "complex G [%]",
            "other runs [%]",
            "predicted / Monte Carlo variance",
            "rms error of |G| [%]",
        ];
        Table {
            id: id.to_owned(),
            title: title.to_owned(),
            caption: format!(
                "How often the 99 % regions hold the truth over {} runs; should be 99 %. The fourth column: estimates of \
                 the other runs within the bound of a run; should be 93.1 %.",
                self.runs
            ),
            rows_are: "Method".to_owned(),
            columns: columns.map(str::to_owned).to_vec(),
            rows,
            digits: 3,
        }
    }

    /// Sentences on runs that failed.
    pub(super) fn failures(&self) -> Vec<String> {
        self.methods
            .iter()
            .filter_map(|m| plain_numbers::failures(m.name, m.failed, self.runs))
            .collect()
    }
}
