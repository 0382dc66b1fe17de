//! Monte Carlo runs in parallel, with results that do not depend on the number of threads.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::reproduce_error::ReproduceError;

/// Fewest runs from which a spread is estimated: with fewer, a variance is uncertain by half of itself.
pub(crate) const LEAST_RUNS: usize = 8;

/// Largest share of runs in which a method may fail: a failure is an outcome too, but beyond this the others do not
/// speak for the method any more.
const LARGEST_SHARE_OF_FAILURES: f64 = 0.05;

/// How an experiment is carried out.
#[derive(Clone, Copy)]
pub(crate) struct Study<'a> {
    /// Number of runs; `None` for as many as the paper has.
    pub(crate) runs: Option<usize>,
    /// Seed that the seeds of the runs are drawn from.
    pub(crate) seed: u64,
    /// Called once after each run, from any thread.
    pub(crate) progress: &'a (dyn Fn() + Sync),
}

impl Study<'_> {
    /// The number of runs, where the paper has `paper` of them.
    ///
    /// # Errors
    /// [`ReproduceError::TooFewRuns`].
    pub(super) fn count(&self, paper: usize) -> Result<usize, ReproduceError> {
        let runs = self.runs.unwrap_or(paper);
        if runs < LEAST_RUNS {
            return Err(ReproduceError::TooFewRuns {
                runs,
                least: LEAST_RUNS,
            });
        }
        Ok(runs)
    }

    /// Carries out `runs` runs. Each has a seed of its own, which does not depend on how many there are; the results
    /// come in the order of the runs, so that sums over them do not depend on threads either.
    pub(super) fn monte_carlo<T: Send>(
        &self,
        runs: usize,
        run: impl Fn(u64) -> T + Sync,
    ) -> Vec<T> {
        self.monte_carlo_seeds(runs)
            .into_par_iter()
            .map(|seed| {
                let result = run(seed);
                (self.progress)();
                result
            })
            .collect()
    }

    /// The seeds of the first `runs` runs.
    pub(super) fn monte_carlo_seeds(&self, runs: usize) -> Vec<u64> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        (0..runs).map(|_| random.next_u64()).collect()
    }
}

/// The results of the runs in which `method` did not fail, and the number of the others.
///
/// # Errors
/// [`ReproduceError::Failed`] when there are more than [`LARGEST_SHARE_OF_FAILURES`].
pub(super) fn successes<T, E: std::fmt::Display>(
    method: &str,
    results: Vec<Result<T, E>>,
) -> Result<(Vec<T>, usize), ReproduceError> {
    let runs = results.len();
    let mut first = None;
    let mut kept = Vec::with_capacity(runs);
    for result in results {
        match result {
            Ok(value) => kept.push(value),
            Err(error) => {
                first.get_or_insert_with(|| error.to_string());
            }
        }
    }
    let failed = runs - kept.len();
    match first {
        Some(first) if failed as f64 > LARGEST_SHARE_OF_FAILURES * runs as f64 => {
            Err(ReproduceError::Failed {
                method: method.to_owned(),
                failed,
                runs,
                first,
            })
        }
        _ => Ok((kept, failed)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(seed: u64) -> Study<'static> {
        Study {
            runs: None,
            seed,
            progress: &|| {},
        }
    }

    #[test]
    fn runs_do_not_depend_on_threads_or_on_their_number() {
        let draw = |runs| study(3).monte_carlo(runs, |seed| seed);
        let on_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| draw(100))
        };
        let (one, three) = (on_threads(1), on_threads(3));
        assert_eq!(one, three);
        assert_eq!(one[..10], draw(10));
        assert_ne!(one, study(4).monte_carlo(100, |seed| seed));
        let mut distinct = one.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), 100);
    }

    #[test]
    fn few_failures_are_counted_and_many_are_an_error() {
        let results = |failures: usize| -> Vec<Result<usize, String>> {
            (0..100)
                .map(|k| {
                    if k < failures {
                        Err(format!("run {k}"))
                    } else {
                        Ok(k)
                    }
                })
                .collect()
        };
        let (kept, failed) = successes("method", results(3)).unwrap();
        assert_eq!((kept.len(), failed), (97, 3));
        let error = successes("method", results(6)).unwrap_err().to_string();
        assert!(
            error.contains("method failed in 6 of 100") && error.contains("run 0"),
            "{error}"
        );
    }

    #[test]
    fn too_few_runs_are_refused() {
        let study = Study {
            runs: Some(3),
            ..study(1)
        };
        assert!(study.count(200).is_err());
        assert_eq!(super::tests::study(1).count(200).unwrap(), 200);
    }
}
