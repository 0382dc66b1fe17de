//! Values of terms along recordings, from the text of the terms.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::explain::engine::fitting::edit::literal;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::term::{MEMORIES, Memory, MemoryStart, Starts, Term};
use crate::noise::Series;
use crate::physics::estimate::PlantRecording;
use crate::physics::{Excitation, Hold, Plant, parse};

/// Error of a step of a term's memory: a score test needs no more.
const TERM_ACCURACY: f64 = 1e-4;
/// Teeth, poles and slots that machines have in a turn.
const IN_A_TURN: [f64; 22] = [
    1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 15.0, 16.0, 18.0, 20.0, 21.0,
    24.0, 28.0, 30.0, 36.0, 48.0,
];
/// Most periods of what is periodic along a path that are looked for.
const PERIODS: u32 = 48;
/// Wave numbers that are tried of a position: every half period from the first.
pub(in crate::explain::engine) const WAVES: u32 = 2 * PERIODS - 1;
/// An argument is far from zero whose usual value is more than so many standard deviations.
const FAR: f64 = 10.0;
/// A memory that follows at once does so in a sample divided by this.
pub(in crate::explain::engine) const FAST: f64 = 5.0;

/// Values that a shape's search starts from.
pub(in crate::explain::engine) fn starts(
    shape: Starts,
    argument: Option<&Argument>,
    recordings: &[PlantRecording],
    peaks: &[f64],
) -> Vec<f64> {
    let h = recordings.first().map_or(1.0, |r| r.sample_time);
    let samples = recordings
        .iter()
        .map(|r| r.outputs[0].len())
        .max()
        .unwrap_or(1);
    let of = |parts: &[f64], value: &dyn Fn(&Argument, f64) -> f64| -> Vec<f64> {
        argument.map_or_else(Vec::new, |a| parts.iter().map(|&p| value(a, p)).collect())
    };
    match shape {
        Starts::Quantiles(parts) => of(parts, &|a, p| a.quantile(p)),
        Starts::SizeQuantiles(parts) => of(parts, &|a, p| a.size_quantile(p)),
        Starts::Spread(parts) | Starts::Releases(parts) => of(parts, &|a, p| p * a.spread()),
        Starts::PerSpread(parts) => of(parts, &|a, p| p / a.spread()),
        Starts::Travel(parts) => of(parts, &|a, p| p * a.travel(h)),
        Starts::Rate(parts) => of(parts, &|a, p| p * a.range() / h),
        Starts::RateSize(parts) => of(parts, &|a, p| p * a.rate_size(h)),
        Starts::Waves => argument.map_or_else(Vec::new, |a| waves(a, h)),
        Starts::Length(parts) => parts.iter().map(|p| p * samples as f64 * h).collect(),
        Starts::Instants(parts) => {
            let (begin, end) = PlantRecording::span(recordings);
            parts.iter().map(|p| begin + p * (end - begin)).collect()
        }
        Starts::Samples(counts) => {
            let measured = spacing(recordings);
            counts.iter().map(|c| c * measured).collect()
        }
        Starts::Moved(counts) => of(counts, &|a, n| n * a.spread() * h),
        Starts::Values(values) | Starts::Powers(values) | Starts::Share(values) => values.to_vec(),
        Starts::Peaks => peaks.to_vec(),
    }
}

/// Wave numbers with every half period more in the range of an argument: one between two of them goes out of step with neither. Of an
/// angle also the whole ones beyond these that machines have. As far as samples resolve them.
fn waves(along: &Argument, sample_time: f64) -> Vec<f64> {
    let half = 0.5 * TAU / along.range();
    let most = f64::from(2 * PERIODS) * half;
    let resolved = 0.5 * TAU / (sample_time * along.rate_size(sample_time));
    let of_turn = |turn: f64| IN_A_TURN.map(|k| k * TAU / turn);
    let beyond = along.turn.map(of_turn).into_iter().flatten();
    let halves = (2..=2 * PERIODS).map(|n| f64::from(n) * half);
    halves
        .chain(beyond.filter(|k| *k > most))
        .filter(|k| *k < resolved)
        .collect()
}

/// Mean time between values of the first output: the sample time, unless some are missing.
fn spacing(recordings: &[PlantRecording]) -> f64 {
    let (mut time, mut values) = (0.0, 0.0);
    for r in recordings {
        time += r.samples() as f64 * r.sample_time;
        let measured = r.outputs[0].iter().filter(|y| y.is_finite());
        values += measured.count() as f64;
    }
    time / f64::max(values, 1.0)
}

/// The combinations of start values of all shapes; `peaks` are frequencies in rad/s.
pub(in crate::explain::engine) fn grid(
    term: &Term,
    argument: Option<&Argument>,
    recordings: &[PlantRecording],
    peaks: &[f64],
) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = vec![vec![]];
    for shape in term.shapes {
        let values = starts(shape.starts, argument, recordings, peaks);
        all = all
            .into_iter()
            .flat_map(|head| {
                values.iter().map(move |&v| {
                    let mut whole = head.clone();
                    whole.push(v);
                    whole
                })
            })
            .filter(|v| v.iter().all(|v| v.is_finite()))
            .collect();
    }
    all.retain(|values| {
        let positive = term.shapes.iter().zip(values);
        positive.into_iter().all(|(s, &v)| !s.positive || v > 0.0)
    });
    all
}

/// The form with its names filled in; factors are those of a product of two variables.
pub(crate) fn filled(
    form: &str,
    term: &Term,
    argument: &str,
    memories: &[String],
    shapes: &[String],
    (begin, sample_time): (f64, f64),
) -> String {
    let (first, second) = argument.split_once('*').unwrap_or((argument, argument));
    let mut text = form
        .replace("{z}", argument)
        .replace("{first}", first)
        .replace("{second}", second)
        .replace("{begin}", &format!("({})", literal(begin)))
        .replace("{fast}", &literal(FAST / sample_time))
        .replace("{instant}", &literal(sample_time / FAST));
    for (symbol, name) in MEMORIES.iter().zip(memories) {
        text = text.replace(symbol, name);
    }
    for (shape, value) in term.shapes.iter().zip(shapes) {
        text = text.replace(&format!("{{{}}}", shape.symbol), value);
    }
    text
}

/// A term without memories as an expression of its argument.
pub(in crate::explain::engine) fn expression(
    term: &Term,
    (argument, usual): (&str, f64),
    shapes: &[f64],
    sample_time: f64,
) -> String {
    let shapes = shapes.iter().map(|v| format!("({})", literal(*v)));
    let shapes: Vec<String> = shapes.collect();
    let times = (0.0, sample_time);
    about_usual(
        &filled(term.form, term, argument, &[], &shapes, times),
        usual,
    )
}

/// The form with the usual value of its argument in it, where that is not zero.
pub(crate) fn about_usual(form: &str, usual: f64) -> String {
    let value = match usual {
        _ if usual < 0.0 => format!("({usual})"),
        _ => usual.to_string(),
    };
    let [once, twice] = match usual {
        0.0 => [String::new(), String::new()],
        _ => [format!(" - {value}"), format!(" - {value}*{value}")],
    };
    form.replace("{-usual}", &once)
        .replace("{-usual^2}", &twice)
}

/// A term at an argument with shapes, whose values are asked for.
#[derive(Debug, Clone)]
pub(in crate::explain::engine) struct Instance {
    pub(in crate::explain::engine) term: &'static Term,
    pub(in crate::explain::engine) argument: Option<usize>,
    pub(in crate::explain::engine) shapes: Vec<f64>,
}

/// Values of terms along the recordings.
pub(in crate::explain::engine) fn evaluate(
    instances: &[Instance],
    arguments: &[Argument],
    recordings: &[PlantRecording],
) -> Option<Vec<Series>> {
    let both = values_and_ends(instances, arguments, recordings, None)?;
    Some(both.into_iter().map(|[values, _]| values).collect())
}

/// The same with the values at the end of each sample, where inputs are held so; see [`Argument::ends`].
pub(in crate::explain::engine) fn evaluate_with_ends(
    instances: &[Instance],
    arguments: &[Argument],
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<Vec<[Series; 2]>> {
    values_and_ends(instances, arguments, recordings, Some(hold))
}

/// The ends are those of the values where no hold is given. Each memory takes the steps that it needs itself.
fn values_and_ends(
    instances: &[Instance],
    arguments: &[Argument],
    recordings: &[PlantRecording],
    hold: Option<Hold>,
) -> Option<Vec<[Series; 2]>> {
    let remembers = |&i: &usize| !instances[i].term.memories.is_empty();
    let (alone, together): (Vec<_>, Vec<_>) = (0..instances.len()).partition(remembers);
    let mut groups: Vec<Vec<usize>> = alone.into_iter().map(|i| vec![i]).collect();
    groups.extend((!together.is_empty()).then_some(together));
    let each = groups.into_par_iter().map(|group| {
        let of_group: Vec<Instance> = group.iter().map(|&i| instances[i].clone()).collect();
        let columns = values_of_group(&of_group, arguments, recordings, hold)?;
        Some(group.into_iter().zip(columns).collect::<Vec<_>>())
    });
    let mut all: Vec<(usize, [Series; 2])> = (each.collect::<Option<Vec<_>>>()?.into_iter())
        .flatten()
        .collect();
    all.sort_by_key(|of| of.0);
    Some(all.into_iter().map(|of| of.1).collect())
}

/// The same in one run.
fn values_of_group(
    instances: &[Instance],
    arguments: &[Argument],
    recordings: &[PlantRecording],
    hold: Option<Hold>,
) -> Option<Vec<[Series; 2]>> {
    let first = recordings.first()?;
    let (h, times) = (first.sample_time, (first.start_time, first.sample_time));
    let mut used: Vec<usize> = instances.iter().filter_map(|i| i.argument).collect();
    used.sort_unstable();
    used.dedup();
    let of_inputs = used.iter().all(|&a| arguments[a].held);
    let mut columns: Vec<[Series; 2]> = vec![Default::default(); instances.len()];
    for (r, recording) in recordings.iter().enumerate() {
        let mut text = String::from("model Terms\n");
        for a in &used {
            text.push_str(&format!("input Real z{a};\ninput Real end{a};\n"));
        }
        let mut equations = String::from("equation\n");
        for (i, instance) in instances.iter().enumerate() {
            let argument = instance.argument.map_or(String::new(), |a| format!("z{a}"));
            let shapes: Vec<String> = instance
                .shapes
                .iter()
                .map(|v| format!("({})", literal(*v)))
                .collect();
            let memories: Vec<String> = (0..instance.term.memories.len())
                .map(|j| format!("m{i}_{j}"))
                .collect();
            // Far from zero, such as at absolute temperatures, an exponential about zero is beyond all numbers.
            let far = |a: &&Argument| a.usual().abs() > FAR * a.spread();
            let usual = instance.argument.map(|a| &arguments[a]).filter(far);
            let usual = usual.map_or(0.0, Argument::usual);
            // What stands at the place is what parameters scale, and a size of the term does not matter here.
            let fill = |argument: &str| {
                let form = instance.term.form;
                let text = filled(form, instance.term, argument, &memories, &shapes, times)
                    .replace("{v}", "0.0")
                    .replace("{a}", "1.0");
                about_usual(&text, usual)
            };
            text.push_str(&format!("output Real b{i};\n"));
            equations.push_str(&format!("b{i} = {};\n", fill(&argument)));
            if let Between::To(a) = instance.between(arguments, hold) {
                text.push_str(&format!("output Real c{i};\n"));
                equations.push_str(&format!("c{i} = {};\n", fill(&format!("end{a}"))));
            }
            for (memory, name) in instance.term.memories.iter().zip(&memories) {
                let first = instance.argument.map_or(0.0, |a| arguments[a].values[r][0]);
                let start = memory.start.at(first);
                text.push_str(&memory.declaration(name, start, false));
                let previous = memory.previous(&memories);
                let rate = filled(
                    memory.rate,
                    instance.term,
                    &argument,
                    &previous,
                    &shapes,
                    times,
                );
                equations.push_str(&memory.equation(name, &rate));
            }
        }
        let plant = Plant::new(parse(&format!("{text}{equations}end Terms;\n")).ok()?)
            .with_accuracy(TERM_ACCURACY);
        // At each sample the end of the one before.
        let ends: Vec<Vec<f64>> = (used.iter())
            .map(|&a| {
                let (values, ends) = (&arguments[a].values[r], &arguments[a].ends[r]);
                let before = values.first().into_iter().chain(ends).take(values.len());
                before.copied().collect()
            })
            .collect();
        let inputs: Vec<&[f64]> = (used.iter().zip(&ends))
            .flat_map(|(&a, ends)| [arguments[a].values[r].as_slice(), ends])
            .collect();
        let excitation = Excitation {
            inputs: &inputs,
            length: recording.outputs[0].len(),
            sample_time: h,
            start_time: recording.start_time,
            hold: hold.filter(|_| of_inputs).unwrap_or(Hold::Linear),
        };
        let run = plant.simulate(&plant.nominal(), &excitation, None).ok()?;
        let mut outputs = run.outputs.into_iter();
        for (instance, [values, ends]) in instances.iter().zip(&mut columns) {
            let at = outputs.next()?;
            let next = |of: &[f64]| of.iter().skip(1).chain(at.last()).copied().collect();
            ends.push(match instance.between(arguments, hold) {
                Between::Held => at.clone(),
                Between::Line => next(&at),
                Between::To(_) => next(&outputs.next()?),
            });
            values.push(at);
        }
    }
    Some(columns)
}

/// What a term does from a sample to the next.
enum Between {
    Held,
    /// To its value at the next sample.
    Line,
    /// To its value with the end of an argument.
    To(usize),
}

impl Instance {
    fn between(&self, arguments: &[Argument], hold: Option<Hold>) -> Between {
        let memories = self.term.memories;
        // What changes at samples only stays as it is until the next.
        let at_samples = memories.iter().all(|m| m.sampled);
        match (self.argument, hold) {
            (None, _) | (_, None) => Between::Line,
            (Some(a), Some(hold)) if arguments[a].held && at_samples => match (hold, memories) {
                (Hold::Linear, []) => Between::Line,
                _ => Between::Held,
            },
            (Some(_), _) if !memories.is_empty() && at_samples => Between::Line,
            (Some(a), _) => Between::To(a),
        }
    }
}

impl Memory {
    /// Its declaration in a text; with `free` its start is estimated.
    pub(crate) fn declaration(&self, name: &str, start: f64, free: bool) -> String {
        let fixed = if free { "" } else { ", fixed=true" };
        format!("Real {name}(start={}{fixed});", literal(start))
    }

    /// Whether its start is estimated: that of what follows a variable of the plant. What follows an input starts where that does,
    /// and of bristles and gaps the start matters little.
    pub(crate) fn has_free_start(&self, argument: Option<&Argument>) -> bool {
        self.start == MemoryStart::Argument && !self.sampled && argument.is_some_and(|a| !a.held)
    }

    /// What its equation calls the memories: those of the sample before.
    pub(crate) fn previous(&self, names: &[String]) -> Vec<String> {
        let previous = |name: &String| format!("pre({name})");
        match self.sampled {
            true => names.iter().map(previous).collect(),
            false => names.to_vec(),
        }
    }

    /// Its equation in a text.
    pub(crate) fn equation(&self, name: &str, right: &str) -> String {
        match self.sampled {
            true => format!("{name} = {right};"),
            false => format!("der({name}) = {right};"),
        }
    }
}

impl MemoryStart {
    /// The start where the argument has this value.
    pub(crate) fn at(self, argument: f64) -> f64 {
        match self {
            Self::Argument => argument,
            Self::Square => argument * argument,
            Self::Zero => 0.0,
        }
    }
}
