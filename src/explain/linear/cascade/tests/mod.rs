//! Tanks simulated in small steps, in physical units, under several inputs; and plants that are no tanks.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

use super::*;

mod controls;

/// Small steps a sample.
const FINE: usize = 100;

/// Two tanks in metres and seconds.
#[derive(Debug, Clone, Copy)]
struct Tanks {
    /// Cross sections.
    area: [f64; 2],
    /// Flow at a level of 1.
    outlet: [f64; 2],
    rim: [f64; 2],
    /// Share of the upper overflow that the lower tank catches.
    caught: f64,
    /// Flow a volt.
    pump: f64,
    leak_in: f64,
    /// Volts a metre.
    gauge: f64,
    sample_time: f64,
}

const DRY: Tanks = Tanks {
    area: [0.02, 0.03],
    outlet: [0.0010, 0.0011],
    rim: [9.0, 9.0],
    caught: 0.6,
    pump: 1e-4,
    leak_in: 0.0,
    gauge: 8.0,
    sample_time: 4.0,
};

impl Tanks {
    /// Euler's method in steps so small that its error is below the noise.
    fn run(&self, input: &[f64], mut level: [f64; 2]) -> Vec<f64> {
        let h = self.sample_time / FINE as f64;
        let mut output = Vec::with_capacity(input.len());
        for u in input {
            output.push(self.gauge * level[1]);
            for _ in 0..FINE {
                let out = [0, 1].map(|i| self.outlet[i] * level[i].sqrt());
                level[0] =
                    (level[0] + h * (self.pump * u.max(0.0) - out[0]) / self.area[0]).max(0.0);
                let over = (level[0] - self.rim[0]).max(0.0);
                level[0] -= over;
                level[1] += h * (out[0] + self.leak_in - out[1]) / self.area[1];
                level[1] += self.caught * over * self.area[0] / self.area[1];
                level[1] = level[1].clamp(0.0, self.rim[1]);
            }
        }
        output
    }

    /// What the fit should find.
    fn numbers(&self) -> [f64; NUMBERS] {
        let (s, t) = (self.gauge, self.sample_time);
        let ratio = s * self.area[0] / self.area[1];
        let flow = s * t / self.area[1];
        [
            flow * self.pump,
            flow * self.outlet[0] / ratio.sqrt(),
            flow * self.outlet[1] / s.sqrt(),
            ratio * self.rim[0],
            self.caught,
            s * self.rim[1],
            flow * self.leak_in,
            0.0,
        ]
    }
}

fn normals(n: usize, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| StandardNormal.sample(&mut random)).collect()
}

/// Levels between 0 and `largest`, each held for `hold` samples.
fn staircase(n: usize, hold: usize, largest: f64, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let levels: Vec<f64> = (0..n.div_ceil(hold))
        .map(|_| StandardUniform.sample(&mut random))
        .collect();
    (0..n).map(|k| largest * levels[k / hold]).collect()
}

fn noisy(y: &[f64], deviation: f64, seed: u64) -> Vec<f64> {
    y.iter()
        .zip(normals(y.len(), seed))
        .map(|(y, e)| y + deviation * e)
        .collect()
}

fn fit_one(u: &[f64], y: &[f64]) -> CascadeFit {
    fit(&[(u, y)], &[vec![true; y.len()]], f64::INFINITY).expect("tanks")
}

/// Largest distance of the numbers that are in the fit from the truth, in standard deviations.
fn farthest(fit: &CascadeFit, truth: [f64; NUMBERS]) -> f64 {
    let present = Number::ALL
        .iter()
        .filter(|n| fit.cascade.parts.has(**n))
        .map(|n| *n as usize);
    present
        .map(|i| ((fit.cascade.numbers[i] - truth[i]) / fit.deviations[i]).abs())
        .fold(0.0, f64::max)
}

/// Whether there is an overflow of the upper tank, of the lower tank, and a constant inflow.
fn found(fit: &CascadeFit) -> [bool; 3] {
    let parts = fit.cascade.parts;
    [
        parts.upper_overflow,
        parts.lower_overflow,
        parts.constant_inflow,
    ]
}

fn rms(e: impl Iterator<Item = f64> + Clone) -> f64 {
    (e.clone().map(|e| e * e).sum::<f64>() / e.count() as f64).sqrt()
}

/// Ten numbers are 1.6 deviations away at most, on average; more than 4 is one in a thousand.
const FAR: f64 = 4.0;
/// Which parts there are: rims at these levels (metres) and inflow.
const KINDS: [(f64, f64, f64); 6] = [
    (9.0, 9.0, 0.0),
    (0.7, 9.0, 0.0),
    (9.0, 0.6, 0.0),
    (0.9, 0.6, 0.0),
    (0.9, 0.6, 2e-4),
    (9.0, 9.0, 2e-4),
];

#[test]
fn parts_and_numbers_are_recovered() {
    for (kind, (upper, lower, leak_in)) in KINDS.into_iter().enumerate() {
        // Time constants from 10 to 60 samples, and noise from 0.1 to 1 % of the range.
        for (round, (sample_time, noise)) in [(4.0, 0.01), (1.0, 0.03), (3.0, 0.07)]
            .into_iter()
            .enumerate()
        {
            let tanks = Tanks {
                rim: [upper, lower],
                leak_in,
                sample_time,
                ..DRY
            };
            let seed = (10 * kind + round) as u64;
            let u = staircase(1000, [25, 60, 40][round], 13.0, seed);
            let y = noisy(&tanks.run(&u, [0.3, 0.4]), noise, 100 + seed);
            let fit = fit_one(&u, &y);
            assert_eq!(
                found(&fit),
                [upper < 1.0, lower < 1.0, leak_in > 0.0],
                "{tanks:?} {:?}",
                fit.losses
            );
            assert!(
                farthest(&fit, tanks.numbers()) < FAR,
                "{:?} {:?}",
                fit.cascade,
                tanks.numbers()
            );
            assert!(
                (fit.error / noise - 1.0).abs() < 0.1,
                "{} {noise}",
                fit.error
            );
            assert!(fit.losses.outflow > 20.0 && (upper > 1.0 || fit.losses.upper_overflow > 20.0));
        }
    }
}

/// The upper tank empties within a sample: what is left is one tank, and nothing overflows.
#[test]
fn one_fast_tank() {
    let tanks = Tanks {
        area: [0.001, 0.03],
        ..DRY
    };
    for (seed, (hold, noise)) in [(25, 0.01), (60, 0.03), (10, 0.1), (40, 0.05)]
        .into_iter()
        .enumerate()
    {
        let u = staircase(1000, hold, 10.0, 10 + seed as u64);
        let fit = fit_one(
            &u,
            &noisy(&tanks.run(&u, [0.3, 0.4]), noise, 90 + seed as u64),
        );
        assert_eq!(found(&fit)[..2], [false, false], "{:?}", fit.losses);
        let d = Number::LowerOutflow as usize;
        assert!((fit.cascade.numbers[d] / tanks.numbers()[d] - 1.0).abs() < 0.02);
    }
}

/// A slow tank before a fast one, driven by sines that say little about which is which: from the grid alone, the fit
/// ends with them exchanged, by 20 to 30 in the criterion.
#[test]
fn the_order_of_the_tanks() {
    let k = (0..1000).map(f64::from);
    let u: Vec<f64> = k
        .map(|k| 5.0 + 2.4 * (0.013 * k).sin() + 2.4 * (0.07 * k).cos())
        .collect();
    let parts = Parts {
        law: Law::Root,
        upper_overflow: false,
        lower_overflow: false,
        constant_inflow: false,
        pump_bias: false,
    };
    let numbers = [0.0185, 0.037, 0.064, 0.0, 0.0, 0.0, 0.0, 0.0];
    let y = Cascade { parts, numbers }.simulate(&u, [6.67, 2.4]);
    for seed in [125, 137] {
        let fit = fit_one(&u, &noisy(&y, 0.1, seed));
        assert!(farthest(&fit, numbers) < FAR, "{:?}", fit.cascade);
        assert!(
            (5.0..200.0).contains(&fit.losses.exchange),
            "{:?}",
            fit.losses
        );
    }
}

/// A sum of sines, and levels below a hundredth of a unit; units must not matter.
#[test]
fn units_do_not_matter() {
    let tanks = Tanks {
        rim: [0.6, 0.6],
        ..DRY
    };
    let k = (0..600).map(f64::from);
    let u: Vec<f64> = k
        .map(|k| 6.0 + 3.0 * (0.021 * k).sin() + 3.0 * (0.073 * k).cos())
        .collect();
    let y = noisy(&tanks.run(&u, [0.3, 0.4]), 0.03, 4);
    let fit = fit_one(&u, &y);
    let (small, large): (Vec<f64>, Vec<f64>) = (
        y.iter().map(|y| y * 1e-3).collect(),
        u.iter().map(|u| u * 1e4).collect(),
    );
    let other = fit_one(&large, &small);
    assert_eq!(found(&fit), [true, true, false]);
    assert_eq!(found(&fit), found(&other));
    assert!((other.error * 1e3 / fit.error - 1.0).abs() < 1e-6);
    assert!((other.losses.overflow - fit.losses.overflow).abs() < 0.1);
    let of = |f: &CascadeFit, n| (f.cascade.number(n), f.deviations[n as usize]);
    for (n, factor) in [
        (Number::Pump, 1e-7),
        (Number::UpperOutflow, 1e-3_f64.sqrt()),
        (Number::UpperRim, 1e-3),
        (Number::Share, 1.0),
    ] {
        let (a, b) = (of(&fit, n), of(&other, n));
        assert!(
            (b.0 / a.0 / factor - 1.0).abs() < 1e-3 && (b.1 / a.1 / factor - 1.0).abs() < 1e-2,
            "{n:?} {a:?} {b:?}"
        );
    }
}

/// A command of -1 or 1 about an operating point, in two records with a gap in one.
#[test]
fn commands_about_an_operating_point() {
    let tanks = Tanks {
        rim: [0.6, 9.0],
        ..DRY
    };
    let command = |seed| {
        staircase(500, 15, 1.0, seed)
            .iter()
            .map(|r| if *r > 0.5 { 1.0 } else { -1.0 })
            .collect::<Vec<f64>>()
    };
    let volts = |u: &[f64]| u.iter().map(|u| 6.0 + 3.5 * u).collect::<Vec<f64>>();
    let (u, v) = (command(1), command(2));
    let (y, mut z) = (
        noisy(&tanks.run(&volts(&u), [0.1, 0.2]), 0.03, 3),
        noisy(&tanks.run(&volts(&v), [0.5, 0.6]), 0.03, 4),
    );
    let mask: Vec<bool> = (0..500).map(|k| !(200..230).contains(&k)).collect();
    z.iter_mut()
        .zip(&mask)
        .filter(|(_, keep)| !**keep)
        .for_each(|(z, _)| *z = f64::NAN);
    let fit = fit(
        &[(&u, &y), (&v, &z)],
        &[vec![true; 500], mask],
        f64::INFINITY,
    )
    .expect("tanks");
    assert!(
        fit.cascade.parts.pump_bias && found(&fit) == [true, false, false],
        "{:?}",
        fit.losses
    );
    assert_eq!((fit.count, fit.free), (970, 6 + 4));
    let mut truth = tanks.numbers();
    truth[Number::Bias as usize] = 6.0 * truth[0];
    truth[0] *= 3.5;
    assert!(farthest(&fit, truth) < FAR, "{:?} {truth:?}", fit.cascade);
    let ratio = tanks.gauge * tanks.area[0] / tanks.area[1];
    for (x, level) in fit.initial.iter().zip([[0.1, 0.2], [0.5, 0.6]]) {
        assert!(
            (x[0] - ratio * level[0]).abs() < 0.2 && (x[1] - tanks.gauge * level[1]).abs() < 0.1,
            "{x:?} {level:?}"
        );
    }
}

/// Deviations are those of repeated recordings.
#[test]
fn deviations_are_honest() {
    let tanks = Tanks {
        rim: [0.7, 0.7],
        leak_in: 1e-4,
        ..DRY
    };
    let u = staircase(500, 30, 13.0, 7);
    let clean = tanks.run(&u, [0.3, 0.4]);
    let fits: Vec<CascadeFit> = (0..40)
        .map(|seed| fit_one(&u, &noisy(&clean, 0.05, 500 + seed)))
        .collect();
    let full: Vec<&CascadeFit> = fits.iter().filter(|f| found(f) == [true; 3]).collect();
    assert!(full.len() >= 38, "{}", full.len());
    for i in (0..NUMBERS).filter(|i| *i != Number::Bias as usize) {
        let z = full
            .iter()
            .map(|f| (f.cascade.numbers[i] - tanks.numbers()[i]) / f.deviations[i]);
        // 38 draws: three deviations of their root mean square are 0.35.
        assert!(
            (rms(z.clone()) - 1.0).abs() < 0.35,
            "{i} {} {:.1?}",
            rms(z.clone()),
            z.collect::<Vec<_>>()
        );
    }
}
