//! The steps of a run, chosen by their error.
//!
//! Steps are dyadic parts of a sample (or of a part of it between two jumps of a delayed input), each accepted when one step and
//! two half steps agree. Where the explicit method needs many steps in a sample, the implicit one takes over. Across a switch
//! (`sign`, a comparison) steps are shortened until they resolve its ramp.

use nalgebra::{DMatrix, DVector};

use super::dual::Dual;
use super::simulate::{Excitation, Plan, Plant, SimulationError};
use super::tape::{SwitchSlots, Tape};
use super::walk::{FINEST, IMPLICIT, Walk};

/// Error of one step that is allowed, as a part of how far a state has moved so far. Errors add up along the recording; with
/// this value the answers of 64 plants of eight kinds are within 1e-6 of their range (`tests/physics_simulate.rs`).
pub(super) const STEP_ACCURACY: f64 = 1e-8;
/// A state that hardly moves about a large value is computed to this part of [`STEP_ACCURACY`] of that value.
const OF_LEVEL: f64 = 1e-5;
/// Error of a step from rest, as a part of the step: what starts to move has no scale yet.
const FIRST_ACCURACY: f64 = 1e-5;
/// The explicit method gives way to the implicit one where it would need `2^STIFF` steps in a sample.
const STIFF: u8 = 7;
/// After so many stiff samples the explicit method is tried again.
const AGAIN: usize = 32;
/// Half width of the ramp of a switch, as a part of the largest value of its argument: far below what a recording shows.
const RAMP: f64 = 1e-5;
/// The same for switches at a time.
const RAMP_IN_TIME: f64 = 1e-7;
/// A ramp is passed in steps of at most this part of its half width.
const RAMP_STEP: f64 = 0.5;
/// A run that leaves this has diverged.
const DIVERGED: f64 = 1e9;

/// Chooses the steps of a run.
pub(super) struct Chooser<'p> {
    plant: &'p Plant,
    steps: Vec<u8>,
    depth: u8,
    implicit: bool,
    /// Samples in which the implicit method was used.
    stiff_samples: usize,
    origin: Vec<f64>,
    spread: Vec<f64>,
    /// How far each state that has not moved yet would move in the sample.
    first_move: Vec<f64>,
    accuracy: Vec<f64>,
    /// Largest argument of each switch so far.
    largest: Vec<f64>,
    /// True when the ramps are to be found.
    rough: bool,
    middle: Vec<Dual<0>>,
    half: Vec<Dual<0>>,
    slope: Vec<Dual<0>>,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// How an attempt at a step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Attempt {
    /// Its error, as a multiple of what is allowed.
    Error(f64),
    /// It passes a switch in too large a step.
    Switch,
}

impl<'p> Chooser<'p> {
    pub fn new(plant: &'p Plant, walk: &Walk<0>, rough: bool) -> Self {
        let n = walk.x.len();
        let room = vec![Dual::constant(0.0); n];
        Self {
            plant,
            steps: Vec::new(),
            depth: 0,
            implicit: false,
            stiff_samples: 0,
            origin: walk.x.iter().map(|x| x.value).collect(),
            spread: vec![0.0; n],
            first_move: vec![0.0; n],
            accuracy: vec![0.0; n],
            largest: vec![0.0; plant.tape.switches.len()],
            rough,
            middle: room.clone(),
            half: room.clone(),
            slope: room,
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    /// The steps, and ramps for the arguments seen.
    pub fn plan(self, tape: &Tape) -> Plan {
        let width = |(largest, s): (&f64, &SwitchSlots)| match (s.moves, s.of_states) {
            (false, _) => 0.0,
            (true, true) => RAMP * largest,
            (true, false) => RAMP_IN_TIME * largest,
        };
        Plan {
            steps: self.steps,
            widths: self.largest.iter().zip(&tape.switches).map(width).collect(),
        }
    }

    /// From a sample to the next.
    pub fn advance(
        &mut self,
        walk: &mut Walk<0>,
        k: usize,
        excitation: &Excitation,
    ) -> Result<(), SimulationError> {
        for (s, (x, o)) in self.spread.iter_mut().zip(walk.x.iter().zip(&self.origin)) {
            *s = s.max((x.value - o).abs());
        }
        walk.field.switches(&mut self.before);
        for (l, z) in self.largest.iter_mut().zip(&self.before) {
            *l = l.max(z.abs()).min(f64::MAX);
        }
        if self.rough {
            for (w, (l, s)) in walk
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
            self.foresee(walk, k, excitation);
        }
        if self.implicit {
            self.stiff_samples += 1;
            if self.stiff_samples % AGAIN == 0 {
                (self.implicit, self.depth) = (false, STIFF - 2);
            }
        }
        let parts = walk.parts(k, excitation);
        for (start, length) in &parts {
            walk.begin_part(start, length, k, excitation, parts.len() == 1);
            self.part(walk, start, length)?;
        }
        let limit = |x: f64| !(x.abs() < DIVERGED);
        match walk.x.iter().position(|x| limit(x.value)) {
            Some(i) => Err(self.plant.diverged(walk, excitation.time(k + 1), i)),
            None => Ok(()),
        }
    }

    /// Scale of states that have not moved yet: one linearly implicit step of Euler's over the sample.
    fn foresee(&mut self, walk: &mut Walk<0>, k: usize, excitation: &Excitation) {
        let n = walk.x.len();
        let x: Vec<f64> = walk.x.iter().map(|x| x.value).collect();
        let (mut f, mut jacobian) = (vec![0.0; n], vec![0.0; n * n]);
        walk.field.linearise(
            &Dual::constant(excitation.time(k)),
            &x,
            &mut f,
            &mut jacobian,
        );
        let h = excitation.sample_time;
        let matrix = DMatrix::from_fn(n, n, |i, j| f64::from(i == j) - h * jacobian[i * n + j]);
        let moved = matrix
            .lu()
            .solve(&DVector::from_iterator(n, f.iter().map(|f| h * f)));
        for (i, first) in self.first_move.iter_mut().enumerate() {
            let moved = moved.as_ref().map_or(0.0, |m| m[i].abs());
            *first = if moved.is_finite() { moved } else { 0.0 };
        }
    }

    fn part(
        &mut self,
        walk: &mut Walk<0>,
        start: &Dual<0>,
        length: &Dual<0>,
    ) -> Result<(), SimulationError> {
        let whole = 1u32 << FINEST;
        let coarsest = (length.value / walk.field.shortest_delay())
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
        while place < whole {
            while place % (1 << (FINEST - depth)) != 0 {
                depth += 1;
            }
            let size = 1u32 << (FINEST - depth);
            let time = start.plus(share(place), length);
            let step = share(size) * length.value;
            let attempt = self.attempt(walk, &time, step);
            let accepted = matches!(attempt, Attempt::Error(e) if e <= 1.0);
            if !accepted && depth < FINEST {
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
            if walk.next.iter().any(|x| !x.value.is_finite()) {
                return Err(self.locate(walk, &time, step));
            }
            self.steps
                .push(depth | if self.implicit { IMPLICIT } else { 0 });
            std::mem::swap(&mut walk.x, &mut walk.next);
            place += size;
            let end = start.plus(share(place), length);
            walk.field.evaluate(&end, &walk.x, &mut walk.first);
            walk.field.remember(end.value);
            // A step twice as long has 32 times the error.
            if matches!(attempt, Attempt::Error(e) if e < 1.0 / 40.0) && depth > coarsest {
                depth -= 1;
            }
        }
        self.depth = depth.min(STIFF + 3);
        Ok(())
    }

    /// One step and two half steps; the one step is left in `walk.next`.
    fn attempt(&mut self, walk: &mut Walk<0>, time: &Dual<0>, step: f64) -> Attempt {
        let (whole, half) = (Dual::constant(step), Dual::constant(0.5 * step));
        let middle = time.plus(0.5 * step, &Dual::constant(1.0));
        walk.field.switches(&mut self.before);
        let known = walk
            .x
            .iter()
            .zip(&self.spread)
            .zip(&self.origin)
            .zip(&self.first_move);
        for (a, (((x, s), o), first)) in self.accuracy.iter_mut().zip(known) {
            let moved = s.max((x.value - o).abs());
            let moved = if *s == 0.0 { moved.max(*first) } else { moved };
            *a = STEP_ACCURACY
                * moved
                    .max(OF_LEVEL * x.value.abs())
                    .max(f64::MIN_POSITIVE / STEP_ACCURACY);
        }
        let Walk {
            field,
            stages,
            x,
            first,
            next,
        } = walk;
        if self.implicit {
            // A state that has not moved yet has no scale of its own; Newton's iteration needs one.
            let accuracy: Vec<f64> = self
                .accuracy
                .iter()
                .zip(&*first)
                .map(|(a, f)| a.max(STEP_ACCURACY * (f.value * step).abs()).max(1e-300))
                .collect();
            let solved = stages.implicit(field, time, &whole, x, &accuracy, next)
                && stages.implicit(field, time, &half, x, &accuracy, &mut self.middle)
                && stages.implicit(
                    field,
                    &middle,
                    &half,
                    &self.middle,
                    &accuracy,
                    &mut self.half,
                );
            if !solved {
                next.iter_mut().for_each(|x| x.value = f64::NAN);
                return Attempt::Error(f64::INFINITY);
            }
        } else {
            stages.explicit(field, time, &whole, x, first, next);
            stages.explicit(field, time, &half, x, first, &mut self.middle);
            field.evaluate(&middle, &self.middle, &mut self.slope);
            stages.explicit(
                field,
                &middle,
                &half,
                &self.middle,
                &self.slope,
                &mut self.half,
            );
        }
        let mut error: f64 = 0.0;
        for i in 0..next.len() {
            let mut allowed =
                self.accuracy[i].max(STEP_ACCURACY * (next[i].value - self.origin[i]).abs());
            if self.spread[i] == 0.0 {
                allowed = allowed.max(FIRST_ACCURACY * (next[i].value - x[i].value).abs());
            }
            let e = (next[i].value - self.half[i].value).abs() / allowed;
            error = error.max(if e.is_nan() { f64::INFINITY } else { e });
        }
        let switches = &self.plant.tape.switches;
        if error <= 1.0 && switches.iter().any(|s| s.moves) {
            let end = time.plus(step, &Dual::constant(1.0));
            field.evaluate(&end, next, &mut self.slope);
            field.switches(&mut self.after);
            for (i, _) in switches.iter().enumerate().filter(|(_, s)| s.moves) {
                let (a, b, w) = (self.before[i], self.after[i], field.frame.width[i]);
                let beyond = a.min(b) >= w || a.max(b) <= -w;
                let within = a.abs() <= w && b.abs() <= w;
                if !beyond && !within && (b - a).abs() > RAMP_STEP * w {
                    return Attempt::Switch;
                }
            }
        }
        Attempt::Error(error)
    }

    /// Where a step that has no end goes wrong.
    fn locate(&self, walk: &mut Walk<0>, time: &Dual<0>, step: f64) -> SimulationError {
        let x = walk.x.clone();
        let mut point = x.clone();
        let mut k = walk.first.clone();
        for part in [0.0, 0.5, 1.0] {
            for (p, (x, k)) in point.iter_mut().zip(x.iter().zip(&k)) {
                *p = x.plus(part * step, k);
            }
            walk.field.evaluate(
                &time.plus(part * step, &Dual::constant(1.0)),
                &point,
                &mut k,
            );
            if let Some(error) = self.plant.not_a_number(walk, time.value) {
                return error;
            }
        }
        let worst = x
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()));
        self.plant
            .diverged(walk, time.value, worst.map_or(0, |w| w.0))
    }
}
