//! Tests of `quantile`.

use super::*;
use statrs::distribution::{ChiSquared, FisherSnedecor};

#[test]
fn intervals_match_the_tables() {
    for (level, nu, expected) in [
        (0.95, None, 1.959_963_985),
        (0.99, None, 2.575_829_304),
        (0.95, Some(19.0), 2.093_024_054),
        (0.99, Some(19.0), 2.860_934_606),
        (0.95, Some(3.0), 3.182_446_305),
        (0.95, Some(1e9), 1.959_963_985),
    ] {
        let found = interval_quantile(level, nu);
        assert!((found - expected).abs() < 1e-6, "{level} {nu:?}: {found}");
    }
    assert_eq!(interval_quantile(0.95, Some(0.0)), f64::INFINITY);
    assert_eq!(interval_quantile(1.0, None), f64::INFINITY);
}

#[test]
fn ellipses_match_the_distributions() {
    for level in [0.5, 0.95, 0.99] {
        let chi2 = ChiSquared::new(2.0).unwrap();
        assert!((chi2.cdf(ellipse_quantile(level, None)) - level).abs() < 1e-9);
        for nu in [3.0, 19.0, 200.0] {
            let f = FisherSnedecor::new(2.0, nu - 1.0).unwrap();
            let scaled = ellipse_quantile(level, Some(nu)) * (nu - 1.0) / (2.0 * nu);
            assert!((f.cdf(scaled) - level).abs() < 1e-9);
        }
    }
    assert!((ellipse_quantile(0.95, Some(1e9)) - ellipse_quantile(0.95, None)).abs() < 1e-6);
    assert_eq!(ellipse_quantile(0.95, Some(1.0)), f64::INFINITY);
}
