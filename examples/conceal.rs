//! Writes a folder of concealed-effect cases: `conceal OUT_DIR --seed 1 --cases 120 [--hard] [--nulls 12]
//! [--unlisted 8] [--samples 4000] [--digits 9] [--only EFFECT_ID]`.
//!
//! `--cases` counts all cases; of these, a tenth are nulls and a fifteenth have effects that no library lists,
//! unless said otherwise. `--nulls 200` alone writes nulls only.

use std::path::PathBuf;

use concealed::dice::Dice;
use concealed::effect::PAIRS;
use concealed::{Drawing, Effect, Kind, draw};

#[path = "../tests/concealed/mod.rs"]
mod concealed;

struct Options {
    folder: PathBuf,
    seed: u64,
    cases: Option<usize>,
    nulls: Option<usize>,
    unlisted: Option<usize>,
    only: Option<Effect>,
    drawing: Drawing,
}

fn options() -> Result<Options, Box<dyn std::error::Error>> {
    let mut found = Options {
        folder: PathBuf::new(),
        seed: 1,
        cases: None,
        nulls: None,
        unlisted: None,
        only: None,
        drawing: Drawing::default(),
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || {
            arguments
                .next()
                .ok_or_else(|| format!("{argument} needs a value"))
        };
        match argument.as_str() {
            "--seed" => found.seed = value()?.parse()?,
            "--cases" => found.cases = Some(value()?.parse()?),
            "--nulls" => found.nulls = Some(value()?.parse()?),
            "--unlisted" => found.unlisted = Some(value()?.parse()?),
            "--samples" => found.drawing.samples = value()?.parse()?,
            "--digits" => found.drawing.digits = value()?.parse()?,
            "--hard" => found.drawing.hard = true,
            "--only" => {
                let id = value()?;
                let effect = Effect::ALL.iter().find(|effect| effect.id() == id);
                found.only = Some(*effect.ok_or_else(|| format!("no effect is called {id}"))?);
            }
            other if other.starts_with("--") => return Err(format!("unknown {other}").into()),
            folder => found.folder = folder.into(),
        }
    }
    if found.folder.as_os_str().is_empty() {
        return Err("name a folder".into());
    }
    const FEWEST: usize = 100;
    if found.drawing.samples < FEWEST {
        return Err(format!("--samples must be at least {FEWEST}").into());
    }
    Ok(found)
}

/// The kinds of all cases, shuffled; effects and pairs come round evenly.
fn kinds(options: &Options) -> Vec<Kind> {
    let total = options.cases.or(options.nulls).unwrap_or(120);
    let nulls = options.nulls.unwrap_or(total / 10).min(total);
    let unlisted = options.unlisted.unwrap_or(total / 15).min(total - nulls);
    let effects = total - nulls - unlisted;
    let mut wheel: Vec<Kind> = match options.only {
        Some(effect) => vec![Kind::Effect(effect)],
        None => Effect::ALL
            .iter()
            .filter(|effect| effect.is_listed())
            .map(|effect| Kind::Effect(*effect))
            .chain(PAIRS.map(|[first, second]| Kind::Both(first, second)))
            .collect(),
    };
    let mut dice = Dice::new(options.seed, u64::MAX);
    dice.shuffle(&mut wheel);
    let mut kinds: Vec<Kind> = wheel.into_iter().cycle().take(effects).collect();
    kinds.extend(std::iter::repeat_n(Kind::Null, nulls));
    let unknown = Effect::ALL.iter().filter(|effect| !effect.is_listed());
    kinds.extend(unknown.cycle().take(unlisted).map(|e| Kind::Effect(*e)));
    dice.shuffle(&mut kinds);
    kinds
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = options()?;
    let kinds = kinds(&options);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let results: Vec<Result<(), String>> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|worker| {
                let (options, kinds) = (&options, &kinds);
                scope.spawn(move || {
                    for (index, kind) in kinds.iter().enumerate().skip(worker).step_by(threads) {
                        let drawing = Drawing {
                            kind: *kind,
                            ..options.drawing
                        };
                        draw(options.seed, index, &drawing)
                            .write(&options.folder, index)
                            .map_err(|error| format!("case {index}: {error}"))?;
                    }
                    Ok(())
                })
            })
            .collect();
        workers
            .into_iter()
            .map(|worker| {
                worker
                    .join()
                    .unwrap_or_else(|_| Err("a worker failed".into()))
            })
            .collect()
    });
    for result in results {
        result?;
    }
    eprintln!("{} cases in {}", kinds.len(), options.folder.display());
    Ok(())
}
