//! A run from sample to sample: inputs, corrections of an observer, and the steps of a plan replayed with slopes.

use super::dual::Dual;
use super::field::Field;
use super::linear::Propagator;
use super::run::{Direction, Excitation, Observer};
use super::step::{Accuracy, Stages};

/// Stages of a run with slopes are solved to this part of their move: below the error of any step.
const REPLAYED: f64 = 1e-9;
/// The finest step is `2^-FINEST` of a sample; a jump is passed with an error of that size.
pub(super) const FINEST: u8 = 26;
/// Bit of a step that says that it is implicit.
pub(super) const IMPLICIT: u8 = 0x80;

/// Where a run stands.
pub(super) struct Integrator<'a, const M: usize> {
    pub(super) field: Field<'a, M>,
    pub(super) stages: Stages<M>,
    pub(super) x: Vec<Dual<M>>,
    pub(super) first: Vec<Dual<M>>,
    pub(super) next: Vec<Dual<M>>,
    /// Parts of a sample between the jumps of delayed inputs: start and length, in seconds.
    pub(super) parts: Vec<(Dual<M>, Dual<M>)>,
    /// For a plant that is linear in its states.
    pub(super) propagator: Option<Propagator<M>>,
}

impl<const M: usize> Integrator<'_, M> {
    /// Takes the inputs of a sample and evaluates it.
    pub(crate) fn sample(&mut self, k: usize, excitation: &Excitation) {
        self.field.begin(k);
        self.field.part(None);
        let now = Dual::constant(excitation.time(k));
        self.field.evaluate_all(&now, &self.x, &mut self.first);
        if k == 0 {
            self.field.remember(now.value);
        }
    }

    /// Corrects the states as the observer does, and evaluates again.
    pub(crate) fn correct(
        &mut self,
        k: usize,
        excitation: &Excitation,
        observer: Option<&Observer>,
        outputs: &[usize],
        directions: &[Direction],
    ) {
        let Some(observer) = observer else { return };
        for (j, &slot) in outputs.iter().enumerate() {
            let y = self.field.frame.slot[slot];
            let mut error = Dual::constant(0.0).plus(-1.0, &y);
            error.value += observer.recorded[j][k];
            if !error.value.is_finite() {
                continue; // a sample that is missing corrects nothing
            }
            for (i, x) in self.x.iter_mut().enumerate() {
                *x = x.plus(observer.gain[(i, j)], &error);
                if let Some(lane) = directions.iter().position(|&d| d == Direction::Gain(i, j)) {
                    x.slope[lane] += error.value;
                }
            }
        }
        self.field.evaluate(
            &Dual::constant(excitation.time(k)),
            &self.x,
            &mut self.first,
        );
    }

    /// To the next sample by matrices, where the plant is linear in its states; false where it is not.
    pub(crate) fn propagate(&mut self, k: usize, excitation: &Excitation) -> bool {
        let Some(propagator) = &mut self.propagator else {
            return false;
        };
        let (x, room) = (&mut self.x, &mut self.next);
        propagator.advance(
            &mut self.field,
            excitation.time(k + 1),
            x,
            &self.first,
            room,
        );
        true
    }

    /// Begins a part of the sample at an instant, by its place among the parts; its start and length.
    pub(crate) fn begin_part(&mut self, part: usize, sample: f64) -> (Dual<M>, Dual<M>) {
        let (mut start, length) = self.parts[part];
        start.value += sample;
        // Without delays it was evaluated with the sample.
        if !self.field.tape.delays.is_empty() {
            self.field.part(Some(part));
            self.field.evaluate(&start, &self.x, &mut self.first);
        }
        (start, length)
    }

    pub(crate) fn replay(
        &mut self,
        k: usize,
        excitation: &Excitation,
        steps: &mut impl Iterator<Item = u8>,
        scale: &[f64],
    ) {
        for part in 0..self.parts.len() {
            let (start, length) = &self.begin_part(part, excitation.time(k));
            let mut place = 0u32;
            while place < 1 << FINEST {
                let Some(step) = steps.next() else { return };
                let size = 1u32 << (FINEST - (step & !IMPLICIT));
                let share = |n: u32| f64::from(n) / f64::from(1u32 << FINEST);
                let time = start.plus(share(place), length);
                let part = Dual::constant(0.0).plus(share(size), length);
                if step & IMPLICIT == 0 {
                    self.stages.explicit(
                        &mut self.field,
                        &time,
                        &part,
                        &self.x,
                        &self.first,
                        &mut self.next,
                    );
                } else {
                    self.stages.implicit(
                        &mut self.field,
                        &time,
                        &part,
                        &self.x,
                        &Accuracy {
                            absolute: scale,
                            relative: REPLAYED,
                        },
                        &mut self.next,
                    );
                }
                std::mem::swap(&mut self.x, &mut self.next);
                place += size;
                if place < 1 << FINEST || self.field.remembers() {
                    let end = start.plus(share(place), length);
                    self.field.evaluate(&end, &self.x, &mut self.first);
                    self.field.remember(end.value);
                }
            }
        }
    }
}
