//! Texts of plants with parts exchanged, repeated and left out: whatever comes out is read, compared, simulated or refused
//! with a message, in little time.
//!
//! `INNOVANT_MUTATIONS` sets how many texts are tried (default 400), `INNOVANT_SEED_TEXTS` a further folder of texts.

use innovant::physics::{
    Excitation, Hold, Plant, VariableKind, check_units, diagnose, parse, unknown_units,
};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time for one text, with room for a busy machine and a build without optimisation: a speed of 1e9 m/s against a cubic
/// spring takes very many steps.
const LONGEST: Duration = Duration::from_secs(120);

/// Parts that the grammar knows, beside those of the texts themselves.
const PARTS: [&str; 36] = [
    ";",
    "=",
    "(",
    ")",
    ",",
    "+",
    "-",
    "*",
    "/",
    "^",
    "<",
    ">=",
    "==",
    "if",
    "then",
    "else",
    "elseif",
    "and",
    "not",
    "der",
    "delay",
    "time",
    "sign",
    "sqrt",
    "exp",
    "min",
    "abs",
    "equation",
    "end",
    "Real",
    "parameter",
    "output",
    "0",
    "1e308",
    "1e-300",
    "-1",
];

fn texts(folder: &Path, into: &mut Vec<PathBuf>, depth: usize) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for path in entries.flatten().map(|e| e.path()) {
        if path.is_dir() && depth > 0 {
            texts(&path, into, depth - 1);
        } else if path.extension().is_some_and(|e| e == "mo") {
            into.push(path);
        }
    }
}

/// A sequence that is the same in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % count.max(1) as u64) as usize
    }
}

/// Words, numbers, signs and blanks, one after the other.
fn split(text: &str) -> Vec<&str> {
    let kind = |c: char| {
        if c.is_alphanumeric() || matches!(c, '_' | '.') {
            1
        } else if c.is_whitespace() {
            2
        } else {
            0
        }
    };
    let mut parts = vec![];
    let mut start = 0;
    let mut last = None;
    for (at, c) in text.char_indices() {
        let this = kind(c);
        if at > start && (this == 0 || last != Some(this)) {
            parts.push(&text[start..at]);
            start = at;
        }
        last = Some(this);
    }
    parts.push(&text[start..]);
    parts
}

/// Puts another number in the place of a number, or another word of the text in the place of a word.
fn exchange_alike(parts: &mut [&str], dice: &mut Dice) {
    const NUMBERS: [&str; 10] = [
        "0", "1", "2", "3", "0.5", "1e-9", "1e9", "1e308", "1e-300", "10",
    ];
    let kind = |part: &str| {
        part.chars()
            .next()
            .map(|c| (c.is_ascii_digit(), c.is_alphabetic()))
    };
    let at = dice.below(parts.len());
    match kind(parts[at]) {
        Some((true, _)) => parts[at] = NUMBERS[dice.below(NUMBERS.len())],
        Some((_, true)) => {
            let from = dice.below(parts.len());
            if kind(parts[from]) == kind(parts[at]) {
                parts[at] = parts[from];
            }
        }
        _ => {
            const SIGNS: [&str; 5] = ["+", "-", "*", "/", "^"];
            if SIGNS.contains(&parts[at]) {
                parts[at] = SIGNS[dice.below(SIGNS.len())];
            }
        }
    }
}

/// A text with one to six changes.
fn changed(text: &str, other: &str, dice: &mut Dice) -> String {
    let mut parts = split(text);
    let donor = split(other);
    // Half of the texts keep their form, so that many are plants still and are simulated.
    if dice.below(2) == 0 {
        for _ in 0..=dice.below(3) {
            exchange_alike(&mut parts, dice);
        }
        return parts.concat();
    }
    for _ in 0..=dice.below(6) {
        if parts.is_empty() {
            break;
        }
        let (at, from) = (dice.below(parts.len()), dice.below(parts.len()));
        match dice.below(8) {
            0 => drop(parts.remove(at)),
            1 => parts.insert(at, parts[from]),
            2 => parts.swap(at, from),
            3 => parts[at] = PARTS[dice.below(PARTS.len())],
            4 => parts.insert(at, PARTS[dice.below(PARTS.len())]),
            5 => parts[at] = parts[from],
            6 => {
                let length = dice.below(12);
                let start = dice.below(donor.len());
                let end = (start + length).min(donor.len());
                parts.splice(at..at, donor[start..end].iter().copied());
            }
            _ => {
                let end = (at + dice.below(12)).min(parts.len());
                drop(parts.drain(at..end));
            }
        }
    }
    parts.concat()
}

/// Everything that a text goes through. True where it is a plant.
fn examine(text: &str) -> bool {
    let all = diagnose(text);
    if let Err(errors) = &all {
        assert!((1..=8).contains(&errors.len()));
        assert!(errors.is_sorted_by_key(|e| (e.line, e.column)));
        assert!(
            errors
                .iter()
                .all(|e| !e.render("plant.mo", text).is_empty())
        );
    }
    let spec = match parse(text) {
        Ok(spec) => spec,
        Err(_) => return false,
    };
    assert_eq!(check_units(&spec).is_ok(), all.is_ok());
    drop(unknown_units(&spec));
    let count = spec.of_kind(VariableKind::State).count();
    let plant = Plant::new(spec);
    let column = [0.0, 1.0, -1.0, 0.5];
    let inputs: Vec<&[f64]> = plant
        .spec
        .inputs()
        .iter()
        .map(|_| column.as_slice())
        .collect();
    let excitation = Excitation {
        inputs: &inputs,
        length: column.len(),
        sample_time: 0.01,
        start_time: 0.0,
        hold: Hold::Zero,
    };
    if let Ok(run) = plant.simulate(&plant.nominal(), &excitation, None) {
        assert!(run.outputs.iter().all(|y| y.len() == column.len()));
    }
    drop(innovant::internal::report::plant_text(&plant));
    assert_eq!(plant.spec.states().len(), count);
    true
}

#[test]
fn no_mutation_of_a_plant_makes_it_panic_or_wait() {
    let mut files = vec![];
    texts(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("data/plants"),
        &mut files,
        0,
    );
    if let Some(folder) = std::env::var_os("INNOVANT_SEED_TEXTS") {
        texts(Path::new(&folder), &mut files, 3);
    }
    files.sort();
    let seeds: Vec<String> = files.iter().flat_map(std::fs::read_to_string).collect();
    assert!(!seeds.is_empty());
    let wanted = std::env::var("INNOVANT_MUTATIONS")
        .ok()
        .and_then(|n| n.parse().ok());
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    let (mut plants, mut slowest) = (0, Duration::ZERO);
    let count = wanted.unwrap_or(400);
    for done in 0..count {
        if done > 0 && done % 5000 == 0 {
            println!("{done} texts, of which {plants} are plants; the slowest took {slowest:?}");
        }
        let (text, other) = (
            &seeds[dice.below(seeds.len())],
            &seeds[dice.below(seeds.len())],
        );
        let text = changed(text, other, &mut dice);
        let start = Instant::now();
        let seen = std::panic::catch_unwind(|| examine(&text));
        let took = start.elapsed();
        assert!(took < LONGEST, "{took:?} for\n{text}");
        match seen {
            Ok(plant) => plants += usize::from(plant),
            Err(_) => panic!("a panic on\n{text}"),
        }
        slowest = slowest.max(took);
    }
    println!("{count} texts, of which {plants} are plants; the slowest took {slowest:?}");
    assert!(plants > count / 50, "{plants} of {count} are plants");
}

#[test]
fn slopes_that_are_no_numbers_give_no_equilibrium() {
    for right in ["sqrt(-2 - x)", "1e308*x*1e10", "1/(x*0)", "x^(-300)*1e300"] {
        let text = format!("model A output Real x(start=0.25); equation der(x) = {right}; end A;");
        assert!(examine(&text), "{text}");
    }
}
