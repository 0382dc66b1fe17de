//! An angle that starts again at the end of each turn.

use super::gross::median;

/// A jump goes over this share of all that the output ever shows; any other step over no more than half of that.
const JUMP: f64 = 0.7;
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
/// A turn is one of those to this share.
const TOLERANCE: f64 = 0.02;
/// With the turns counted, recording and simulation must differ by less than this share of the mean square.
const BETTER: f64 = 0.5;

/// Where a signal wraps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wrap {
    pub period: f64,
    /// First sample after each jump.
    pub jumps: Vec<usize>,
    /// The signal with its turns counted.
    pub unwrapped: Vec<f64>,
}

/// Jumps of `y` by a turn; `None` where there are none, or where it moves too fast to count turns.
fn jumps(y: &[f64]) -> Option<Wrap> {
    let range = range(y);
    let steps: Vec<f64> = y.windows(2).map(|p| p[1] - p[0]).collect();
    let jumps: Vec<usize> = (0..steps.len())
        .filter(|k| steps[*k].abs() > JUMP * range)
        .collect();
    if jumps.is_empty() || jumps.len() as f64 > MOST * y.len() as f64 {
        return None;
    }
    let jumped = |k: usize| steps[k].abs() > JUMP * range;
    if (0..steps.len()).any(|k| !jumped(k) && steps[k].abs() > 0.5 * JUMP * range) {
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
    let listed = TURNS
        .iter()
        .copied()
        .min_by(|a, b| (a / seen).ln().abs().total_cmp(&(b / seen).ln().abs()))
        .filter(|t| (t / seen - 1.0).abs() < TOLERANCE);
    let period = listed.or((jumps.len() >= 3).then_some(seen))?;
    // Within a turn it is all that there is.
    if range > (1.0 + TOLERANCE) * period {
        return None;
    }
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
    let before = mean_square_difference(y, s);
    let options = (jumps(y), jumps(s));
    let tried = |recorded: Option<&Wrap>, simulated: Option<&Wrap>| {
        let y = recorded.map_or(y, |w| &w.unwrapped);
        let s = simulated.map_or(s, |w| &w.unwrapped);
        mean_square_difference(y, s)
    };
    let (a, b) = (options.0.as_ref(), options.1.as_ref());
    let best = [(a, None), (None, b), (a, b)]
        .into_iter()
        .filter(|(a, b)| a.is_some() || b.is_some())
        .min_by(|x, y| tried(x.0, x.1).total_cmp(&tried(y.0, y.1)));
    let Some((recorded, simulated)) = best else {
        return (None, None);
    };
    if tried(recorded, simulated) > BETTER * before {
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
    let mut apart: Vec<f64> = now_s.iter().zip(now_y).map(|(s, y)| s - y).collect();
    let whole = (median(&mut apart) / period).round() * period;
    if let Some(w) = &mut recorded {
        w.unwrapped.iter_mut().for_each(|v| *v += whole);
    } else if let Some(w) = &mut simulated {
        w.unwrapped.iter_mut().for_each(|v| *v -= whole);
    }
    (recorded, simulated)
}

/// About the mean: turns that were made before say nothing.
fn mean_square_difference(y: &[f64], s: &[f64]) -> f64 {
    let n = y.len().max(1) as f64;
    let mean = y.iter().zip(s).map(|(y, s)| y - s).sum::<f64>() / n;
    y.iter()
        .zip(s)
        .map(|(y, s)| (y - s - mean).powi(2))
        .sum::<f64>()
        / n
}

fn range(y: &[f64]) -> f64 {
    let ends = y
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(*v), hi.max(*v))
        });
    ends.1 - ends.0
}
