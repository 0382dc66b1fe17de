//! How often stated regions hold the truth.

use innovant::Model;
use innovant::covariance::{
    Covariance2, Path, ellipse_quantile, pole_uncertainties, response_bands,
};
use innovant::internal::systems::TestSystem;
use num_complex::Complex64;

/// Truths that were inside 95 and 99 % regions.
#[derive(Default, Clone, Copy)]
pub struct Count {
    pub inside_95: usize,
    pub inside_99: usize,
    pub total: usize,
}

impl Count {
    fn ellipse(&mut self, error: Complex64, covariance: &Covariance2, freedom: Option<f64>) {
        let [[a, b], [_, d]] = *covariance;
        let determinant = a * d - b * b;
        let square = (d * error.re * error.re - 2.0 * b * error.re * error.im
            + a * error.im * error.im)
            / determinant;
        self.square(
            square,
            ellipse_quantile(0.95, freedom),
            ellipse_quantile(0.99, freedom),
        );
    }

    fn square(&mut self, square: f64, at_95: f64, at_99: f64) {
        self.total += 1;
        self.inside_95 += usize::from(square <= at_95);
        self.inside_99 += usize::from(square <= at_99);
    }

    fn intervals(&mut self, truth: f64, at_95: [f64; 2], at_99: [f64; 2]) {
        let inside = |[low, high]: [f64; 2]| usize::from((low..=high).contains(&truth));
        self.total += 1;
        self.inside_95 += inside(at_95);
        self.inside_99 += inside(at_99);
    }

    pub fn add(&mut self, other: &Count) {
        self.inside_95 += other.inside_95;
        self.inside_99 += other.inside_99;
        self.total += other.total;
    }

    /// Per cent.
    pub fn shares(&self) -> (f64, f64) {
        let share = |inside: usize| 100.0 * inside as f64 / self.total as f64;
        (share(self.inside_95), share(self.inside_99))
    }
}

/// Frequency response (complex ellipse), the reported bands of its magnitude, poles.
pub fn coverage(plant: &TestSystem, model: &Model, frequencies: &[f64]) -> [Count; 3] {
    let covariance = model.covariance.as_ref().unwrap();
    let freedom = covariance.degrees_of_freedom;
    let mut counts = [Count::default(); 3];
    let bands = response_bands(&model.system, covariance, frequencies, Path::Input, 1);
    for (&w, bands) in frequencies.iter().zip(&bands.unwrap()) {
        for (truth, band) in plant.system.frequency_response(w).iter().zip(bands) {
            counts[0].ellipse(truth - band.response, &band.covariance, freedom);
            counts[1].intervals(truth.norm(), band.magnitude_95, band.magnitude_99);
        }
    }
    if model.system.states() != plant.system.states() {
        // Poles of a model of another order have no true counterpart.
        return counts;
    }
    let truth = plant.system.poles().unwrap();
    for pole in pole_uncertainties(&model.system, covariance).unwrap() {
        let value = pole.pole.value;
        if value.im <= 1e-9 {
            continue;
        }
        let nearest = truth
            .iter()
            .map(|p| p.value - value)
            .min_by(|a, b| a.norm().total_cmp(&b.norm()))
            .unwrap();
        counts[2].ellipse(nearest, &pole.covariance.unwrap(), freedom);
    }
    counts
}
