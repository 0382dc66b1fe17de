//! An angle that starts again at the end of each turn.

use super::gross::median;

/// A jump goes over this share of all that the output ever shows ...
const JUMP: f64 = 0.6;
/// ... and other steps over no more than this: turns can be counted.
const NO_JUMP: f64 = 0.45;
/// Share of the steps that may be in between, of noise.
const DOUBTFUL: f64 = 0.003;
/// Largest share of the samples at which it jumps: beyond it, turns cannot be counted.
const MOST: f64 = 0.1;
/// Turns as sensors and programs count them: degrees, radians, turns, gradians, counts, percent, half turns, hours.
const TURNS: [f64; 22] = [
    360.0,
    std::f64::consts::TAU,
    1.0,
    400.0,
    180.0,
    std::f64::consts::PI,
    100.0,
    1000.0,
    3600.0,
    24.0,
    128.0,
    256.0,
    512.0,
    1024.0,
    2048.0,
    4096.0,
    8192.0,
    16384.0,
    32768.0,
    65536.0,
    1_048_576.0,
    16_777_216.0,
];
/// A signal goes over a turn by no more than this share, of noise that is added later ...
const TOLERANCE: f64 = 0.02;
/// ... and reaches this share of it, where it wraps often ...
const REACHED: f64 = 0.98;
/// ... or once.
const ONCE: f64 = 0.9;
/// Share of the samples in the middle half of a turn, at least.
const BETWEEN: f64 = 0.05;
/// What moves by less, as a share of its size, is rounding.
const ROUNDING: f64 = 1e-6;
/// Jumps are a turn to this share.
const SEEN: f64 = 0.1;
/// With the turns counted, recording and simulation must differ by less than this share of the mean square, as they are or
/// up to a gain.
const BETTER: f64 = 0.5;

/// Where a signal wraps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wrap {
    pub(crate) period: f64,
    /// First sample after each jump.
    pub(crate) jumps: Vec<usize>,
    /// The signal with its turns counted.
    pub(crate) unwrapped: Vec<f64>,
}

/// Jumps of `y` by a turn; `None` where there are none, or where it moves too fast to count turns.
fn jumps(y: &[f64]) -> Option<Wrap> {
    let range = range(y);
    let steps: Vec<f64> = y.windows(2).map(|p| p[1] - p[0]).collect();
    let jumps: Vec<usize> = (0..steps.len())
        .filter(|k| steps[*k].abs() > JUMP * range)
        .collect();
    // A switch goes from one end to the other, an angle passes through what is between.
    let ends = ends(y);
    let inner = ends.0 + 0.25 * range..ends.1 - 0.25 * range;
    let between = y.iter().filter(|v| inner.contains(v)).count();
    let size = ends.0.abs().max(ends.1.abs());
    if (between as f64) < BETWEEN * y.len() as f64 || range < ROUNDING * size {
        return None;
    }
    if jumps.is_empty() || jumps.len() as f64 > MOST * y.len() as f64 {
        return None;
    }
    let jumped = |k: usize| steps[k].abs() > JUMP * range;
    let doubtful = steps
        .iter()
        .filter(|d| (NO_JUMP * range..JUMP * range).contains(&d.abs()))
        .count();
    if doubtful as f64 > DOUBTFUL * y.len() as f64 {
        return None;
    }
    // A jump is a turn less what the signal moves in a sample.
    let mut sizes: Vec<f64> = jumps
        .iter()
        .map(|k| {
            let mut beside: Vec<f64> = (k.saturating_sub(3)..(k + 4).min(steps.len()))
                .filter(|j| !jumped(*j))
                .map(|j| steps[j])
                .collect();
            (steps[*k] - median(&mut beside)).abs()
        })
        .collect();
    let seen = median(&mut sizes);
    // Noise at the ends shortens what is seen of a turn; where it wraps often, the ends are reached.
    let near = |a: f64, b: f64, share: f64| (a / b - 1.0).abs() < share;
    let reached = if jumps.len() >= 3 { REACHED } else { ONCE };
    let listed = TURNS
        .iter()
        .copied()
        .filter(|t| range < (1.0 + TOLERANCE) * t && range > reached * t && near(seen, *t, SEEN))
        .min_by(|a, b| (a - range).abs().total_cmp(&(b - range).abs()));
    let unlisted = (jumps.len() >= 3 && near(seen, range, TOLERANCE)).then(|| seen.max(range));
    let period = listed.or(unlisted)?;
    let mut turns = 0.0;
    let mut unwrapped = y.to_vec();
    let mut next = jumps.iter().peekable();
    for (k, value) in unwrapped.iter_mut().enumerate() {
        if k > 0 && next.peek() == Some(&&(k - 1)) {
            turns -= steps[k - 1].signum();
            next.next();
        }
        *value += turns * period;
    }
    Some(Wrap {
        period,
        jumps: jumps.iter().map(|k| k + 1).collect(),
        unwrapped,
    })
}

/// Wraps of a recording and of its simulation, each where it has some: an angle that does not jump must be what makes
/// the two agree.
pub(crate) fn wraps(y: &[f64], s: &[f64]) -> (Option<Wrap>, Option<Wrap>) {
    let options = (jumps(y), jumps(s));
    let tried = |recorded: Option<&Wrap>, simulated: Option<&Wrap>| {
        let y = recorded.map_or(y, |w| &w.unwrapped);
        let s = simulated.map_or(s, |w| &w.unwrapped);
        apart(y, s)
    };
    let (a, b) = (options.0.as_ref(), options.1.as_ref());
    let best = [(a, None), (None, b), (a, b)]
        .into_iter()
        .filter(|(a, b)| a.is_some() || b.is_some())
        .min_by(|x, y| tried(x.0, x.1).0.total_cmp(&tried(y.0, y.1).0));
    let Some((recorded, simulated)) = best else {
        return (None, None);
    };
    let (before, after) = (apart(y, s), tried(recorded, simulated));
    if after.0 > BETTER * before.0 && after.1 > BETTER * before.1 {
        return (None, None);
    }
    let mut recorded = recorded.cloned();
    let mut simulated = simulated.cloned();
    // On the same turn as the other.
    let period = recorded
        .as_ref()
        .or(simulated.as_ref())
        .map_or(1.0, |w| w.period);
    let now_y: &[f64] = recorded.as_ref().map_or(y, |w| &w.unwrapped);
    let now_s: &[f64] = simulated.as_ref().map_or(s, |w| &w.unwrapped);
    let mut differences: Vec<f64> = now_s.iter().zip(now_y).map(|(s, y)| s - y).collect();
    let whole = (median(&mut differences) / period).round() * period;
    if let Some(w) = &mut recorded {
        w.unwrapped.iter_mut().for_each(|v| *v += whole);
    } else if let Some(w) = &mut simulated {
        w.unwrapped.iter_mut().for_each(|v| *v -= whole);
    }
    (recorded, simulated)
}

/// Mean square difference, and the share of `y` that `s` does not explain, both about the mean: turns that were made
/// before say nothing.
fn apart(y: &[f64], s: &[f64]) -> (f64, f64) {
    let n = y.len().max(1) as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (mean_y, mean_s) = (mean(y), mean(s));
    let (mut yy, mut ss, mut sy) = (0.0, 0.0, 0.0);
    for (y, s) in y.iter().zip(s) {
        let (y, s) = (y - mean_y, s - mean_s);
        yy += y * y;
        ss += s * s;
        sy += s * y;
    }
    let unexplained = 1.0 - sy * sy / (ss * yy).max(1e-300);
    ((yy - 2.0 * sy + ss) / n, unexplained)
}

fn range(y: &[f64]) -> f64 {
    let (low, high) = ends(y);
    high - low
}

fn ends(y: &[f64]) -> (f64, f64) {
    y.iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(*v), hi.max(*v))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_counted() {
        for (period, low) in [
            (360.0, -180.0),
            (std::f64::consts::TAU, 0.0),
            (4096.0, 0.0),
            (123.4, 0.0),
        ] {
            let angle: Vec<f64> = (0..3000)
                .map(|k| {
                    period * (1.5 + 3.0 * (0.004 * f64::from(k)).sin() + 0.001 * f64::from(k % 7))
                })
                .collect();
            let shown: Vec<f64> = angle
                .iter()
                .map(|a| (a - low).rem_euclid(period) + low)
                .collect();
            // The simulation turns a little less.
            let simulated: Vec<f64> = angle.iter().map(|a| 0.97 * a).collect();
            let (recorded, none) = wraps(&shown, &simulated);
            assert_eq!(none, None);
            let wrap = recorded.expect("a wrap");
            assert!((wrap.period / period - 1.0).abs() < 0.02, "{}", wrap.period);
            for (u, a) in wrap.unwrapped.iter().zip(&angle) {
                assert!((u - a).abs() < 0.15 * period, "{u} {a}");
            }
            // The other way round.
            let (none, simulated) = wraps(&angle, &shown);
            assert!(none.is_none() && simulated.is_some());
        }
    }

    #[test]
    fn a_switch_is_no_wrap() {
        let switched = |k: i32| if (k / 50) % 2 == 0 { 0.0 } else { 1.0 };
        let y: Vec<f64> = (0..2000).map(switched).collect();
        // The simulation switches later.
        let s: Vec<f64> = (0..2000).map(|k| switched(k - 7)).collect();
        assert_eq!(wraps(&y, &s), (None, None));
    }
}
