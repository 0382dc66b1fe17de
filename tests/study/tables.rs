//! The figures of a study, for people.

use std::collections::BTreeMap;

use super::answer::{Answer, Outcome};
use super::plan::Answers;
use innovant::explain::Verdict;

/// Answers with this outcome.
pub fn count(answers: &[Answer], outcome: Outcome) -> usize {
    answers.iter().filter(|a| a.outcome == outcome).count()
}

/// Sorted figures, where there are any.
pub fn sorted(answers: &[Answer], figure: impl Fn(&Answer) -> Option<f64>) -> Vec<f64> {
    let mut found: Vec<f64> = answers.iter().filter_map(figure).collect();
    found.sort_by(f64::total_cmp);
    found
}

/// The value below which this share of sorted figures lies.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = (share * sorted.len() as f64) as usize;
    sorted
        .get(at.min(sorted.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}

pub fn print(answers: &Answers) {
    confusion(&answers.effects);
    false_alarms(&answers.nulls);
    error_removed(&answers.effects);
    concealment(&answers.effects);
    windows(&answers.effects);
    let all: Vec<&Answer> = answers
        .effects
        .iter()
        .chain(&answers.nulls)
        .chain(&answers.unlisted)
        .collect();
    reliability(&all);
    leave_out(&answers.left_out, &answers.unlisted);
    to_look_at(&all, &answers.left_out);
}

fn percent(part: usize, whole: usize) -> String {
    if whole == 0 {
        return "-".to_owned();
    }
    format!("{:.0} %", 100.0 * part as f64 / whole as f64)
}

const OUTCOMES: [(Outcome, &str); 7] = [
    (Outcome::Named, "named"),
    (Outcome::Family, "family"),
    (Outcome::Partial, "partial"),
    (Outcome::Abstained, "abstained"),
    (Outcome::Missed, "missed"),
    (Outcome::Wrong, "wrong"),
    (Outcome::Failed, "failed"),
];

fn heading(first: &str) {
    print!("{first:<42} cases");
    for (_, name) in OUTCOMES {
        print!(" {name:>9}");
    }
}

fn row(name: &str, answers: &[Answer]) {
    print!("{name:<42} {:>5}", answers.len());
    for (outcome, _) in OUTCOMES {
        match count(answers, outcome) {
            0 => print!(" {:>9}", "."),
            n => print!(" {n:>9}"),
        }
    }
}

fn grouped(answers: &[Answer], key: impl Fn(&Answer) -> String) -> BTreeMap<String, Vec<Answer>> {
    let mut groups: BTreeMap<String, Vec<Answer>> = BTreeMap::new();
    for answer in answers {
        groups.entry(key(answer)).or_default().push(answer.clone());
    }
    groups
}

fn confusion(answers: &[Answer]) {
    println!("\n(a) What was concealed, and what was said");
    heading("concealed");
    println!("  wrong names");
    for (name, group) in grouped(answers, Answer::truth_in_words) {
        row(&name, &group);
        let wrong: Vec<String> = group
            .iter()
            .filter(|a| matches!(a.outcome, Outcome::Wrong | Outcome::Partial))
            .map(|a| a.named.join(" + "))
            .collect();
        println!("  {}", wrong.join("; "));
    }
    row("all", answers);
    println!();
    let named = count(answers, Outcome::Named);
    println!("named {}", percent(named, answers.len()));
}

fn false_alarms(nulls: &[Answer]) {
    println!("\n(b) False alarms where nothing was concealed");
    println!(
        "{:<42} cases    alarms  names",
        "noise, outputs, loop, parameters"
    );
    let line = |name: &str, group: &[Answer]| {
        let alarms: Vec<String> = group
            .iter()
            .filter(|a| a.outcome == Outcome::FalseAlarm)
            .map(Answer::said_in_words)
            .collect();
        println!(
            "{name:<42} {:>5} {:>9}  {}",
            group.len(),
            alarms.len(),
            alarms.join("; ")
        );
    };
    let noise = |a: &Answer| {
        let white = a.truth.noise_colour == 0.0;
        let colour = if white { "white" } else { "coloured" };
        format!("noise {colour}, {}", a.truth.noise_tail)
    };
    let rest: [&dyn Fn(&Answer) -> String; 4] = [
        &noise,
        &|a| format!("outputs {}", a.outputs),
        &looped,
        &|a| format!("parameters wrong by {} %", 100.0 * a.truth.parameter_error),
    ];
    for key in rest {
        for (name, group) in grouped(nulls, key) {
            line(&name, &group);
        }
    }
    line("all", nulls);
    let failed = count(nulls, Outcome::Failed);
    if failed > 0 {
        println!("{failed} failed");
    }
}

fn looped(answer: &Answer) -> String {
    let loops = if answer.truth.closed_loop {
        "closed"
    } else {
        "open"
    };
    format!("{loops} loop")
}

fn error_removed(answers: &[Answer]) {
    let shares = sorted(answers, |a| a.removed);
    println!("\n(c) Share of the error on fresh data that the augmented model removes");
    println!(
        "cases {}   median {:.3}   10th percentile {:.3}",
        shares.len(),
        quantile(&shares, 0.5),
        quantile(&shares, 0.1)
    );
    for answer in answers.iter().filter(|a| a.outcome != Outcome::Failed) {
        if let Some(trouble) = &answer.trouble {
            println!("{}: {trouble}", answer.label);
        }
    }
}

fn concealment(answers: &[Answer]) {
    println!("\n(d) Outcomes against concealment");
    heading("effect over noise, loop, noise, size");
    println!();
    let ratio = |a: &Answer| {
        let names = ["below 1", "1 to 3", "3 to 10", "10 to 30", "above 30"];
        let ratio = a.truth.effect_ratio / a.truth.noise_ratio;
        let at = [1.0, 3.0, 10.0, 30.0]
            .iter()
            .take_while(|edge| ratio >= **edge)
            .count();
        format!("{}. effect over noise {}", at + 1, names[at])
    };
    let colour = |a: &Answer| {
        if a.truth.noise_colour == 0.0 {
            "white noise".to_owned()
        } else {
            format!("coloured noise, {}", a.truth.noise_colour)
        }
    };
    let hard = |a: &Answer| if a.truth.hard { "hard" } else { "easy" }.to_owned();
    let given = |a: &Answer| {
        if a.truth.known_to_simulation.is_empty() {
            format!("given: {}", a.truth.given)
        } else {
            "given: output of a nonlinear simulator".to_owned()
        }
    };
    let parameters =
        |a: &Answer| format!("parameters wrong by {} %", 100.0 * a.truth.parameter_error);
    let keys: [&dyn Fn(&Answer) -> String; 6] =
        [&ratio, &looped, &colour, &hard, &given, &parameters];
    for key in keys {
        for (name, group) in grouped(answers, key) {
            row(&name, &group);
            println!();
        }
    }
}

fn windows(answers: &[Answer]) {
    let overlaps = sorted(answers, |a| a.overlap);
    println!("\n(e) Time windows: intersection over union");
    println!(
        "cases {}   median {:.2}   10th percentile {:.2}   below 0.5: {}",
        overlaps.len(),
        quantile(&overlaps, 0.5),
        quantile(&overlaps, 0.1),
        overlaps.iter().filter(|v| **v < 0.5).count()
    );
}

/// Stated probabilities: mean, and share that was right.
pub fn stated_and_right(answers: &[&Answer]) -> (f64, f64) {
    let n = answers.len().max(1) as f64;
    let stated: f64 = answers.iter().map(|a| a.probability).sum();
    let right = answers.iter().filter(|a| a.is_right()).count();
    (stated / n, right as f64 / n)
}

fn reliability(answers: &[&Answer]) {
    println!("\n(f) Stated probability, effects and nulls and unlisted effects");
    println!("{:<42} cases    stated     right", "probability");
    let line = |name: &str, group: &[&Answer]| {
        let (stated, right) = stated_and_right(group);
        if !group.is_empty() {
            println!("{name:<42} {:>5} {stated:>9.3} {right:>9.3}", group.len());
        }
    };
    let edges = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9];
    for edge in edges.windows(2) {
        let inside = |a: &&&Answer| a.probability >= edge[0] && a.probability < edge[1];
        let group: Vec<&Answer> = answers.iter().filter(inside).copied().collect();
        line(&format!("{} to {:.4}", edge[0], edge[1]), &group);
    }
    for verdict in [
        Verdict::Consistent,
        Verdict::Parameters,
        Verdict::Named,
        Verdict::Family,
        Verdict::Unexplained,
    ] {
        let said = |a: &&&Answer| a.verdict == verdict && a.outcome != Outcome::Failed;
        let group: Vec<&Answer> = answers.iter().filter(said).copied().collect();
        line(
            &format!("said {}", format!("{verdict:?}").to_lowercase()),
            &group,
        );
    }
}

fn leave_out(left_out: &[Answer], unlisted: &[Answer]) {
    println!("\n(g) Effects that the library does not hold");
    heading("");
    println!();
    for (name, group) in [
        ("the truth taken out (abstained is right)", left_out),
        ("in no library (below: unexplained)", unlisted),
    ] {
        row(name, group);
        println!();
        let unexplained = count(group, Outcome::Abstained) + count(group, Outcome::UnlistedRight);
        let quiet = count(group, Outcome::Missed);
        println!(
            "   unexplained {}   wrong name {}   consistent or parameters {}",
            percent(unexplained, group.len()),
            percent(group.len() - unexplained - quiet, group.len()),
            percent(quiet, group.len())
        );
        for answer in group.iter().filter(|a| !a.named.is_empty()) {
            println!(
                "   {} took the name {}",
                answer.truth_in_words(),
                answer.named.join(" + ")
            );
        }
    }
}

fn to_look_at(answers: &[&Answer], left_out: &[Answer]) {
    println!("\nTo look at");
    for a in answers.iter().filter(|a| !a.is_right()) {
        let t = &a.truth;
        println!(
            "{:<12} {:<36} said {:<44} p {:.2}  effect {:.3} noise {:.3} colour {:.2} {}{}, {}, {}, parameters {}, {}{}",
            a.label,
            a.truth_in_words(),
            a.said_in_words(),
            a.probability,
            t.effect_ratio,
            t.noise_ratio,
            t.noise_colour,
            t.noise_tail,
            if t.hard { ", hard" } else { "" },
            t.plant,
            t.excitation,
            t.parameter_error,
            looped(a),
            a.removed
                .map_or(String::new(), |r| format!(", removed {r:.2}"))
        );
    }
    let low = answers
        .iter()
        .filter(|a| a.is_right() && a.removed.is_some_and(|r| r < 0.8));
    for a in low {
        println!(
            "{:<12} {:<36} right, but removes only {:.2} on fresh data; {}, {}, {}",
            a.label,
            a.truth_in_words(),
            a.removed.unwrap_or(f64::NAN),
            a.truth.plant,
            a.truth.excitation,
            looped(a)
        );
    }
    let mut slow: Vec<&Answer> = answers.iter().copied().chain(left_out).collect();
    slow.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    for a in slow.iter().take(3) {
        println!("slow: {} {:.1} s, {}", a.label, a.seconds, a.truth.plant);
    }
}
