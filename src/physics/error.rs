//! What is wrong with a model text, and where.

use super::expression::Span;
use std::fmt::Write as _;

/// An error in a model text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {kind}")]
pub struct SpecError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// What is wrong.
    pub kind: Box<SpecErrorKind>,
    span: Span,
}

/// What can be wrong with a model text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecErrorKind {
    /// The text, an expression or a nesting is larger than what is read.
    #[error("{0}")]
    Limit(String),
    /// Another word or sign stands where one is required.
    #[error("expected {expected}, found {found}")]
    Expected {
        /// What would be right.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The text is not well formed in another way.
    #[error("{0}")]
    Syntax(String),
    /// An equation among the declarations.
    #[error("an equation before the word `equation`: put that word in a line above it")]
    EquationTooEarly,
    /// Modelica that is outside the flat subset.
    #[error("{construct} outside the flat subset of Modelica: {advice}")]
    Unsupported {
        /// The construct, with its verb.
        construct: String,
        /// How to do without it.
        advice: String,
    },
    /// A name that nothing declares.
    #[error("`{name}` is not declared{}", hint(.nearest))]
    Undeclared {
        /// The name.
        name: String,
        /// The declared name that is nearest to it.
        nearest: Option<String>,
    },
    /// A word that the language or the subset does not know at this place.
    #[error("`{name}` is not {what}{}", hint(.nearest))]
    UnknownWord {
        /// The word.
        name: String,
        /// What it would have to be.
        what: &'static str,
        /// The known word that is nearest to it.
        nearest: Option<String>,
    },
    /// A name declared twice.
    #[error("`{name}` is declared twice: first in line {first_line}, column {first_column}")]
    Duplicate {
        /// The name.
        name: String,
        /// Line of its first declaration.
        first_line: usize,
        /// Column of its first declaration.
        first_column: usize,
    },
    /// A variable that two equations determine.
    #[error(
        "`{unknown}` is determined twice: here and by `{first}` in line {first_line}, column {first_column}; remove one of \
         the two equations"
    )]
    DeterminedTwice {
        /// The variable or derivative.
        unknown: String,
        /// The other equation.
        first: String,
        /// Its line.
        first_line: usize,
        /// Its column.
        first_column: usize,
    },
    /// A variable, or the derivative of one, that no equation determines.
    #[error("{0}")]
    Undetermined(String),
    /// A word of the language as a name.
    #[error("`{0}` is a word of the language and cannot be a name")]
    Reserved(String),
    /// A condition where a number is required, or the reverse.
    #[error("{0}")]
    Type(String),
    /// A function with a wrong number of arguments.
    #[error("`{function}` takes {takes} argument{}, {given} {} given", plural(*.takes), be(*.given))]
    Arguments {
        /// The function.
        function: String,
        /// How many it takes.
        takes: usize,
        /// How many are given.
        given: usize,
    },
    /// `der` of something that has no equation for its derivative.
    #[error("{0}")]
    Derivative(String),
    /// A value, bound or start that is missing, contradictory or not a number.
    #[error("{0}")]
    Value(String),
    /// Constants or parameters that need each other.
    #[error("{} need each other's value", listed(.0, 8))]
    Cycle(Vec<String>),
    /// An equation that is not linear in what it has to determine.
    #[error(
        "`{equation}` has to determine `{unknown}`, and is not linear in it: {reason}; write it solved for `{unknown}`"
    )]
    NonLinear {
        /// What the equation has to determine.
        unknown: String,
        /// The equation.
        equation: String,
        /// Where the unknown stands.
        reason: String,
    },
    /// More or fewer equations than unknowns, in all or in a part.
    #[error("{0}")]
    Count(String),
    /// Variables that need each other at the same instant.
    #[error(
        "algebraic loop: {} need each other at the same instant (lines {}); {}",
        listed(.variables, 8), joined(.lines, 8), way_out(.variables)
    )]
    AlgebraicLoop {
        /// The smallest set of variables that was found to need each other.
        variables: Vec<String>,
        /// Lines of their equations.
        lines: Vec<usize>,
    },
    /// Quantities of different dimension added, compared or equated.
    #[error("unit conflict: {0}")]
    UnitConflict(String),
}

/// Errors in one text that are reported: more say nothing that helps.
pub(crate) const MOST_ERRORS: usize = 8;

/// Stands where a text was cut.
const CUT: &str = "...";

impl SpecError {
    pub(crate) fn new(text: &str, span: Span, kind: SpecErrorKind) -> Self {
        let (line, column) = position(text, span.start);
        Self {
            line,
            column,
            // Results are passed through many calls: an error in one should be small.
            kind: Box::new(kind),
            span,
        }
    }

    /// The part of the text that the error is about.
    pub fn span(&self) -> Span {
        self.span
    }

    /// `file:line:column: message`, the line of the text, and marks under the part that the error is about.
    pub fn render(&self, file: &str, text: &str) -> String {
        const WIDTH: usize = 120;
        let source = text.lines().nth(self.line.saturating_sub(1)).unwrap_or("");
        let before = self.column.saturating_sub(1);
        // A line of a generated text may be long: show the part around the error.
        let long = source.chars().nth(WIDTH).is_some();
        let skipped = if long {
            before.saturating_sub(WIDTH / 2)
        } else {
            0
        };
        let part = source.chars().skip(skipped).take(WIDTH);
        let part = part.map(|c| if c.is_control() && c != '\t' { ' ' } else { c });
        let mut shown = String::from(if skipped > 0 { CUT } else { "" });
        let before = before - skipped + shown.len();
        shown.extend(part);
        let blank: String = shown
            .chars()
            .take(before)
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        let marked = text
            .get(self.span.start..self.span.end)
            .map_or(1, |part| part.lines().next().unwrap_or("").chars().count());
        let room = shown.chars().count().saturating_sub(before);
        if source.chars().nth(skipped + WIDTH).is_some() {
            shown.push_str(CUT);
        }
        let number = self.line.to_string();
        let mut answer = format!(
            "{file}:{}:{}: {}\n",
            self.line,
            self.column,
            self.kind.to_string().trim_end()
        );
        let _ = writeln!(answer, " {number} | {shown}");
        let _ = write!(
            answer,
            " {:width$} | {blank}{}",
            "",
            "^".repeat(marked.min(room).max(1)),
            width = number.len()
        );
        answer
    }
}

/// Line and column, from 1, of a byte.
pub(crate) fn position(text: &str, byte: usize) -> (usize, usize) {
    let head = text.as_bytes().get(..byte).unwrap_or(text.as_bytes());
    let line = head.iter().filter(|&&b| b == b'\n').count() + 1;
    let start = head.iter().rposition(|&b| b == b'\n').map_or(0, |p| p + 1);
    // Every character has one byte that does not continue another.
    let column = head[start..].iter().filter(|&&b| b & 0xC0 != 0x80).count() + 1;
    (line, column)
}

/// Line, from 1, of a byte.
pub(crate) fn line_of(text: &str, byte: usize) -> usize {
    position(text, byte).0
}

/// A part of a text on one line, cut to a length that suits a message.
pub(crate) fn excerpt(text: &str, span: Span) -> String {
    shortened(text.get(span.start..span.end).unwrap_or(""))
}

/// A text on one line, cut to a length that suits a message.
pub(crate) fn shortened(text: &str) -> String {
    const LENGTH: usize = 72;
    let mut answer = String::new();
    let mut count = 0;
    let mut space = false;
    for c in text.chars() {
        if c.is_whitespace() || c.is_control() {
            space = !answer.is_empty();
            continue;
        }
        if count >= LENGTH {
            answer.push_str(CUT);
            break;
        }
        if std::mem::take(&mut space) {
            answer.push(' ');
            count += 1;
        }
        answer.push(c);
        count += 1;
    }
    answer
}

/// "`a`, `b` and 3 more"
pub(crate) fn listed(names: &[String], most: usize) -> String {
    let quoted: Vec<String> = names
        .iter()
        .map(|n| format!("`{}`", shortened(n)))
        .collect();
    joined(&quoted, most)
}

/// "3, 4 and 5" or "3, 4 and 7 more"
pub(crate) fn joined<T: ToString>(items: &[T], most: usize) -> String {
    let mut shown: Vec<String> = items.iter().take(most).map(ToString::to_string).collect();
    let last = if items.len() > most {
        Some(format!("{} more", items.len() - most))
    } else {
        shown.pop()
    };
    match last {
        Some(last) if shown.is_empty() => last,
        Some(last) => format!("{} and {last}", shown.join(", ")),
        None => String::new(),
    }
}

pub(crate) fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

fn be(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// How to break an algebraic loop.
fn way_out(variables: &[String]) -> String {
    let by_hand = "solve the equations by hand for one of them";
    match variables.iter().find(|v| !v.starts_with("der(")) {
        Some(name) => {
            let name = shortened(name);
            format!(
                "{by_hand}, or give one a small inertia or time constant, as in `T*der({name}) = ... - {name}`"
            )
        }
        None => format!("{by_hand}, and put the solution into the other equations"),
    }
}

fn hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map(|n| format!("; did you mean `{n}`?"))
        .unwrap_or_default()
}

/// Errors one below the other, and how many they are.
pub fn render_all(errors: &[SpecError], file: &str, text: &str) -> String {
    let mut lines: Vec<String> = errors.iter().map(|e| e.render(file, text)).collect();
    if errors.len() > 1 {
        lines.push(format!("{} errors", errors.len()));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_shows_its_line_and_marks_the_part() {
        let text = "model A\n\tx = omga;\n";
        let error = SpecError::new(
            text,
            Span { start: 13, end: 17 },
            SpecErrorKind::Undeclared {
                name: "omga".into(),
                nearest: Some("omega".into()),
            },
        );
        assert_eq!((error.line, error.column), (2, 6));
        assert_eq!(
            error.render("plant.mo", text),
            "plant.mo:2:6: `omga` is not declared; did you mean `omega`?\n 2 | \tx = omga;\n   | \t    ^^^^"
        );
    }

    #[test]
    fn an_error_outside_its_text_renders_all_the_same() {
        let error = SpecError::new(
            "",
            Span { start: 90, end: 7 },
            SpecErrorKind::Syntax("x".into()),
        );
        assert_eq!(error.render("a", "é"), "a:1:1: x\n 1 | é\n   | ^");
        let long = format!("{}y", "é ".repeat(5000));
        let end = long.len();
        let error = SpecError::new(
            &long,
            Span {
                start: end - 1,
                end,
            },
            SpecErrorKind::Syntax("x".into()),
        );
        assert!(error.render("a", &long).ends_with(" ^"));
        assert!(error.render("a", &long).len() < 500);
        assert!(!error.render("a", "short").is_empty());
    }

    #[test]
    fn an_excerpt_that_is_cut_says_so() {
        let text = format!("{} wrong {}", "a + ".repeat(50), "+ b".repeat(50));
        let start = text.find("wrong").unwrap_or(0);
        let end = start + 5;
        let kind = SpecErrorKind::Syntax("x".into());
        let shown = SpecError::new(&text, Span { start, end }, kind).render("a", &text);
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[1].starts_with(" 1 | ..."), "{shown}");
        assert!(lines[1].ends_with("..."), "{shown}");
        let (at, mark) = (lines[1].find("wrong"), lines[2].find("^^^^^"));
        assert!(at.is_some() && at == mark, "{shown}");
    }

    #[test]
    fn lists_are_cut() {
        let names: Vec<String> = ["a", "b", "c"].map(String::from).to_vec();
        assert_eq!(listed(&names, 2), "`a`, `b` and 1 more");
        assert_eq!(listed(&names, 3), "`a`, `b` and `c`");
        assert_eq!(listed(&names[..1], 3), "`a`");
        assert_eq!(shortened(" a \n  b "), "a b");
        assert!(shortened(&"x".repeat(1000)).len() < 80);
    }
}
