//! Which cases a study draws, and their answers.

use std::path::Path;
use std::str::FromStr;

use rayon::prelude::*;

use super::answer::{Answer, without};
use crate::concealed::dice::Dice;
use crate::concealed::effect::PAIRS;
use crate::concealed::{Case, Drawing, Effect, Kind, draw};

/// How many of each.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    pub seed: u64,
    pub samples: usize,
    /// Cases that conceal effects that the library lists.
    pub effects: usize,
    /// Cases that conceal nothing.
    pub nulls: usize,
    /// Cases that are asked again with the truth taken out of the library.
    pub left_out: usize,
    /// Cases that conceal an effect that no library lists.
    pub unlisted: usize,
}

/// The answers of a study.
#[derive(Debug, Default)]
pub struct Answers {
    pub effects: Vec<Answer>,
    pub nulls: Vec<Answer>,
    pub left_out: Vec<Answer>,
    pub unlisted: Vec<Answer>,
}

fn variable<T: FromStr>(name: &str) -> Option<T> {
    let text = std::env::var(name).ok()?;
    let parsed = text.parse().ok();
    assert!(parsed.is_some(), "{name} is `{text}`, which cannot be read");
    parsed
}

impl Plan {
    /// The default, with what the environment changes of it.
    pub fn from_environment() -> Self {
        let effects = variable("INNOVANT_CONCEALED_CASES").unwrap_or(36);
        Self {
            seed: variable("INNOVANT_CONCEALED_SEED").unwrap_or(2026),
            samples: variable("INNOVANT_CONCEALED_SAMPLES").unwrap_or(2000),
            effects,
            nulls: variable("INNOVANT_CONCEALED_NULLS").unwrap_or(effects * 3 / 5),
            left_out: variable("INNOVANT_CONCEALED_LEFT_OUT")
                .map_or(effects / 5, |n: usize| n.min(effects)),
            unlisted: effects / 10,
        }
    }

    /// Kinds come round evenly, in an order that the seed shuffles: a larger study begins with the smaller one.
    fn wheel(&self) -> Vec<Kind> {
        let mut wheel: Vec<Kind> = Effect::ALL
            .iter()
            .filter(|effect| effect.is_listed())
            .map(|effect| Kind::Effect(*effect))
            .chain(PAIRS.map(|[first, second]| Kind::Both(first, second)))
            .collect();
        Dice::new(self.seed, u64::MAX).shuffle(&mut wheel);
        wheel
    }

    /// Draws, asks, scores; every third case that conceals an effect and every second null is a hard one.
    pub fn run(&self) -> Answers {
        const NULLS_FROM: usize = 100_000;
        const UNLISTED_FROM: usize = 200_000;
        #[derive(Clone, Copy)]
        enum Task {
            Effect(usize),
            Null(usize),
            Unlisted(usize),
        }
        let wheel = self.wheel();
        let unknown: Vec<Effect> = Effect::ALL
            .iter()
            .copied()
            .filter(|e| !e.is_listed())
            .collect();
        let tasks: Vec<Task> = (0..self.effects)
            .map(Task::Effect)
            .chain((0..self.nulls).map(Task::Null))
            .chain((0..self.unlisted).map(Task::Unlisted))
            .collect();
        let drawing = |kind: Kind, hard: bool| Drawing {
            kind,
            hard,
            samples: self.samples,
            ..Drawing::default()
        };
        // A folder for the cases that were not answered rightly, in the layout of `data/concealed`.
        let folder: Option<String> = variable("INNOVANT_CONCEALED_FOLDER");
        let ask = |index: usize, label: String, case: &Case| {
            let answer = Answer::to(label, case, &[]);
            if let (Some(folder), false) = (&folder, answer.is_right()) {
                case.write(Path::new(folder), index).unwrap();
            }
            answer
        };
        let done: Vec<(Task, Answer, Option<Answer>)> = tasks
            .into_par_iter()
            .with_max_len(1)
            .map(|task| match task {
                Task::Effect(i) => {
                    let case = draw(
                        self.seed,
                        i,
                        &drawing(wheel[i % wheel.len()], is_hard(i, wheel.len())),
                    );
                    let again = (i < self.left_out)
                        .then(|| Answer::to(format!("left out {i}"), &case, &without(&case.truth)));
                    (task, ask(i, format!("effect {i}"), &case), again)
                }
                Task::Null(i) => {
                    let index = NULLS_FROM + i;
                    let case = draw(self.seed, index, &drawing(Kind::Null, i % 2 == 1));
                    (task, ask(index, format!("null {i}"), &case), None)
                }
                Task::Unlisted(i) => {
                    let kind = Kind::Effect(unknown[i % unknown.len()]);
                    let index = UNLISTED_FROM + i;
                    let case = draw(self.seed, index, &drawing(kind, false));
                    (task, ask(index, format!("unlisted {i}"), &case), None)
                }
            })
            .collect();
        let mut answers = Answers::default();
        for (task, answer, again) in done {
            match task {
                Task::Effect(_) => answers.effects.push(answer),
                Task::Null(_) => answers.nulls.push(answer),
                Task::Unlisted(_) => answers.unlisted.push(answer),
            }
            answers.left_out.extend(again);
        }
        answers
    }
}

/// Every third case, others in each round of the wheel.
fn is_hard(index: usize, round: usize) -> bool {
    (index + index / round) % 3 == 2
}
