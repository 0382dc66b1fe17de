//! What the command, the wheel, tests and benchmarks of this repository use beside the API. No stability: it changes and
//! goes without notice.

#[cfg(feature = "cli")]
pub mod cli {
    pub use crate::cli::run;
}

pub mod effects {
    pub use crate::explain::effects::{Port, library};
}

pub mod identify {
    pub use crate::identify::baselines::TableTwo;
    pub use crate::identify::fit_recordings::fit;
    pub use crate::identify::polish::predictor_coefficients;
    pub use crate::identify::subspace::{Estimate, Varx, decompose, system_matrices, varx};
    pub use crate::identify::variance::{
        AsymptoticMethod, asymptotic_covariance, subspace_covariance, subspace_jacobian,
    };
}

pub mod limits {
    pub use crate::limits::parse_size;
}

pub mod linalg {
    pub use crate::linalg::{
        cholesky_upper, discrete_lyapunov, pseudo_inverse, solve_upper_transposed, spectral_radius,
        symmetric_eigen, symmetric_square_root_factor,
    };
}

pub mod log {
    pub use crate::log::data_frame::{TableRoles, time_base_of};
    pub use crate::log::sample_time::is_sample_time;
    pub use crate::log::write::write_file_atomically;
}

pub mod moments {
    pub use crate::moments::{LagAccumulator, PanelQr, RFactor, Route, Trend};
}

pub mod report {
    pub use crate::report::plant::{frequency_grid, plant_fits, text_alone};
    pub use crate::report::text::{
        ModelText, Style, explanation_text, model_text, plant_estimate_text, plant_text,
        plant_validation_text, show_text, validation_text, verdict,
    };
}

/// The papers' examples, simulated.
pub mod systems {
    pub use crate::systems::{
        ClosedLoop, KnudsenExample, TestSystem, acoustic_duct, channels, chiuso_picci_frequencies,
        chiuso_picci_one, chiuso_picci_two, knudsen_armax, knudsen_bj, knudsen_vo, pbsid_toolbox,
        servo, two_by_two, van_wingerden_one,
    };
}

pub mod validate {
    pub use crate::validate::deviations::{Deviations, Zero, judge};
    pub use crate::validate::identified::test_residuals;
}
