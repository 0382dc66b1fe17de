//! Colours that are found again in noise that was drawn from them.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

fn drawn(ar: &[f64], ma: &[f64], samples: usize, seed: u64) -> Vec<f64> {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let lead = 20_000;
    let e: Vec<f64> = (0..samples + lead)
        .map(|_| random.sample(StandardNormal))
        .collect();
    let mut v: Vec<f64> = Vec::with_capacity(e.len());
    for k in 0..e.len() {
        let mut now = e[k];
        for (i, c) in ma.iter().enumerate().take(k) {
            now += c * e[k - 1 - i];
        }
        for (i, a) in ar.iter().enumerate().take(k) {
            now -= a * v[k - 1 - i];
        }
        v.push(now);
    }
    v.split_off(lead)
}

fn chosen(v: Vec<f64>) -> Colour {
    let mask = vec![vec![true; v.len()]];
    colour(&vec![v], 1, 0, &mask, Colours::All)
}

/// Slow and white noise: of order (1, 1), with the likelihood of the truth but for chance.
#[test]
fn slow_and_white_noise_is_of_order_one() {
    let mut right = 0;
    for seed in 0..20 {
        let v = drawn(&[-0.98], &[-0.8], 3000, seed);
        let mask = vec![true; v.len()];
        let found = chosen(v.clone());
        right += usize::from((found.ar.len(), found.ma.len()) == (1, 1));
        let stretch = [(v.as_slice(), mask.as_slice())];
        let truth = Colour::new(vec![-0.98], vec![-0.8]).unwrap();
        let worse = deviance(&found, &stretch, 0.0) - deviance(&truth, &stretch, 0.0);
        assert!(worse < 4.0, "{seed}: {worse} {found:?}");
    }
    assert!(right >= 18, "{right} of 20");
}

#[test]
fn mixed_models_reach_the_likelihood_of_the_truth() {
    let models: [(&[f64], &[f64]); 4] = [
        (&[-1.6, 0.64], &[-0.3]),
        (&[-1.7, 0.8], &[-0.4, 0.2]),
        (&[-0.999], &[-0.9]),
        (&[-1.95, 0.955], &[-1.2, 0.3]),
    ];
    for (ar, ma) in models {
        for seed in 0..5 {
            let v = drawn(ar, ma, 3000, 50 + seed);
            let mask = vec![true; v.len()];
            let found = chosen(v.clone());
            let stretch = [(v.as_slice(), mask.as_slice())];
            let truth = Colour::new(ar.to_vec(), ma.to_vec()).unwrap();
            // About the mean, as it was estimated: slow noise wanders off for as long as the record.
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            let worse = deviance(&found, &stretch, mean) - deviance(&truth, &stretch, mean);
            // A model with fewer coefficients may be chosen: by Schwarz each is worth ln(3000) = 8.
            assert!(worse < 10.0, "{ar:?} {ma:?} {seed}: {worse} {found:?}");
        }
    }
}

#[test]
fn white_noise_stays_white() {
    let coloured = (0..40)
        .filter(|seed| chosen(drawn(&[], &[], 3000, *seed)).len() > 0)
        .count();
    assert!(coloured <= 3, "{coloured} of 40");
}

/// Short gaps cost little; what stands in them does not matter.
#[test]
fn gaps_do_not_change_the_colour() {
    let mut v = drawn(&[-0.98], &[-0.8], 3000, 3);
    let whole = chosen(v.clone());
    let mut mask = vec![true; v.len()];
    for k in (40..2900).step_by(150) {
        for i in 0..3 {
            mask[k + i] = false;
            v[k + i] = 1e6;
        }
    }
    let found = colour(&vec![v], 1, 0, &vec![mask], Colours::All);
    assert_eq!((found.ar.len(), found.ma.len()), (1, 1));
    assert!(
        (found.ar[0] - whole.ar[0]).abs() < 0.01,
        "{found:?} {whole:?}"
    );
    assert!(
        (found.ma[0] - whole.ma[0]).abs() < 0.04,
        "{found:?} {whole:?}"
    );
}

/// Long gaps, of blocks that are left out, in noise whose spectrum falls by orders of magnitude: what bridges them is as large as what
/// there is at high frequencies.
#[test]
fn blocks_left_out_do_not_change_the_colour() {
    let truth = Colour::new(vec![-1.5, 0.64], vec![0.5]).unwrap();
    for seed in 0..10 {
        let v = drawn(&truth.ar, &truth.ma, 2000, 90 + seed);
        let mask: Vec<bool> = (0..v.len())
            .map(|k| k % 250 < 110 || k % 250 >= 140)
            .collect();
        let stretch = [(v.as_slice(), mask.as_slice())];
        let found = colour(&vec![v.clone()], 1, 0, &vec![mask.clone()], Colours::All);
        let worse = deviance(&found, &stretch, 0.0) - deviance(&truth, &stretch, 0.0);
        assert!(worse < 6.0, "{seed}: {worse} {found:?}");
    }
}
