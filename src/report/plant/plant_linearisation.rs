//! A plant linearised at an operating point: poles, gains and frequency responses with the uncertainty of its parameters.

use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;
use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plant_document::PlantDocument;
use crate::covariance::{
    Covariance2, DEFECTIVE, ResponsePoint, Root, StaticGain, continuous_stds, interval_quantile,
    linear_band, projected_variance, response_point,
};
use crate::linalg::{LinalgError, Rows, eigen, eigenvalues};
use crate::model::slowest_first;
use crate::physics::{Linearisation, OperatingPlant, Plant};

/// Kind and version of the document.
pub const LINEARISATION_FORMAT: &str = "innovant-linearisation/1";
/// Frequencies of the default grid.
const FREQUENCIES: usize = 60;
/// How far the grid reaches below the slowest and above the fastest pole.
const REACH: f64 = 10.0;
/// Standard deviations of states below this are the rounding of an equilibrium.
const ROUNDING: f64 = 1e-15;
/// A pole below this part of the size of `A` is an integrator: rounding moves it by about as much.
const INTEGRATOR: f64 = 1e-9;

/// A plant at an operating point, in continuous time: `dx/dt = A x + B u`, `y = C x + D u` about the point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "innovant-linearisation/1")]
pub struct LinearisationDocument {
    /// `innovant-linearisation/1`.
    #[schemars(extend("const" = LINEARISATION_FORMAT))]
    pub format: String,
    /// What the operating point is, in words.
    pub operating_point: String,
    /// The inputs there.
    pub inputs: Vec<OperatingValue>,
    /// The states there; they may move with the parameters.
    pub states: Vec<OperatingValue>,
    /// States by states.
    #[serde(rename = "A")]
    pub a: Rows,
    /// States by inputs.
    #[serde(rename = "B")]
    pub b: Rows,
    /// Outputs by states.
    #[serde(rename = "C")]
    pub c: Rows,
    /// Outputs by inputs.
    #[serde(rename = "D")]
    pub d: Rows,
    /// Poles in the `s` plane (rad/s), slowest first.
    pub poles: Vec<Root>,
    /// Static gain from each input to each output.
    pub static_gain: Vec<StaticGain>,
    /// Response from each input to each output at each frequency.
    pub frequency_response: Vec<ResponsePoint>,
    /// The linear model of the same recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified: Option<IdentifiedDocument>,
}

/// An input or a state at the operating point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OperatingValue {
    /// Name.
    pub name: String,
    /// Unit as declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Value.
    pub value: f64,
    /// Standard deviation that the parameters give it.
    #[serde(default)]
    pub std: Option<f64>,
}

/// What `innovant identify` finds without equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct IdentifiedDocument {
    /// Order of the model.
    pub order: usize,
    /// Its sample time in seconds.
    pub sample_time: f64,
    /// Its poles in the `z` plane, with their natural frequency, damping and time constant in continuous time.
    pub poles: Vec<Root>,
    /// Its response at a few frequencies.
    pub frequency_response: Vec<ResponsePoint>,
    /// The response of the plant there, sampled as the model is, with its inputs held.
    pub plant_response: Vec<ResponsePoint>,
}

/// A linearised plant whose parameters have a covariance or are taken as certain.
#[derive(Debug, Clone, Copy)]
pub struct Uncertain<'a> {
    /// Names and units.
    pub plant: &'a Plant,
    /// The plant at the operating point.
    pub operating: &'a OperatingPlant,
    /// Covariance of the parameters beside which it was linearised.
    pub covariance: Option<&'a DMatrix<f64>>,
}

impl PlantDocument {
    /// Places of the estimated parameters in [`ModelSpec::parameters`](crate::physics::ModelSpec::parameters), and their
    /// covariance where there is one.
    pub fn uncertainty(&self, plant: &Plant) -> Option<(Vec<usize>, &DMatrix<f64>)> {
        let parameters = plant.spec.parameters();
        let place = |name: &str| {
            parameters
                .iter()
                .position(|&v| plant.spec.variable(v).name == name)
        };
        let places: Option<Vec<usize>> = self.parameters.iter().map(|p| place(&p.name)).collect();
        let (places, covariance) = (places?, &self.covariance.as_ref()?.0);
        let fits = covariance.shape() == (places.len(), places.len());
        fits.then_some((places, covariance))
    }
}

impl LinearisationDocument {
    /// Everything about a linearised plant; responses at `frequencies` in rad/s.
    ///
    /// # Errors
    /// [`LinalgError`] when the eigenvalues cannot be computed.
    pub fn new(
        of: &Uncertain,
        operating_point: String,
        frequencies: &[f64],
    ) -> Result<Self, LinalgError> {
        let Linearisation { linear, state } = &of.operating.at;
        let spec = &of.plant.spec;
        let value = |v, value: f64, std: Option<f64>| {
            let v = spec.variable(v);
            OperatingValue {
                name: v.name.clone(),
                unit: v.unit_text.clone(),
                value,
                std,
            }
        };
        let spread = of.stds(|l| l.state.clone());
        Ok(Self {
            format: LINEARISATION_FORMAT.to_owned(),
            operating_point,
            inputs: spec
                .inputs()
                .into_iter()
                .zip(&of.operating.inputs)
                .map(|(v, &u)| value(v, u, None))
                .collect(),
            states: spec
                .states()
                .into_iter()
                .zip(state)
                .enumerate()
                .map(|(i, (v, &x))| {
                    let std = spread.as_ref().map(|s| s[i]);
                    value(v, x, std.map(|s| if s > ROUNDING { s } else { 0.0 }))
                })
                .collect(),
            a: Rows::from(&linear.a),
            b: Rows::from(&linear.b),
            c: Rows::from(&linear.c),
            d: Rows::from(&linear.d),
            poles: of.poles()?,
            static_gain: of.static_gain()?,
            frequency_response: of.responses(frequencies, None),
            identified: None,
        })
    }
}

/// A logarithmic grid about the poles, or up to the Nyquist frequency of a sample time.
///
/// # Errors
/// [`LinalgError`] when the eigenvalues cannot be computed.
pub fn frequency_grid(
    operating: &OperatingPlant,
    sample_time: Option<f64>,
) -> Result<Vec<f64>, LinalgError> {
    let a = &operating.at.linear.a;
    let sizes: Vec<f64> = eigenvalues(a)?
        .iter()
        .map(|s| s.norm())
        .filter(|w| *w > INTEGRATOR * a.norm())
        .collect();
    let nyquist = sample_time.map(|t| PI / t);
    let (slowest, fastest) = sizes
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), &w| {
            (low.min(w), high.max(w))
        });
    let (slowest, fastest) = match (sizes.is_empty(), nyquist) {
        (false, _) => (slowest, fastest),
        (true, Some(nyquist)) => (nyquist / REACH, nyquist / REACH),
        (true, None) => (1.0, 1.0),
    };
    let low = slowest / REACH;
    let high = nyquist.unwrap_or(fastest * REACH).max(low * REACH);
    Ok(logarithmic(low, high, FREQUENCIES))
}

/// `count` frequencies with equal ratios.
pub(crate) fn logarithmic(low: f64, high: f64, count: usize) -> Vec<f64> {
    let ratio = (high / low).ln() / (count.max(2) - 1) as f64;
    (0..count).map(|k| low * (ratio * k as f64).exp()).collect()
}

impl Uncertain<'_> {
    /// Standard deviations of quantities of the linearised plant.
    fn stds(&self, of: impl Fn(&Linearisation) -> Vec<f64>) -> Option<Vec<f64>> {
        let covariance = self.operating.covariance(self.covariance?, of);
        Some(
            covariance
                .diagonal()
                .iter()
                .map(|v| v.max(0.0).sqrt())
                .collect(),
        )
    }

    /// Covariances of the real and imaginary parts of complex quantities.
    fn pairs(&self, of: impl Fn(&Linearisation) -> Vec<Complex64>) -> Option<Vec<Covariance2>> {
        let parts = |l: &Linearisation| of(l).iter().flat_map(|g| [g.re, g.im]).collect();
        let jacobian = self.operating.jacobian(parts);
        let half = &jacobian * self.covariance?;
        let entry = |i: usize, j: usize| half.row(i).dot(&jacobian.row(j));
        Some(
            (0..jacobian.nrows() / 2)
                .map(|k| {
                    let (re, im) = (2 * k, 2 * k + 1);
                    let cross = entry(re, im);
                    [
                        [entry(re, re).max(0.0), cross],
                        [cross, entry(im, im).max(0.0)],
                    ]
                })
                .collect(),
        )
    }

    /// Poles, slowest first and of a pair the upper one first. First order: `ds = w dA v` with left and right eigenvectors,
    /// `w v = 1`; a multiple pole has no covariance.
    fn poles(&self) -> Result<Vec<Root>, LinalgError> {
        let a = &self.operating.at.linear.a;
        let integrator = INTEGRATOR * a.norm();
        let vectors = match eigen(a) {
            Ok(found) => Some(found),
            Err(LinalgError::Singular { .. }) => None,
            Err(error) => return Err(error),
        };
        let values = match &vectors {
            Some(found) => found.values.clone(),
            None => eigenvalues(a)?,
        };
        let known = vectors.and_then(|found| {
            self.pairs(|l| {
                let a = l.linear.a.map(|v| Complex64::new(v, 0.0));
                (0..values.len())
                    .map(|i| (found.left.row(i) * &a * found.right.column(i))[(0, 0)])
                    .collect()
            })
            .map(|pairs| {
                let simple =
                    |i: usize| found.left.row(i).norm() * found.right.column(i).norm() < DEFECTIVE;
                let pair = |(i, mut c): (usize, Covariance2)| {
                    if values[i].im == 0.0 {
                        c[0][1] = 0.0;
                        c[1] = [0.0, 0.0];
                    }
                    simple(i).then_some(c)
                };
                pairs.into_iter().enumerate().map(pair).collect::<Vec<_>>()
            })
        });
        // Slowest first in the s plane is largest first of what is inverted.
        let inverted: Vec<Complex64> = values
            .iter()
            .map(|s| match s.norm() > integrator {
                true => s.inv().conj(),
                false => Complex64::new(f64::MAX, 0.0),
            })
            .collect();
        let order = slowest_first(&inverted);
        Ok(order
            .into_iter()
            .map(|i| root(values[i], known.as_ref().and_then(|k| k[i]), integrator))
            .collect())
    }

    fn names(&self) -> (Vec<String>, Vec<String>) {
        let spec = &self.plant.spec;
        let names = |of: Vec<_>| -> Vec<String> {
            of.into_iter()
                .map(|v| spec.variable(v).name.clone())
                .collect()
        };
        (names(spec.outputs()), names(spec.inputs()))
    }

    /// None where the plant integrates.
    fn static_gain(&self) -> Result<Vec<StaticGain>, LinalgError> {
        let a = &self.operating.at.linear.a;
        let integrates = eigenvalues(a)?
            .iter()
            .any(|s| s.norm() <= INTEGRATOR * a.norm());
        let gain = |l: &Linearisation| -> Vec<f64> {
            let response = l.linear.response(Complex64::ZERO);
            response.iter().map(|g| g.re).collect()
        };
        let values = (!integrates).then(|| gain(&self.operating.at));
        let spread = values.as_ref().and_then(|_| self.stds(gain));
        let (outputs, inputs) = self.names();
        let quantile = interval_quantile(0.95, None);
        let paths = inputs
            .iter()
            .flat_map(|i| outputs.iter().map(move |o| (o, i)));
        Ok(paths
            .enumerate()
            .map(|(k, (output, input))| {
                let value = values.as_ref().map(|v| v[k]).filter(|v| v.is_finite());
                let std = spread.as_ref().map(|s| s[k]).filter(|s| s.is_finite());
                StaticGain {
                    output: output.clone(),
                    input: input.clone(),
                    value,
                    standard_deviation: std,
                    interval_95: value
                        .zip(std)
                        .map(|(v, s)| [v - quantile * s, v + quantile * s]),
                }
            })
            .collect())
    }

    /// Responses at frequencies in rad/s: of the plant in continuous time, or sampled with its inputs held.
    pub fn responses(&self, frequencies: &[f64], sample_time: Option<f64>) -> Vec<ResponsePoint> {
        let (outputs, inputs) = self.names();
        let mut points = Vec::new();
        for &w in frequencies {
            let response = |l: &Linearisation| -> Vec<Complex64> {
                let g = match sample_time {
                    None => l.linear.response(Complex64::new(0.0, w)),
                    Some(t) => l.linear.sampled_response(w, t),
                };
                g.iter().copied().collect()
            };
            let values = response(&self.operating.at);
            let spread = self.pairs(response);
            let paths = inputs
                .iter()
                .flat_map(|i| outputs.iter().map(move |o| (o, i)));
            for (k, (output, input)) in paths.enumerate() {
                let band = spread.as_ref().map(|s| linear_band(values[k], &s[k], None));
                points.push(response_point(w, (output, input), values[k], band));
            }
        }
        points
    }
}

/// A pole in the `s` plane.
fn root(s: Complex64, covariance: Option<Covariance2>, integrator: f64) -> Root {
    let moves = s.norm() > integrator;
    let decays = s.re.abs() > integrator;
    let stds = covariance
        .filter(|_| moves)
        .map(|c| continuous_stds(s, |a, b| projected_variance(&c, a, b).sqrt()));
    let std = |k: usize| stds.map(|s| s[k]).filter(|v| v.is_finite());
    Root {
        real: s.re,
        imag: s.im,
        covariance,
        natural_frequency_hz: Some(if moves { s.norm() / TAU } else { 0.0 }),
        natural_frequency_std: std(0).map(|v| v / TAU),
        damping: moves.then(|| if decays { -s.re / s.norm() } else { 0.0 }),
        damping_std: std(1),
        time_constant_s: decays.then(|| -1.0 / s.re),
        time_constant_std: std(2).filter(|_| decays),
    }
}
