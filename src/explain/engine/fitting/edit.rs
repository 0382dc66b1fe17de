//! Changes of a plant's text: terms that enter its equations, and the variables and parameters that they need.

use crate::physics::{
    Binary, Equation, ExpressionId, ModelSpec, Node, Span, SpecError, Token, Unknown, VariableId,
    VariableKind, parse, tokens,
};

/// Name of a variable for what several rates share.
pub(in crate::explain::engine) const SHARED_TERM: &str = "shared_term";

/// Whether a variable is one of those.
pub(crate) fn is_shared_term(spec: &ModelSpec, v: VariableId) -> bool {
    let variable = spec.variable(v);
    variable.kind == VariableKind::Algebraic && variable.name.starts_with(SHARED_TERM)
}

/// The variables whose equations use another, in the order of the text.
pub(crate) fn users_of(spec: &ModelSpec, v: VariableId) -> Vec<VariableId> {
    let uses = |e: &&Equation| {
        let both = [e.left, e.right].map(|side| spec.expressions.variables(side));
        both.concat().contains(&v) && e.unknown.variable() != v
    };
    let mut users: Vec<&Equation> = spec.equations.iter().filter(uses).collect();
    users.sort_by_key(|e| spec.expressions.span(e.left).start);
    users.iter().map(|e| e.unknown.variable()).collect()
}

/// These and, of those that have an equation of their own, what that is made of: a flow is a function of the level that drives it.
pub(in crate::explain::engine) fn with_what_they_are_made_of(
    spec: &ModelSpec,
    variables: &[VariableId],
) -> Vec<VariableId> {
    let mut all = variables.to_vec();
    let mut next = 0;
    while let Some(&v) = all.get(next) {
        next += 1;
        let is_own = |e: &&Equation| e.unknown == Unknown::Value(v);
        let made_of = spec.equations.iter().find(is_own);
        for used in made_of.map_or_else(Vec::new, |e| spec.expressions.variables(e.rest)) {
            let kind = spec.variable(used).kind;
            let moves = !matches!(kind, VariableKind::Constant | VariableKind::Parameter);
            if moves && !all.contains(&used) {
                all.push(used);
            }
        }
    }
    all
}

/// Where something can enter the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Place {
    /// The right-hand side of an equation, by its place in [`ModelSpec::equations`].
    Equation(usize),
    /// An input, on its way into every equation that uses it.
    Input(VariableId),
    /// A parameter, in every equation that uses it.
    Parameter(VariableId),
}

impl Place {
    /// The variable that is changed: whose derivative or value the equation determines, the input, or the parameter.
    pub(crate) fn variable(self, spec: &ModelSpec) -> VariableId {
        match self {
            Self::Equation(at) => spec.equations[at].unknown.variable(),
            Self::Input(v) | Self::Parameter(v) => v,
        }
    }

    /// Whether the equation here uses a variable.
    pub(crate) fn uses(self, spec: &ModelSpec, variable: VariableId) -> bool {
        match self {
            Self::Equation(at) => {
                let (left, right) = (spec.equations[at].left, spec.equations[at].right);
                let (left, right) = (spec.expressions.span(left), spec.expressions.span(right));
                uses(spec, variable)
                    .iter()
                    .any(|u| left.start <= u.start && u.end <= right.end)
            }
            Self::Input(v) | Self::Parameter(v) => v == variable,
        }
    }
}

/// The state whose rate is at a place.
pub(crate) fn driven_state(spec: &ModelSpec, place: Place) -> Option<&str> {
    let v = place.variable(spec);
    let Place::Equation(at) = place else {
        return None;
    };
    let is_rate = spec.equations[at].unknown == Unknown::Derivative(v);
    is_rate.then_some(spec.variable(v).name.as_str())
}

/// A parameter that a change brings along.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NewParameter {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) description: String,
}

/// A change of the text.
#[derive(Debug, Clone, Default)]
pub(crate) struct Edit {
    pub(crate) parameters: Vec<NewParameter>,
    /// Declarations of other variables, each with its semicolon.
    pub(crate) declarations: Vec<String>,
    /// Further equations, each with its semicolon.
    pub(crate) equations: Vec<String>,
    /// What stands at a place instead; `{v}` is what stood there.
    pub(crate) changes: Vec<(Place, String)>,
}

/// Spans of every use of a variable in the equations.
fn uses(spec: &ModelSpec, variable: VariableId) -> Vec<Span> {
    let mut spans = Vec::new();
    for equation in &spec.equations {
        let mut stack = vec![equation.left, equation.right];
        while let Some(id) = stack.pop() {
            let node = spec.expressions.node(id);
            if node == Node::Variable(variable) {
                spans.push(spec.expressions.span(id));
            }
            stack.extend(node.operands());
        }
    }
    spans.sort_by_key(|s| s.start);
    spans.dedup();
    spans
}

/// A number as the language reads it back exactly.
pub(crate) fn literal(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        format!("{value:.1}")
    } else {
        format!("{value:e}")
    }
}

fn declaration(p: &NewParameter) -> String {
    let mut attributes = Vec::new();
    if p.min.is_finite() {
        attributes.push(format!("min={}", literal(p.min)));
    }
    if p.max.is_finite() {
        attributes.push(format!("max={}", literal(p.max)));
    }
    let attributes = if attributes.is_empty() {
        String::new()
    } else {
        format!("({})", attributes.join(", "))
    };
    let description = if p.description.is_empty() {
        String::new()
    } else {
        format!(" \"{}\"", p.description)
    };
    format!(
        "  parameter Real {}{attributes} = {}{description};\n",
        p.name,
        literal(p.value)
    )
}

/// Where the word `equation` and the last `end` stand.
pub(in crate::explain::engine) fn sections(text: &str) -> Option<(usize, usize)> {
    let bytes = text.as_bytes();
    let (mut at, mut equation, mut end) = (0, None, None);
    while at < bytes.len() {
        let rest = &text[at..];
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |i| i + 2)
        } else if bytes[at] == b'"' {
            let mut i = 1;
            while i < rest.len() && rest.as_bytes()[i] != b'"' {
                i += 1 + usize::from(rest.as_bytes()[i] == b'\\');
            }
            i + 1
        } else if bytes[at].is_ascii_alphabetic() || bytes[at] == b'_' {
            let word = rest
                .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                .unwrap_or(rest.len());
            match &rest[..word] {
                "equation" if equation.is_none() => equation = Some(at),
                "end" => end = Some(at),
                _ => {}
            }
            word
        } else {
            1
        };
        at += skipped.max(1);
        while at < bytes.len() && !text.is_char_boundary(at) {
            at += 1;
        }
    }
    let end = end?;
    Some((equation.unwrap_or(end), end))
}

impl Edit {
    /// The text with the change.
    pub(crate) fn text(&self, spec: &ModelSpec) -> String {
        let text = &spec.text;
        let mut declarations: String = self.parameters.iter().map(declaration).collect();
        let mut equations = String::new();
        // Replacements and where they go; nothing nests, because a place is changed once.
        let mut replaced: Vec<(Span, String)> = Vec::new();
        let mut renamed: Vec<(VariableId, String)> = Vec::new();
        for (place, form) in &self.changes {
            match *place {
                Place::Equation(_) => {}
                Place::Input(v) | Place::Parameter(v) => {
                    let name = acting(spec, v);
                    declarations.push_str(&format!("  Real {name};\n"));
                    let value = form.replace("{v}", &spec.variable(v).name);
                    equations.push_str(&format!("  {name} = {value};\n"));
                    renamed.push((v, name));
                }
            }
        }
        for (v, name) in &renamed {
            replaced.extend(uses(spec, *v).into_iter().map(|s| (s, name.clone())));
        }
        for (place, form) in &self.changes {
            if let Place::Equation(at) = *place {
                let right = spec.expressions.span(spec.equations[at].right);
                let inner: Vec<(Span, String)> = replaced
                    .iter()
                    .filter(|(s, _)| s.start >= right.start && s.end <= right.end)
                    .cloned()
                    .collect();
                replaced.retain(|(s, _)| !(s.start >= right.start && s.end <= right.end));
                let old = substituted(text, right, inner);
                let old = if simple(&old) {
                    old
                } else {
                    format!("({old})")
                };
                replaced.push((right, form.replace("{v}", &old)));
            }
        }
        for d in &self.declarations {
            declarations.push_str(&format!("  {d}\n"));
        }
        for e in &self.equations {
            equations.push_str(&format!("  {e}\n"));
        }
        let Some((equation, end)) = sections(text) else {
            return text.clone();
        };
        let head = if text[..end].contains("equation") && equation < end {
            ""
        } else {
            "equation\n"
        };
        let at = |position| Span {
            start: position,
            end: position,
        };
        replaced.push((at(equation), declarations));
        replaced.push((at(end), format!("{head}{equations}")));
        let whole = Span {
            start: 0,
            end: text.len(),
        };
        substituted(text, whole, replaced)
    }

    /// The plant with the change.
    pub(crate) fn apply(&self, spec: &ModelSpec) -> Result<ModelSpec, SpecError> {
        let mut changed = parse(&self.text(spec))?;
        keep_states_of_effects(&mut changed, spec);
        Ok(changed)
    }
}

/// Marks the states that effects have added to a plant in a changed text of it: no text says which they are.
pub(in crate::explain::engine) fn keep_states_of_effects(changed: &mut ModelSpec, of: &ModelSpec) {
    for known in of.variables.iter().filter(|v| v.uncorrected) {
        if let Some(state) = changed.find(&known.name) {
            let state = &mut changed.variables[state.index()];
            (state.uncorrected, state.starts) = (true, known.starts.clone());
        }
    }
}

/// Name of what acts in place of an input or a parameter: one that the plant does not have.
pub(crate) fn acting(spec: &ModelSpec, v: VariableId) -> String {
    let wanted = format!("{}_acting", spec.variable(v).column());
    let numbered = (2..).map(|n| format!("{wanted}{n}"));
    std::iter::once(wanted.clone())
        .chain(numbered)
        .find(|name| spec.find(name).is_none())
        .unwrap_or(wanted)
}

/// Whether an expression needs no parentheses as a term of a sum.
fn simple(text: &str) -> bool {
    !text.trim_start().starts_with("if") && !text.contains("if ")
}

/// An expression with other names in it.
pub(crate) fn with_names(expression: &str, new: impl Fn(&str) -> Option<String>) -> String {
    let Ok(parts) = tokens(expression) else {
        return expression.to_owned();
    };
    let names = parts.into_iter().filter(|(token, _)| *token == Token::Name);
    let pieces =
        names.filter_map(|(_, span)| Some((span, new(&expression[span.start..span.end])?)));
    let whole = Span {
        start: 0,
        end: expression.len(),
    };
    substituted(expression, whole, pieces.collect())
}

/// A part of the text with pieces of it replaced.
pub(in crate::explain::engine) fn substituted(
    text: &str,
    part: Span,
    mut pieces: Vec<(Span, String)>,
) -> String {
    pieces.sort_by_key(|(s, _)| (s.start, s.end));
    let (mut out, mut at) = (String::new(), part.start);
    for (span, new) in pieces {
        out.push_str(&text[at..span.start]);
        out.push_str(&new);
        at = span.end;
    }
    out.push_str(&text[at..part.end]);
    out
}

/// Where effects may enter: every equation that is no definition (of a rate, of a stretch) and no plain sensor, every input that
/// more than a sensor sees, and every parameter but times of delays; of all these what the given plant has, not what effects have
/// added to it.
pub(crate) fn places(spec: &ModelSpec, given: &ModelSpec) -> Vec<Place> {
    let mut found = Vec::new();
    let own = given.parameters().len();
    for (at, equation) in spec.equations.iter().enumerate() {
        // A rate that is a number or an input of its own is a law, as is what an output shows of a number.
        let copied = match spec.expressions.node(equation.rest) {
            Node::Variable(v) => Some(v),
            _ => None,
        };
        let rate = matches!(equation.unknown, Unknown::Derivative(_));
        let plain = equation.coefficient.is_none()
            && copied.is_some_and(|v| match spec.variable(v).kind {
                VariableKind::Parameter => false,
                VariableKind::Input => !rate,
                // A rate that is only what it shares with another.
                _ => !(rate && is_shared_term(spec, v)),
            });
        let kinematic = matches!(equation.unknown, Unknown::Value(_))
            && equation.coefficient.is_none()
            && adds_states(spec, equation.rest);
        if !plain && !kinematic && is_of(spec, equation.unknown.variable(), given) {
            found.push(Place::Equation(at));
        }
    }
    found.extend(
        spec.inputs()
            .into_iter()
            .filter(|&v| {
                !uses(spec, v).is_empty() && !is_only_measured(given, &spec.variable(v).name)
            })
            .map(Place::Input),
    );
    let parameters = spec.parameters().into_iter().take(own);
    found.extend(
        parameters
            .filter(|&v| !delays(spec, v))
            .map(Place::Parameter),
    );
    found
}

/// Whether outputs copy an input, and no equation uses it: what happens to it happens in the sensor.
fn is_only_measured(given: &ModelSpec, input: &str) -> bool {
    given.find(input).is_some_and(|v| {
        let copies = given.equations.iter().filter(|e| {
            let output = given.variable(e.unknown.variable()).output;
            output && e.coefficient.is_none() && given.expressions.node(e.rest) == Node::Variable(v)
        });
        copies.count() == uses(given, v).len()
    })
}

/// Whether a variable is one of the plant that was given.
pub(in crate::explain::engine) fn is_of(
    spec: &ModelSpec,
    v: VariableId,
    given: &ModelSpec,
) -> bool {
    given.find(&spec.variable(v).name).is_some()
}

/// Whether an expression only adds and subtracts states and their derivatives, as the stretch of a spring: a definition.
fn adds_states(spec: &ModelSpec, expression: ExpressionId) -> bool {
    match spec.expressions.node(expression) {
        Node::Variable(v) => spec.variable(v).kind == VariableKind::State,
        Node::Derivative(_) => true,
        Node::Negate(a) => adds_states(spec, a),
        Node::Binary(Binary::Add | Binary::Subtract, a, b) => {
            adds_states(spec, a) && adds_states(spec, b)
        }
        _ => false,
    }
}

/// Whether the time of a delay uses a parameter.
fn delays(spec: &ModelSpec, parameter: VariableId) -> bool {
    let spans = uses(spec, parameter);
    spec.expressions.any(|node| match node {
        Node::Delay { time, .. } => {
            let inside = spec.expressions.span(*time);
            spans
                .iter()
                .any(|s| inside.start <= s.start && s.end <= inside.end)
        }
        _ => false,
    })
}

/// The variable whose equation uses a parameter first; the parameter itself where none does.
pub(crate) fn user_of(spec: &ModelSpec, parameter: VariableId) -> VariableId {
    users_of(spec, parameter)
        .first()
        .copied()
        .unwrap_or(parameter)
}

/// Whether an input enters at several places at once: what is between them, such as a force between two bodies, acts there too.
pub(crate) fn enters_several(spec: &ModelSpec, input: VariableId) -> bool {
    uses(spec, input).len() > 1
}

/// The output equations that copy a variable: `y = T`.
pub(crate) fn sensors(spec: &ModelSpec) -> Vec<usize> {
    (0..spec.equations.len())
        .filter(|&at| {
            let e = &spec.equations[at];
            matches!(e.unknown, Unknown::Value(v) if spec.variable(v).output && uses(spec, v).len() == 1)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TANK: &str = "model Tank // an equation of its own
  parameter Real A = 2; parameter Real a(min=0) = 0.3 \"outlet; equation\"; input Real u; output Real y;
  Real h(start=0.5); Real q = a*sqrt(max(h, 0));
equation
  A*der(h) = u - q; /* equation */ y = h + 0*u;
end Tank;
";

    fn term(place: Place, form: &str) -> Edit {
        Edit {
            changes: vec![(place, form.to_owned())],
            parameters: vec![NewParameter {
                name: "c".to_owned(),
                value: 0.25,
                min: 0.0,
                max: f64::INFINITY,
                description: "new".to_owned(),
            }],
            ..Edit::default()
        }
    }

    #[test]
    fn every_place_can_be_changed() {
        let spec = parse(TANK).unwrap();
        let places = places(&spec, &spec);
        assert_eq!(places.len(), 6, "{places:?}");
        for place in places {
            let edit = term(place, "{v} + c*1.0");
            let changed = edit
                .apply(&spec)
                .unwrap_or_else(|e| panic!("{}\n{e}", edit.text(&spec)));
            assert_eq!(changed.parameters().len(), 3);
            assert_eq!(changed.states().len(), 1);
        }
    }

    #[test]
    fn definitions_are_no_places() {
        let spec = parse(
            "model M parameter Real k = 2; input Real u; output Real y;
             Real a; Real va; Real b; Real x = a - b; Real f = k*x; Real s = x + u;
             equation der(a) = va; der(va) = u - f; der(b) = f - s; y = x; end M;",
        )
        .unwrap();
        let names: Vec<&str> = places(&spec, &spec)
            .iter()
            .map(|p| spec.variable(p.variable(&spec)).name.as_str())
            .collect();
        for name in ["va", "b", "f", "s", "u", "k"] {
            assert!(names.contains(&name), "{name} of {names:?}");
        }
        for name in ["a", "x", "y"] {
            assert!(!names.contains(&name), "{name} of {names:?}");
        }
    }

    #[test]
    fn what_only_sensors_see_is_no_place() {
        let spec = parse("model M input Real u; input Real s; output Real y; output Real z; equation y = s; z = s + u; end M;").unwrap();
        let all = |spec: &ModelSpec| -> Vec<String> {
            let names = places(spec, spec);
            let name = |p: &Place| spec.variable(p.variable(spec)).name.clone();
            names.iter().map(name).collect()
        };
        assert_eq!(all(&spec), ["z", "u", "s"]);
        let measured = parse("model M input Real s; output Real y; equation y = s; end M;");
        assert!(all(&measured.unwrap()).is_empty());
    }

    #[test]
    fn a_change_stands_where_it_should() {
        let spec = parse(TANK).unwrap();
        let input = spec.find("u").unwrap();
        let text = term(Place::Input(input), "c*({v})").text(&spec);
        assert!(text.contains("A*der(h) = u_acting - q;"), "{text}");
        assert!(text.contains("y = h + 0*u_acting;"), "{text}");
        assert!(text.contains("u_acting = c*(u);"), "{text}");
        let at = spec
            .equations
            .iter()
            .position(|e| spec.variable(e.unknown.variable()).name == "q");
        let text = term(Place::Equation(at.unwrap()), "{v} + c*h").text(&spec);
        assert!(text.contains("Real q = a*sqrt(max(h, 0)) + c*h;"), "{text}");
        assert_eq!(
            user_of(&spec, spec.find("a").unwrap()),
            spec.find("q").unwrap()
        );
    }

    #[test]
    fn numbers_are_read_back_exactly() {
        for value in [0.0, -3.0, 1e20, 0.1, f64::MIN_POSITIVE, -1.0 / 3.0] {
            assert_eq!(literal(value).parse::<f64>().unwrap(), value);
        }
    }
}
