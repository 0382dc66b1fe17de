//! Which model: the flags that every command which identifies has.

use clap::{Args, ValueEnum};

use super::numbers::{self, Window};
use crate::identify::{CovarianceKind, Method, Options, Order, Polish, Stochastic, Weight};
use crate::moments::Detrend;

/// Order, windows, method and what is estimated beside it.
#[derive(Debug, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct ModelFlags {
    /// Order: auto, N, or several to compare: 2,4,6 or 2..8 (8 included)
    #[arg(long, default_value = "auto", value_parser = numbers::order, allow_negative_numbers = true)]
    order: Order,
    /// Past window in samples: auto or P
    #[arg(long, default_value = "auto", value_parser = numbers::window, allow_negative_numbers = true)]
    past: Window,
    /// Future window in samples (for pbsid-opt at most the past one): auto or F
    #[arg(long, default_value = "auto", value_parser = numbers::window, allow_negative_numbers = true)]
    future: Window,
    /// Algorithm
    #[arg(long, value_enum, default_value = "pbsid-opt")]
    method: Method,
    /// Step that estimates K, instead of the one of the method
    #[arg(long, value_enum)]
    stochastic: Option<Stochastic>,
    /// Weight of the singular value decomposition [default: depends on the method]
    #[arg(long, value_enum)]
    weight: Option<WeightFlag>,
    /// Refine the estimate to maximum likelihood; auto does so for pbsid-opt if the past window is long enough
    #[arg(long, value_enum, default_value = "auto")]
    polish: PolishFlag,
    /// Covariance: from the model, or robust against a wrong model (jackknife over blocks of the data)
    #[arg(long, value_enum, default_value = "model")]
    covariance: CovarianceFlag,
    /// What to subtract from each channel first
    #[arg(long, value_enum, default_value = "mean")]
    detrend: DetrendFlag,
    /// Estimate D, the direct feedthrough: an input acts on an output in the same sample
    #[arg(long)]
    feedthrough: bool,
    /// Known delay of the inputs in samples: one for all, or one for each
    #[arg(
        long,
        value_name = "D[,D..]",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    delay: Vec<u32>,
    /// Enforce a stable model; the summary says what that costs
    #[arg(long)]
    stable: bool,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum WeightFlag {
    Identity,
    Cva,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PolishFlag {
    Auto,
    Always,
    Never,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CovarianceFlag {
    Model,
    Robust,
}

/// What is taken out of each channel.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum DetrendFlag {
    Mean,
    Linear,
    None,
}

impl ModelFlags {
    /// The options as asked for.
    pub(crate) fn options(self) -> Options {
        Options {
            method: self.method,
            stochastic: self.stochastic,
            order: self.order,
            past: self.past.0,
            future: self.future.0,
            weight: self.weight.map(|weight| match weight {
                WeightFlag::Identity => Weight::Identity,
                WeightFlag::Cva => Weight::Cva,
            }),
            polish: match self.polish {
                PolishFlag::Auto => Polish::Auto,
                PolishFlag::Always => Polish::Always,
                PolishFlag::Never => Polish::Never,
            },
            covariance: match self.covariance {
                CovarianceFlag::Model => CovarianceKind::Model,
                CovarianceFlag::Robust => CovarianceKind::Robust,
            },
            detrend: match self.detrend {
                DetrendFlag::Mean => Detrend::Mean,
                DetrendFlag::Linear => Detrend::Linear,
                DetrendFlag::None => Detrend::None,
            },
            feedthrough: self.feedthrough,
            input_delay: self.delay.iter().map(|d| *d as usize).collect(),
            stable: self.stable,
            seed: self.seed,
            memory_limit: None,
        }
    }
}
