//! Writes mutants into source files, each behind a switch.
//!
//! `innovant-mutants ROOT PERCENT SEED LIST FILE...` draws a share of all replacements in the files (relative to ROOT),
//! writes them into the files, and lists them in LIST: number, place, replacement, key. `INNOVANT_MUTANTS_ONLY` names a
//! file of keys that are taken instead. Replaced are operators, negations, and bodies of functions by a value; not in
//! tests, constants, patterns and macros.

mod sites;

use std::collections::HashSet;
use std::path::Path;
use std::{env, fs};

use sites::{Kind, Site};

/// SplitMix64 (Steele, Lea and Flood 2014), as a share of one.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// What takes the place of a range of the text.
fn edit(text: &str, number: usize, site: &Site) -> (usize, usize, String) {
    let on = format!("crate::mutant::on({number})");
    let (start, end) = (site.start, site.end);
    match &site.kind {
        Kind::Operator { from, to, with } => {
            let (left, operator, right) = (&text[start..*from], &text[*from..*to], &text[*to..end]);
            let choice = format!(
                "(if {on} {{ ({left}) {with} ({right}) }} else {{ ({left}) {operator} ({right}) }})"
            );
            (start, end, choice)
        }
        Kind::Negation { inner } => {
            let (without, with) = (&text[*inner..end], &text[start..end]);
            (
                start,
                end,
                format!("(if {on} {{ {without} }} else {{ {with} }})"),
            )
        }
        Kind::Body { value } => (start, start, format!(" if {on} {{ return {value}; }} ")),
    }
}

fn main() {
    let arguments: Vec<String> = env::args().collect();
    let [_, root, percent, seed, list, files @ ..] = arguments.as_slice() else {
        panic!("ROOT PERCENT SEED LIST FILE...");
    };
    let share = percent.parse::<f64>().expect("PERCENT is a number") / 100.0;
    let mut state: u64 = seed.parse().expect("SEED is a whole number");
    let only: Option<HashSet<String>> = env::var("INNOVANT_MUTANTS_ONLY").ok().map(|path| {
        let keys = fs::read_to_string(path).expect("the file of keys");
        keys.lines().map(str::to_owned).collect()
    });
    let (mut all, mut drawn, mut lines) = (0, 0, String::new());
    for file in files {
        let path = Path::new(root).join(file);
        let mut text = fs::read_to_string(&path).expect("a source file");
        let sites = sites::of(file, &text);
        all += sites.len();
        let mut chosen: Vec<(usize, Site)> = Vec::new();
        for site in sites {
            let wanted = match &only {
                Some(keys) => keys.contains(&site.key),
                None => uniform(&mut state) < share,
            };
            // One within another would need both switches in one place: the later one goes.
            if !wanted || chosen.iter().any(|(_, other)| other.overlaps(&site)) {
                continue;
            }
            drawn += 1;
            let what = &site.what;
            lines += &format!("{drawn}\t{file}:{}\t{what}\t{}\n", site.line, site.key);
            chosen.push((drawn, site));
        }
        let mut edits: Vec<_> = chosen.iter().map(|(n, s)| edit(&text, *n, s)).collect();
        // From the end, so that places stay.
        edits.sort_by_key(|(start, end, _)| std::cmp::Reverse((*start, *end)));
        for (start, end, with) in edits {
            text.replace_range(start..end, &with);
        }
        if !chosen.is_empty() {
            fs::write(&path, text).expect("the source file");
        }
    }
    fs::write(list, lines).expect("the list");
    println!("{drawn} of {all} replacements");
}
