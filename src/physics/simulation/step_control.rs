//! The steps of a run, chosen by their error.
//!
//! Steps are dyadic parts of a sample (or of a part of it between two jumps of a delayed input), each accepted when its result and an
//! embedded one of lower order agree. Where the explicit method needs many steps in a sample, the implicit one takes over. Across a switch
//! (`sign`, a comparison) steps are shortened until they resolve its ramp.

use nalgebra::{Complex, DMatrix, DVector, Schur};

use super::dual::Dual;
use super::field::Field;
use super::integrator::{FINEST, IMPLICIT, Integrator};
use super::plant::{Plant, SimulationError};
use super::run::{Excitation, Plan};
use super::step::{Accuracy, growth};
use super::tape::{SwitchSlots, Tape};

/// Error of one step that is allowed, as a part of how far a state has moved so far. Errors add up along the recording; with
/// this value the answers of 64 plants of eight kinds are within 1e-6 of their range (`tests/plants/physics_simulate.rs`).
pub(super) const STEP_ACCURACY: f64 = 1e-8;
/// Below this depth errors may double with every halving: they are those of jumps and contacts.
const RARE: u8 = 8;
/// ... but not more often than this.
const MOST_DOUBLED: u8 = 4;
/// The embedded results are of one order less than the steps: their errors may be so many times larger.
const EMBEDDED: f64 = 10.0;
/// A state that hardly moves about a large value is computed to this part of [`STEP_ACCURACY`] of that value.
const OF_LEVEL: f64 = 1e-5;
/// Error of a step from rest, as a part of the step: what starts to move has no scale yet.
const FIRST_ACCURACY: f64 = 1e-5;
/// Steps of Euler's that foresee how far a state moves in its first sample.
const FORESEEN: usize = 4;
/// The finest step of the run that only finds the size of the arguments of switches.
const ROUGH: u8 = 8;
/// The explicit method gives way to the implicit one where it would need `2^STIFF` steps in a sample.
const STIFF: u8 = 7;
/// Step times rate up to which the explicit method is stable: for rates that are real, and in all directions.
const STABLE: f64 = 3.25;
const STABLE_IN_ALL: f64 = 0.99;
/// A Jacobian that differs by this part from another has its rates.
const SAME_RATES: f64 = 0.05;
/// Where the explicit method is far from its limit, its rates are computed in every so many samples only.
const SELDOM: usize = 8;
/// ... which is below this part of the limit.
const FAR: f64 = 0.25;
/// Squares of a Jacobian that bound its eigenvalues.
const SQUARINGS: i32 = 3;
/// Iterations for the eigenvalues of a Jacobian.
const EIGENVALUES: usize = 1000;
/// An implicit step costs about as much as so many explicit ones.
pub(super) const IMPLICIT_COST: usize = 4;
/// A run that may take so many steps a sample may take those of so many samples more at any time: what is hopeless ends early.
const GRACE: usize = 200;
/// After so many stiff samples the explicit method is tried again.
const AGAIN: usize = 32;
/// Half width of the ramp of a switch, as a part of the largest value of its argument: far below what a recording shows.
const RAMP: f64 = 1e-5;
/// The same for switches at a time.
const RAMP_IN_TIME: f64 = 1e-7;
/// A ramp is passed in steps of at most this part of its half width.
const RAMP_STEP: f64 = 0.5;

/// Chooses the steps of a run.
pub(super) struct StepControl<'p> {
    plant: &'p Plant,
    steps: Vec<u8>,
    /// Samples and attempts so far, and how many attempts there may be.
    samples: usize,
    attempts: usize,
    most_attempts: usize,
    /// Attempts a sample that there may be at any time of the run, where a run is refused that needs more.
    most_a_sample: Option<usize>,
    depth: u8,
    implicit: bool,
    /// Samples in which the implicit method was used.
    stiff_samples: usize,
    origin: Vec<f64>,
    spread: Vec<f64>,
    /// How far each state that has not moved yet would move in the sample.
    first_move: Vec<f64>,
    /// Error that is allowed, and that there is.
    allowed: Vec<f64>,
    error: Vec<f64>,
    /// Error of a step as a part of how far a state has moved.
    tolerance: f64,
    /// No mode is faster than this, in 1/s; the Jacobian that says so, and the rates of its modes that decay once they are needed.
    fastest: f64,
    examined: Vec<f64>,
    decaying: Option<Vec<Complex<f64>>>,
    /// Sample at which the rates are computed again.
    examined_again: usize,
    /// Largest argument of each switch so far.
    largest: Vec<f64>,
    /// True when the ramps are to be found.
    rough: bool,
    end: Vec<Dual<0>>,
    rates: Vec<f64>,
    jacobian: Vec<f64>,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// The largest error, as a multiple of what is allowed.
fn worst(error: &[f64], allowed: &[f64]) -> f64 {
    let each = error.iter().zip(allowed).map(|(e, a)| (e / a).abs());
    each.fold(
        0.0,
        |w, e| if e.is_nan() { f64::INFINITY } else { w.max(e) },
    )
}

/// Largest sum of a row of a matrix, each state in units of `scale`.
fn norm(matrix: &[f64], scale: &[f64]) -> f64 {
    let rows = matrix.chunks(scale.len().max(1)).zip(scale);
    rows.map(|(row, s)| {
        row.iter()
            .zip(scale)
            .map(|(a, t)| (a * t / s).abs())
            .sum::<f64>()
    })
    .fold(0.0, f64::max)
}

/// A bound of the eigenvalues of a matrix: `|A^8|^(1/8)`, which is close to the largest (Gelfand's formula).
fn fastest_rate(matrix: &[f64], scale: &[f64]) -> f64 {
    let n = scale.len();
    let size = norm(matrix, scale);
    if size == 0.0 || !size.is_finite() {
        return size;
    }
    let mut power: Vec<f64> = matrix.iter().map(|a| a / size).collect();
    let mut square = vec![0.0; n * n];
    for _ in 0..SQUARINGS {
        for (to, row) in square.chunks_mut(n).zip(power.chunks(n)) {
            to.fill(0.0);
            for (factor, b) in row.iter().zip(power.chunks(n)) {
                to.iter_mut().zip(b).for_each(|(to, b)| *to += factor * b);
            }
        }
        std::mem::swap(&mut power, &mut square);
    }
    size * norm(&power, scale).powf(0.5f64.powi(SQUARINGS))
}

/// How an attempt at a step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Attempt {
    /// Its error, as a multiple of what is allowed.
    Error(f64),
    /// It passes a switch in too large a step.
    Switch,
}

impl<'p> StepControl<'p> {
    pub(crate) fn new(
        plant: &'p Plant,
        integrator: &Integrator<0>,
        rough: bool,
        most_attempts: usize,
    ) -> Self {
        let n = integrator.x.len();
        let room = vec![Dual::constant(0.0); n];
        Self {
            plant,
            steps: Vec::new(),
            samples: 0,
            attempts: 0,
            most_attempts,
            most_a_sample: plant.most_steps,
            depth: 0,
            implicit: false,
            stiff_samples: 0,
            origin: integrator.x.iter().map(|x| x.value).collect(),
            spread: vec![0.0; n],
            first_move: vec![0.0; n],
            allowed: vec![0.0; n],
            error: vec![0.0; n],
            tolerance: plant.accuracy,
            fastest: 0.0,
            examined: Vec::new(),
            decaying: None,
            examined_again: 0,
            largest: vec![0.0; plant.tape.switches.len()],
            rough,
            end: room,
            rates: vec![0.0; n],
            jacobian: vec![0.0; n * n],
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    /// Steps tried so far; an implicit one counts as several where a run is limited.
    pub(crate) fn attempts(&self) -> usize {
        self.attempts
    }

    /// The steps, with the ramps that they resolve; after a rough run those for the arguments seen.
    pub(crate) fn plan(self, tape: &Tape, used: &[f64]) -> Plan {
        let found = |(largest, s): (&f64, &SwitchSlots)| match (s.moves, s.of_states) {
            (false, _) => 0.0,
            (true, true) => RAMP * largest,
            (true, false) => RAMP_IN_TIME * largest,
        };
        let widths = if self.rough {
            self.largest.iter().zip(&tape.switches).map(found).collect()
        } else {
            used.to_vec()
        };
        Plan {
            steps: self.steps,
            widths,
        }
    }

    /// From a sample to the next.
    pub(crate) fn advance(
        &mut self,
        integrator: &mut Integrator<0>,
        k: usize,
        excitation: &Excitation,
    ) -> Result<(), SimulationError> {
        for (s, (x, o)) in self
            .spread
            .iter_mut()
            .zip(integrator.x.iter().zip(&self.origin))
        {
            *s = s.max((x.value - o).abs());
        }
        integrator.field.switches(&mut self.before);
        for (l, z) in self.largest.iter_mut().zip(&self.before) {
            *l = l.max(z.abs()).min(f64::MAX);
        }
        if self.rough {
            for (w, (l, s)) in integrator
                .field
                .frame
                .width
                .iter_mut()
                .zip(self.largest.iter().zip(&self.plant.tape.switches))
            {
                *w = if s.moves { 1e3 * RAMP * l } else { 0.0 };
            }
        }
        if self.spread.contains(&0.0) {
            self.foresee(integrator, k, excitation);
        }
        if self.implicit {
            self.stiff_samples += 1;
            if self.stiff_samples.is_multiple_of(AGAIN) {
                (self.implicit, self.depth) = (false, STIFF - 2);
            }
        }
        self.samples = k + 1;
        if k >= self.examined_again {
            self.examine(integrator, excitation.time(k), excitation.sample_time);
        }
        for part in 0..integrator.parts.len() {
            let (start, length) = integrator.begin_part(part, excitation.time(k));
            self.part(integrator, &start, &length)?;
        }
        Ok(())
    }

    /// Scale of states that have not moved yet: a few linearly implicit steps of Euler's over the sample. One would not reach
    /// the states that move only when others have.
    fn foresee(&mut self, integrator: &mut Integrator<0>, k: usize, excitation: &Excitation) {
        let n = integrator.x.len();
        let start: Vec<f64> = integrator.x.iter().map(|x| x.value).collect();
        let (mut x, mut f, mut jacobian) = (start.clone(), vec![0.0; n], vec![0.0; n * n]);
        let h = excitation.sample_time / FORESEEN as f64;
        for part in 0..FORESEEN {
            let time = excitation.time(k) + part as f64 * h;
            let time = Dual::constant(time);
            integrator.field.linearise(&time, &x, &mut f, &mut jacobian);
            let matrix = DMatrix::from_fn(n, n, |i, j| f64::from(i == j) - h * jacobian[i * n + j]);
            let right = DVector::from_iterator(n, f.iter().map(|f| h * f));
            let Some(moved) = matrix.lu().solve(&right) else {
                break;
            };
            x.iter_mut().zip(&moved).for_each(|(x, m)| *x += m);
        }
        for (first, (x, start)) in self.first_move.iter_mut().zip(x.iter().zip(&start)) {
            let moved = (x - start).abs();
            *first = if moved.is_finite() { moved } else { 0.0 };
        }
    }

    /// Finds the rates that limit an explicit step. The stages of a step do not show those of modes at rest, whose values stay there by
    /// chance and whose slopes grow.
    fn examine(&mut self, integrator: &mut Integrator<0>, time: f64, sample_time: f64) {
        self.allow(integrator, 0);
        let x: Vec<f64> = integrator.x.iter().map(|x| x.value).collect();
        let time = Dual::constant(time);
        (integrator.field).linearise(&time, &x, &mut self.rates, &mut self.jacobian);
        if !self.has_the_same_rates() {
            let fastest = fastest_rate(&self.jacobian, &self.allowed);
            self.fastest = if fastest.is_finite() { fastest } else { 0.0 };
            self.examined.clone_from(&self.jacobian);
            self.decaying = None;
        }
        let far = sample_time * self.fastest < FAR * STABLE_IN_ALL;
        self.examined_again = self.samples - 1 + if far { SELDOM } else { 1 };
    }

    /// Whether the Jacobian is that which was examined last, or close to it.
    fn has_the_same_rates(&self) -> bool {
        let n = self.allowed.len();
        if self.examined.len() != n * n {
            return false;
        }
        let both = self.jacobian.iter().zip(&self.examined);
        let change: Vec<f64> = both.map(|(now, before)| now - before).collect();
        norm(&change, &self.allowed) <= SAME_RATES * norm(&self.examined, &self.allowed)
    }

    /// Whether an explicit step damps every mode that decays.
    fn damps(&mut self, step: f64) -> bool {
        if step * self.fastest <= STABLE_IN_ALL {
            return true;
        }
        let n = self.allowed.len();
        let decaying = self.decaying.get_or_insert_with(|| {
            let jacobian = DMatrix::from_row_slice(n, n, &self.examined);
            let schur = Schur::try_new(jacobian, f64::EPSILON, EIGENVALUES);
            let rates = schur.map(|schur| schur.complex_eigenvalues());
            let rates = rates.iter().flat_map(|rates| rates.iter().copied());
            rates.filter(|rate| rate.re < 0.0).collect()
        });
        let mut rates = decaying.iter();
        rates.all(|&rate| growth(rate * step).norm() <= 1.0)
    }

    fn part(
        &mut self,
        integrator: &mut Integrator<0>,
        start: &Dual<0>,
        length: &Dual<0>,
    ) -> Result<(), SimulationError> {
        let whole = 1u32 << FINEST;
        let coarsest = (length.value / integrator.field.shortest_delay())
            .log2()
            .ceil()
            .clamp(0.0, f64::from(FINEST)) as u8;
        let share = |n: u32| f64::from(n) / f64::from(whole);
        let mut place = 0u32;
        let mut depth = self.depth.max(coarsest);
        if length.value <= 0.0 {
            self.steps.push(0);
            return Ok(());
        }
        let finest = if self.rough {
            coarsest.max(ROUGH)
        } else {
            FINEST
        };
        integrator.field.switches(&mut self.before);
        while place < whole {
            while !place.is_multiple_of(1 << (FINEST - depth)) {
                depth += 1;
            }
            let size = 1u32 << (FINEST - depth);
            let time = start.plus(share(place), length);
            let step = share(size) * length.value;
            let attempt = self.attempt(integrator, &time, step, depth);
            self.attempts += match self.most_a_sample {
                Some(_) if self.implicit => IMPLICIT_COST,
                _ => 1,
            };
            let allowed = self
                .most_a_sample
                .map_or(usize::MAX, |most| most.saturating_mul(self.samples + GRACE));
            if self.attempts > self.most_attempts.min(allowed) {
                return Err(SimulationError::TooFast {
                    time: time.value,
                    steps: self.attempts,
                    samples: self.samples,
                });
            }
            let accepted = matches!(attempt, Attempt::Error(e) if e <= 1.0);
            if !accepted && depth < finest {
                depth += 1;
                if !self.implicit && depth >= STIFF && matches!(attempt, Attempt::Error(_)) {
                    self.implicit = true;
                    depth = coarsest.max(depth - 5);
                }
                continue;
            }
            if !accepted && self.implicit {
                self.implicit = false;
                continue;
            }
            if integrator.next.iter().any(|x| !x.value.is_finite()) {
                return Err(self.locate(integrator, &time, step));
            }
            self.steps
                .push(depth | if self.implicit { IMPLICIT } else { 0 });
            std::mem::swap(&mut integrator.x, &mut integrator.next);
            place += size;
            std::mem::swap(&mut integrator.first, &mut self.end);
            // The frame stands at the end of the step that was accepted; after a rejected one it would not.
            integrator.field.switches(&mut self.before);
            integrator
                .field
                .remember(start.plus(share(place), length).value);
            // A step twice as long has 16 to 32 times the error.
            if matches!(attempt, Attempt::Error(e) if e < 1.0 / 40.0) && depth > coarsest {
                depth -= 1;
            }
        }
        self.depth = depth.min(STIFF + 3);
        Ok(())
    }

    /// One step, left in `integrator.next`, with the derivative at its end in `self.end`, and its error.
    fn attempt(
        &mut self,
        integrator: &mut Integrator<0>,
        time: &Dual<0>,
        step: f64,
        depth: u8,
    ) -> Attempt {
        let (whole, one) = (Dual::constant(step), Dual::constant(1.0));
        self.allow(integrator, depth);
        let Integrator {
            field,
            stages,
            x,
            first,
            next,
            ..
        } = integrator;
        let end = time.plus(step, &one);
        let error = if self.implicit {
            let accuracy = Accuracy {
                absolute: &self.allowed,
                relative: self.tolerance,
            };
            if !stages.implicit(field, time, &whole, x, &accuracy, next) {
                return Attempt::Error(f64::INFINITY);
            }
            self.allow_moved(x, next);
            stages.embedded_error(step, &mut self.error);
            field.evaluate(&end, next, &mut self.end);
            worst(&self.error, &self.allowed) / EMBEDDED
        } else {
            if !self.damps(step) {
                return Attempt::Error(f64::INFINITY);
            }
            stages.explicit(field, time, &whole, x, first, next);
            field.evaluate(&end, next, &mut self.end);
            self.allow_moved(x, next);
            let mut stiffness = stages.stiffness(step, next, &self.end, &self.allowed);
            let switches = self.plant.tape.switches.iter().enumerate();
            let on_a_ramp = switches
                .filter(|(_, s)| s.moves)
                .any(|(i, _)| self.before[i].abs() < field.frame.width[i]);
            if stiffness.is_nan() || on_a_ramp {
                // At rest the stages show nothing.
                field.linearise(
                    time,
                    &x.iter().map(|x| x.value).collect::<Vec<_>>(),
                    &mut self.rates,
                    &mut self.jacobian,
                );
                stiffness = step * norm(&self.jacobian, &self.allowed);
            }
            if stiffness > STABLE {
                return Attempt::Error(f64::INFINITY);
            }
            stages.explicit_error(step, first, &self.end, &mut self.error);
            worst(&self.error, &self.allowed) / EMBEDDED
        };
        if error <= 1.0 && !self.rough && self.passes_a_switch(&integrator.field) {
            return Attempt::Switch;
        }
        Attempt::Error(error)
    }

    /// Error that a step at this depth may have, for each state.
    fn allow(&mut self, integrator: &Integrator<0>, depth: u8) {
        // What happens in so small a part of a sample happens rarely; its error does not add up.
        let rare = 2f64.powi(i32::from(depth.saturating_sub(RARE).min(MOST_DOUBLED)));
        for (i, a) in self.allowed.iter_mut().enumerate() {
            let x = integrator.x[i].value;
            let moved = self.spread[i].max((x - self.origin[i]).abs());
            let moved = if self.spread[i] == 0.0 {
                moved.max(self.first_move[i])
            } else {
                moved
            };
            *a = self.tolerance
                * rare
                * moved
                    .max(OF_LEVEL * x.abs())
                    .max(f64::MIN_POSITIVE / self.tolerance);
        }
    }

    /// The same once the end of the step is known: it counts as moved, and what starts to move has no other scale.
    fn allow_moved(&mut self, x: &[Dual<0>], next: &[Dual<0>]) {
        for (i, a) in self.allowed.iter_mut().enumerate() {
            *a = a.max(self.tolerance * (next[i].value - self.origin[i]).abs());
            if self.spread[i] == 0.0 {
                *a = a.max(FIRST_ACCURACY * (next[i].value - x[i].value).abs());
            }
        }
    }

    /// Whether a step that ends where the frame stands crosses a ramp that it does not resolve.
    fn passes_a_switch(&mut self, field: &Field<0>) -> bool {
        field.switches(&mut self.after);
        let switches = self.plant.tape.switches.iter().enumerate();
        switches.filter(|(_, s)| s.moves).any(|(i, _)| {
            let (a, b, w) = (self.before[i], self.after[i], field.frame.width[i]);
            let beyond = a.min(b) >= w || a.max(b) <= -w;
            let within = a.abs() <= w && b.abs() <= w;
            !beyond && !within && (b - a).abs() > RAMP_STEP * w
        })
    }

    /// Where a step that has no end goes wrong.
    fn locate(&self, integrator: &mut Integrator<0>, time: &Dual<0>, step: f64) -> SimulationError {
        let x = integrator.x.clone();
        let mut point = x.clone();
        let mut k = integrator.first.clone();
        for part in [0.0, 0.5, 1.0] {
            for (p, (x, k)) in point.iter_mut().zip(x.iter().zip(&k)) {
                *p = x.plus(part * step, k);
            }
            integrator.field.evaluate(
                &time.plus(part * step, &Dual::constant(1.0)),
                &point,
                &mut k,
            );
            if let Some(error) = self.plant.not_a_number(integrator, time.value) {
                return error;
            }
        }
        let worst = x
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()));
        self.plant
            .diverged(integrator, time.value, worst.map_or(0, |w| w.0))
    }
}
