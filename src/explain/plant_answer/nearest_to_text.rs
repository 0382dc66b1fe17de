//! Of parameters and curves that a recording tells only together, those with the parameters of the text.

use nalgebra::DMatrix;

use crate::physics::estimate::{Fit, Study};

/// A standard deviation that a curve multiplies by this is due to the curve: it does what the parameter does.
const LOOSENED: f64 = 3.0;
/// The text is within so many standard deviations.
const WITHIN: f64 = 2.0;
/// The deviance may rise by so much for each parameter (Akaike).
const ALIKE: f64 = 2.0;

/// The fit with those parameters as the text has them that a curve has made uncertain, and its covariance given these values; none
/// where there are no such parameters. The other numbers follow, as the conditional mean of a Gaussian has it. `text` are the
/// parameters, with which the numbers of the fit begin, and `before` their covariance without the curve.
pub(super) fn nearest_to_text(
    study: &Study,
    fit: &Fit,
    covariance: &DMatrix<f64>,
    text: &[f64],
    before: &DMatrix<f64>,
) -> Option<(Fit, DMatrix<f64>)> {
    let (mut moved, mut covariance) = (fit.clone(), covariance.clone());
    let mut held = 0;
    let loosened = |i: usize, covariance: &DMatrix<f64>, point: &[f64]| {
        let (now, known) = (covariance[(i, i)], before[(i, i)]);
        let wide = now.is_finite() && known > 0.0 && now > LOOSENED * LOOSENED * known;
        let near = (point[i] - text[i]).powi(2) <= WITHIN * WITHIN * now;
        (wide && near).then(|| (now / known, i))
    };
    while let Some((_, i)) = (0..text.len())
        .filter_map(|i| loosened(i, &covariance, &moved.point))
        .max_by(|a, b| a.0.total_cmp(&b.0))
    {
        let column = covariance.column(i).into_owned();
        if !column.iter().all(|c| c.is_finite()) {
            return None;
        }
        let away = (moved.point[i] - text[i]) / column[i];
        for (p, c) in moved.point.iter_mut().zip(&column) {
            *p -= away * c;
        }
        covariance -= &column * column.transpose() / column[i];
        // Exactly, so that it is not found again.
        moved.point[i] = text[i];
        covariance.row_mut(i).fill(0.0);
        covariance.column_mut(i).fill(0.0);
        held += 1;
    }
    if held == 0 {
        return None;
    }
    moved.deviance = study.deviance(&moved)?;
    (moved.deviance <= fit.deviance + ALIKE * f64::from(held)).then_some((moved, covariance))
}
