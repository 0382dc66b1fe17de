//! What names mean: words of the language, functions, constants, imports, and the variables of the model.

use crate::physics::error::{MOST_ERRORS, SpecError, SpecErrorKind, excerpt, shortened};
use crate::physics::expression::{
    Binary, ExpressionId, Expressions, Function, Node, Span, VariableId,
};
use std::collections::{HashMap, HashSet};

/// Words that Modelica reserves.
const RESERVED: [&str; 64] = [
    "algorithm",
    "and",
    "annotation",
    "block",
    "break",
    "class",
    "connect",
    "connector",
    "constant",
    "constrainedby",
    "der",
    "discrete",
    "each",
    "else",
    "elseif",
    "elsewhen",
    "encapsulated",
    "end",
    "enumeration",
    "equation",
    "expandable",
    "extends",
    "external",
    "false",
    "final",
    "flow",
    "for",
    "function",
    "if",
    "import",
    "impure",
    "in",
    "initial",
    "inner",
    "input",
    "loop",
    "model",
    "not",
    "operator",
    "or",
    "outer",
    "output",
    "package",
    "parameter",
    "partial",
    "protected",
    "public",
    "pure",
    "record",
    "redeclare",
    "replaceable",
    "return",
    "stream",
    "then",
    "true",
    "type",
    "when",
    "while",
    "within",
    "time",
    "Real",
    "Integer",
    "Boolean",
    "String",
];

/// True for a word that cannot name a variable.
pub(crate) fn is_reserved(word: &str) -> bool {
    RESERVED.contains(&word)
}

/// What a name before `(` calls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Callee {
    One(Function),
    Two(Binary),
    NoEvent,
    Smooth,
    Delay,
}

const FUNCTIONS: [(&str, Callee); 21] = [
    ("sin", Callee::One(Function::Sin)),
    ("cos", Callee::One(Function::Cos)),
    ("tan", Callee::One(Function::Tan)),
    ("asin", Callee::One(Function::Asin)),
    ("acos", Callee::One(Function::Acos)),
    ("atan", Callee::One(Function::Atan)),
    ("sinh", Callee::One(Function::Sinh)),
    ("cosh", Callee::One(Function::Cosh)),
    ("tanh", Callee::One(Function::Tanh)),
    ("exp", Callee::One(Function::Exp)),
    ("log", Callee::One(Function::Log)),
    ("log10", Callee::One(Function::Log10)),
    ("sqrt", Callee::One(Function::Sqrt)),
    ("abs", Callee::One(Function::Abs)),
    ("sign", Callee::One(Function::Sign)),
    ("atan2", Callee::Two(Binary::Atan2)),
    ("min", Callee::Two(Binary::Min)),
    ("max", Callee::Two(Binary::Max)),
    ("noEvent", Callee::NoEvent),
    ("smooth", Callee::Smooth),
    ("delay", Callee::Delay),
];

/// The function of this name, which may be one of `Modelica.Math`.
pub(super) fn function(name: &str, imports: &Imports) -> Option<Callee> {
    imports.meanings(name).find_map(|meaning| {
        let short = meaning.strip_prefix("Modelica.Math.").unwrap_or(&meaning);
        FUNCTIONS.iter().find(|f| f.0 == short).map(|f| f.1)
    })
}

/// Names of all functions.
pub(crate) fn function_names() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.iter().map(|f| f.0)
}

/// The name of a function that is nearest to this one.
pub(super) fn nearest_function(name: &str) -> Option<String> {
    nearest(name, FUNCTIONS.iter().map(|f| f.0))
}

/// Name, value and unit of the constants of `Modelica.Constants`.
const CONSTANTS: [(&str, f64, &str); 17] = [
    ("pi", std::f64::consts::PI, "1"),
    ("e", std::f64::consts::E, "1"),
    ("D2R", std::f64::consts::PI / 180.0, "1"),
    ("R2D", 180.0 / std::f64::consts::PI, "1"),
    ("g_n", 9.80665, "m/s2"),
    ("R", 8.314_462_618_153_24, "J/(mol.K)"),
    ("sigma", 5.670_374_419_184_43e-8, "W/(m2.K4)"),
    ("T_zero", -273.15, "K"),
    ("c", 299_792_458.0, "m/s"),
    ("G", 6.6743e-11, "m3/(kg.s2)"),
    ("k", 1.380_649e-23, "J/K"),
    ("N_A", 6.022_140_76e23, "1/mol"),
    ("q", 1.602_176_634e-19, "C"),
    ("F", 9.648_533_212_331_002e4, "C/mol"),
    ("h", 6.626_070_15e-34, "J.s"),
    ("mu_0", 1.256_637_062_12e-6, "N/A2"),
    ("epsilon_0", 8.854_187_812_8e-12, "F/m"),
];

/// Value and unit of a constant, by its full name. `inf`, `eps` and `small` are numbers that take any unit.
pub(crate) fn constant(name: &str) -> Option<(f64, Option<&'static str>)> {
    let short = name
        .strip_prefix('.')
        .unwrap_or(name)
        .strip_prefix("Modelica.Constants.")?;
    match short {
        "inf" => return Some((f64::MAX, None)),
        "eps" => return Some((f64::EPSILON, None)),
        "small" => return Some((1e-60, None)),
        _ => {}
    }
    CONSTANTS
        .iter()
        .find(|c| c.0 == short)
        .map(|c| (c.1, Some(c.2)))
}

/// Names that `import` makes shorter.
#[derive(Debug, Default)]
pub(super) struct Imports<'a> {
    pub(super) aliases: HashMap<&'a str, &'a str>,
    pub(super) packages: Vec<&'a str>,
}

impl<'a> Imports<'a> {
    /// What a name can stand for: itself first.
    pub(super) fn meanings<'b>(&'b self, name: &'b str) -> impl Iterator<Item = String> + 'b {
        let name = name.strip_prefix('.').unwrap_or(name);
        let (head, tail) = name
            .split_once('.')
            .map_or((name, None), |(h, t)| (h, Some(t)));
        let aliased = self.aliases.get(head).map(|full| match tail {
            Some(tail) => format!("{full}.{tail}"),
            None => (*full).to_string(),
        });
        std::iter::once(name.to_string())
            .chain(aliased)
            .chain(self.packages.iter().map(move |p| format!("{p}.{name}")))
    }
}

/// Names as they are used: until all declarations are read, a variable in an expression is the number of its name here.
#[derive(Debug, Default)]
pub(super) struct Symbols<'a> {
    used: Vec<(&'a str, Span)>,
    index: HashMap<&'a str, u32>,
}

impl<'a> Symbols<'a> {
    /// The number of a name.
    pub(super) fn number(&mut self, name: &'a str, span: Span) -> VariableId {
        let used = &mut self.used;
        VariableId(*self.index.entry(name).or_insert_with(|| {
            used.push((name, span));
            used.len() as u32 - 1
        }))
    }

    /// Puts variables, and the numbers of known constants, in the place of names. Gives an error for each name without a
    /// meaning, except those of parts that were not read.
    pub(super) fn resolve(
        &self,
        text: &str,
        declared: &HashMap<&'a str, VariableId>,
        imports: &Imports,
        unread: &HashSet<&str>,
        expressions: &mut Expressions,
    ) -> Vec<SpecError> {
        let mut errors = vec![];
        let mut table = Vec::with_capacity(self.used.len());
        for &(name, span) in &self.used {
            let known = declared.get(name).map(|&v| Node::Variable(v)).or_else(|| {
                let value = imports.meanings(name).find_map(|m| constant(&m))?.0;
                Some(Node::Number(value))
            });
            if known.is_none() && !unread.contains(name) {
                let candidates = declared.keys().copied().chain(["time"]);
                let nearest = nearest(name, candidates).or_else(|| nearest_constant(name));
                let name = shortened(name);
                let kind = SpecErrorKind::Undeclared { name, nearest };
                errors.push(SpecError::new(text, span, kind));
                if errors.len() >= MOST_ERRORS {
                    break;
                }
            }
            // Where a name has no meaning the model is not used.
            table.push(known.unwrap_or(Node::Time));
        }
        if !errors.is_empty() {
            return errors;
        }
        for i in 0..expressions.len() {
            let id = ExpressionId(i as u32);
            if let Node::Derivative(v) = expressions.node(id)
                && let Some(Node::Number(_)) = table.get(v.index())
            {
                let span = expressions.span(id);
                let message = format!(
                    "`{}`: the derivative of a constant is zero",
                    excerpt(text, span)
                );
                errors.push(SpecError::new(
                    text,
                    span,
                    SpecErrorKind::Derivative(message),
                ));
            }
        }
        expressions.map(|node| match node {
            Node::Variable(v) => table.get(v.index()).copied().unwrap_or(node),
            Node::Derivative(v) => match table.get(v.index()) {
                Some(&Node::Variable(v)) => Node::Derivative(v),
                _ => node,
            },
            // Of a constant, the constant.
            Node::Previous(v) => match table.get(v.index()) {
                Some(&Node::Variable(v)) => Node::Previous(v),
                Some(&constant) => constant,
                None => node,
            },
            node => node,
        });
        errors
    }
}

fn nearest_constant(name: &str) -> Option<String> {
    match name {
        "g" => return Some("Modelica.Constants.g_n".into()),
        "pi" | "Pi" | "PI" => return Some("Modelica.Constants.pi".into()),
        _ => {}
    }
    let exponent = name.strip_prefix(['e', 'E']);
    if exponent.is_some_and(|e| !e.is_empty() && e.bytes().all(|b| b.is_ascii_digit())) {
        return Some(format!("1{name}"));
    }
    let (package, short) = name.rsplit_once('.')?;
    if !package.ends_with("Constants") {
        return None;
    }
    let known = CONSTANTS.iter().map(|c| c.0).chain(["inf", "eps"]);
    nearest(short, known).map(|n| format!("{package}.{n}"))
}

/// The candidate that differs least from a name, if it differs in little.
pub(crate) fn nearest<'b>(name: &str, candidates: impl Iterator<Item = &'b str>) -> Option<String> {
    const LONGEST: usize = 64;
    if name.len() > LONGEST {
        return None;
    }
    let wanted: Vec<char> = name.chars().collect();
    let allowed = if wanted.len() < 2 {
        0
    } else {
        (wanted.len() / 3).max(1)
    };
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates.filter(|c| c.len() <= LONGEST) {
        let distance = if candidate.eq_ignore_ascii_case(name) {
            0
        } else {
            let letters: Vec<char> = candidate.chars().collect();
            if letters.len().abs_diff(wanted.len()) > allowed {
                continue;
            }
            edit_distance(&wanted, &letters)
        };
        // The order of the names decides between equals, so that the same text gives the same message.
        if distance <= allowed && best.is_none_or(|b| (distance, candidate) < b) {
            best = Some((distance, candidate));
        }
    }
    best.map(|b| b.1.to_string())
}

/// Insertions, deletions, replacements and exchanges of neighbours that turn one word into the other.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = vec![];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(before[j - 2] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_found() {
        let names = ["omega", "Omega2", "tau", "x"];
        let of = |name| nearest(name, names.into_iter());
        assert_eq!(of("omga").as_deref(), Some("omega"));
        assert_eq!(of("OMEGA").as_deref(), Some("omega"));
        assert_eq!(of("tua").as_deref(), Some("tau"));
        assert_eq!(of("X").as_deref(), Some("x"));
        assert_eq!(of("y"), None);
        assert_eq!(of("pressure"), None);
        assert_eq!(
            nearest_constant("Modelica.Constants.PI").as_deref(),
            Some("Modelica.Constants.pi")
        );
    }

    #[test]
    fn imports_make_names_shorter() {
        let mut imports = Imports::default();
        imports.aliases.insert("C", "Modelica.Constants");
        imports.packages.push("Modelica.Math");
        let meanings: Vec<String> = imports.meanings("C.pi").collect();
        assert_eq!(
            meanings,
            ["C.pi", "Modelica.Constants.pi", "Modelica.Math.C.pi"]
        );
        assert_eq!(
            function(".Modelica.Math.sin", &imports),
            Some(Callee::One(Function::Sin))
        );
        assert_eq!(function("sine", &imports), None);
    }
}
