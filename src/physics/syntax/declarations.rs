//! Declarations: the words before a type, the type, names with attributes, bindings and descriptions.

use super::draft::{Declaration, DraftEquation, DraftExpression, Role};
use super::names;
use super::parser::{FLATTEN, Parser};
use super::tokens::{Token, unescape};
use crate::physics::error::{SpecError, SpecErrorKind, position, shortened};
use crate::physics::expression::{Node, Span, VariableId};
use crate::physics::units::{Unit, type_unit};
use std::collections::HashMap;

/// Names before the `(` of attributes.
const ATTRIBUTES: [&str; 10] = [
    "start",
    "fixed",
    "unit",
    "displayUnit",
    "min",
    "max",
    "nominal",
    "quantity",
    "stateSelect",
    "unbounded",
];

/// Packages of types that are real numbers with a unit.
const TYPE_PACKAGES: [&str; 7] = [
    "Modelica.Units.SI.",
    "Modelica.Units.NonSI.",
    "Modelica.SIunits.Conversions.NonSIunits.",
    "Modelica.SIunits.",
    "SIunits.",
    "NonSI.",
    "SI.",
];

/// What the declarations of a text say.
#[derive(Debug, Default)]
pub(super) struct Declared<'a> {
    pub(super) declarations: Vec<Declaration>,
    pub(super) index: HashMap<&'a str, VariableId>,
    pub(super) equations: Vec<DraftEquation>,
}

/// The words before a type.
#[derive(Debug, Default, Clone, Copy)]
struct Prefixes {
    certain: bool,
    constant: bool,
    parameter: bool,
    input: bool,
    output: bool,
}

impl Prefixes {
    fn role(self) -> Role {
        if self.constant || (self.certain && self.parameter) {
            Role::Constant
        } else if self.parameter {
            Role::Parameter
        } else if self.input {
            Role::Input
        } else {
            Role::Determined
        }
    }
}

/// A declaration line: one type, one or several names.
pub(super) fn declaration<'a>(
    parser: &mut Parser<'a>,
    declared: &mut Declared<'a>,
) -> Result<(), SpecError> {
    let (prefixes, any) = prefixes(parser)?;
    let (type_name, type_span) = (parser.word(), parser.span);
    if parser.token != Token::Name {
        return Err(parser.expected("a declaration such as `Real x;`, `equation` or `end`"));
    }
    if names::is_reserved(type_name) && type_name != "Real" {
        return Err(construct(parser));
    }
    parser.advance()?;
    if parser.at_sign("[") {
        return Err(parser.no_arrays());
    }
    if parser.token != Token::Name {
        return Err(untyped(parser, type_name, type_span, any));
    }
    let type_unit = real_type(parser, type_name, type_span)?;
    loop {
        component(parser, declared, prefixes, type_unit)?;
        if !parser.take_sign(",")? {
            break;
        }
    }
    parser.require_sign(";", "at the end of the declaration")
}

fn prefixes(parser: &mut Parser) -> Result<(Prefixes, bool), SpecError> {
    let mut found = Prefixes::default();
    let start = parser.span.start;
    while parser.token == Token::Name {
        match parser.word() {
            "final" => found.certain = true,
            "constant" => found.constant = true,
            "parameter" => found.parameter = true,
            "input" => found.input = true,
            "output" => found.output = true,
            _ => break,
        }
        parser.advance()?;
    }
    let end = parser.previous_end;
    let kinds = [found.constant, found.parameter, found.input, found.output];
    if kinds.into_iter().filter(|&k| k).count() > 1 {
        return Err(parser.syntax(
            Span { start, end },
            "a variable is only one of `constant`, `parameter`, `input` and `output`",
        ));
    }
    Ok((found, parser.previous_end > start))
}

/// The error for a word that starts something other than a declaration of the subset.
pub(super) fn construct(parser: &Parser) -> SpecError {
    let word = parser.word();
    let advice = match word {
        "when" => "there are no events: write a condition with `if`",
        "for" | "while" => "write the equations one by one",
        "if" => "write `y = if a then b else c;`",
        "model" | "block" | "class" | "connect" | "extends" | "flow" | "stream" | "connector"
        | "inner" | "outer" | "replaceable" | "redeclare" | "package" | "record" | "function"
        | "type" | "expandable" | "external" | "pure" | "impure" | "operator" => FLATTEN,
        "algorithm" => "write equations `lhs = rhs;` behind the word `equation`",
        "initial" => "give start values in the declarations, as in `Real x(start=1, fixed=true);`",
        "Integer" | "Boolean" | "String" | "enumeration" => {
            "declare it `Real`, or write its value where it is used"
        }
        "discrete" => "there are no events: declare it `parameter Real` or give it an equation",
        "reinit" | "assert" | "terminate" => "there are no events: leave the line out",
        _ => return parser.expected("a declaration, `equation` or `end`"),
    };
    parser.unsupported(parser.span, &format!("`{word}` is"), advice)
}

fn untyped(parser: &Parser, name: &str, span: Span, any: bool) -> SpecError {
    let name = shortened(name);
    if any {
        return parser.syntax(span, format!("`{name}` has no type: write `Real {name}`"));
    }
    if matches!(parser.token, Token::Sign(_)) && !parser.at_sign(";") {
        return parser.syntax(
            span,
            format!(
                "`{name}` starts neither a declaration such as `Real {name};` nor, before the word `equation`, an equation"
            ),
        );
    }
    parser.expected(&format!("a name behind the type `{name}`"))
}

/// The unit of a type, as text, if the type is a real number.
fn real_type(parser: &Parser, name: &str, span: Span) -> Result<Option<&'static str>, SpecError> {
    if name == "Real" {
        return Ok(None);
    }
    for meaning in parser.imports.meanings(name) {
        if let Some(short) = TYPE_PACKAGES.iter().find_map(|p| meaning.strip_prefix(p)) {
            return Ok(type_unit(short));
        }
    }
    let kind = if let Some(nearest) = names::nearest(name, std::iter::once("Real")) {
        SpecErrorKind::UnknownWord {
            name: shortened(name),
            what: "a type",
            nearest: Some(nearest),
        }
    } else {
        let advice = match name.rsplit('.').next() {
            Some("double" | "float" | "Double" | "Float" | "number") => "declare it `Real`",
            Some("RealInput") => "declare it `input Real`",
            Some("RealOutput") => "declare it `output Real`",
            _ => FLATTEN,
        };
        SpecErrorKind::Unsupported {
            construct: format!("a component of the type `{}` is", shortened(name)),
            advice: advice.into(),
        }
    };
    Err(parser.error(span, kind))
}

fn component<'a>(
    parser: &mut Parser<'a>,
    declared: &mut Declared<'a>,
    prefixes: Prefixes,
    type_unit: Option<&'static str>,
) -> Result<(), SpecError> {
    let (name, span) = (parser.word(), parser.span);
    if matches!(parser.token, Token::Number(_)) {
        return Err(parser.syntax(
            span,
            "a number behind `,`: a decimal number is written with a point, as in `0.5`",
        ));
    }
    if parser.token != Token::Name {
        return Err(parser.expected("the name of a variable"));
    }
    let written = name.strip_prefix('.').unwrap_or(name);
    if written.split('.').any(names::is_reserved) {
        return Err(parser.error(span, SpecErrorKind::Reserved(shortened(name))));
    }
    let earlier = declared.index.get(written).copied();
    if let Some(earlier) = earlier {
        let first = declared
            .declarations
            .get(earlier.index())
            .map_or(0, |d| d.span.start);
        let (first_line, first_column) = position(parser.text, first);
        let kind = SpecErrorKind::Duplicate {
            name: shortened(name),
            first_line,
            first_column,
        };
        let error = parser.error(span, kind);
        parser.errors.push(error);
    }
    parser.advance()?;
    let role = prefixes.role();
    let mut declaration = Declaration {
        name: written.to_string(),
        description: String::new(),
        role,
        output: prefixes.output,
        unit: type_unit.and_then(Unit::parse),
        unit_text: type_unit.map(String::from),
        min: None,
        max: None,
        nominal: None,
        start: None,
        fixed: false,
        value: None,
        span,
    };
    if parser.at_sign("[") {
        return Err(parser.no_arrays());
    }
    if parser.take_sign("(")? {
        attributes(parser, &mut declaration)?;
    }
    if parser.at_sign(":=") {
        return Err(parser.syntax(parser.span, "`:=` stands in algorithms only: write `=`"));
    }
    if parser.at_sign("=") {
        binding(parser, declared, &mut declaration, written)?;
    }
    if parser.at_word("if") {
        return Err(parser.unsupported(parser.span, "conditional declarations are", FLATTEN));
    }
    declaration.description = comment(parser)?;
    if earlier.is_none() {
        let id = VariableId(declared.declarations.len() as u32);
        declared.index.insert(written, id);
        parser.declared.insert(written);
        declared.declarations.push(declaration);
    }
    Ok(())
}

fn binding<'a>(
    parser: &mut Parser<'a>,
    declared: &mut Declared,
    declaration: &mut Declaration,
    name: &'a str,
) -> Result<(), SpecError> {
    let equal = parser.span;
    parser.advance()?;
    match declaration.role {
        Role::Constant | Role::Parameter => declaration.value = Some(parser.number()?),
        Role::Input => {
            let message = format!(
                "the input `{}` is given from outside, and can have no binding: remove it, or remove `input`",
                shortened(name)
            );
            return Err(parser.syntax(equal, message));
        }
        Role::Determined => {
            let symbol = parser.symbols.number(name, declaration.span);
            let first = parser.expressions.len();
            let root = parser.push(Node::Variable(symbol), declaration.span)?;
            let right = parser.number()?;
            let span = Span {
                start: declaration.span.start,
                end: parser.previous_end,
            };
            let left = DraftExpression { first, root };
            declared.equations.push(DraftEquation { left, right, span });
        }
    }
    Ok(())
}

/// Attributes and the parenthesis that closes them.
fn attributes(parser: &mut Parser, declaration: &mut Declaration) -> Result<(), SpecError> {
    let mut seen: Vec<&str> = vec![];
    while !parser.at_sign(")") {
        if !seen.is_empty() {
            parser.require_sign(",", "or `)` behind the attribute")?;
        }
        while parser.take_word("final")? || parser.take_word("each")? {}
        if parser.token != Token::Name {
            return Err(parser.expected("an attribute such as `start` or `unit`"));
        }
        let (name, span) = (parser.word(), parser.span);
        let Some(&known) = ATTRIBUTES.iter().find(|a| **a == name) else {
            return Err(parser.error(
                span,
                SpecErrorKind::UnknownWord {
                    name: shortened(name),
                    what: "an attribute",
                    nearest: names::nearest(name, ATTRIBUTES.into_iter()),
                },
            ));
        };
        if seen.contains(&known) {
            return Err(parser.syntax(span, format!("the attribute `{known}` is given twice")));
        }
        seen.push(known);
        parser.advance()?;
        parser.require_sign("=", &format!("behind the attribute `{known}`"))?;
        match known {
            "start" => declaration.start = Some(parser.number()?),
            "min" => declaration.min = Some(parser.number()?),
            "max" => declaration.max = Some(parser.number()?),
            "nominal" => declaration.nominal = Some(parser.number()?),
            "fixed" | "unbounded" => {
                let value = parser.at_word("true");
                if !value && !parser.at_word("false") {
                    return Err(parser.expected("`true` or `false`"));
                }
                parser.advance()?;
                if known == "fixed" {
                    declaration.fixed = value;
                }
            }
            "stateSelect" => {
                if parser.token != Token::Name {
                    return Err(parser.expected("a choice such as `StateSelect.prefer`"));
                }
                parser.advance()?;
            }
            _ => {
                if parser.token != Token::Text {
                    return Err(parser.expected("a text in quotes, such as `unit=\"m/s\"`"));
                }
                let value = texts(parser)?;
                // An empty unit is Modelica's way to say that none is stated.
                if known == "unit" && !value.trim().is_empty() {
                    declaration.unit = Unit::parse(&value);
                    declaration.unit_text = Some(value);
                }
            }
        }
    }
    parser.advance()
}

/// Texts joined by `+`.
fn texts(parser: &mut Parser) -> Result<String, SpecError> {
    let mut answer = String::new();
    loop {
        if parser.token != Token::Text {
            return Err(parser.expected("a text in quotes"));
        }
        answer.push_str(&unescape(parser.word()));
        parser.advance()?;
        if !parser.take_sign("+")? {
            return Ok(answer);
        }
    }
}

/// A description, which may be missing.
pub(super) fn description(parser: &mut Parser) -> Result<String, SpecError> {
    if parser.token == Token::Text {
        texts(parser)
    } else {
        Ok(String::new())
    }
}

/// A description and an annotation, either of which may be missing.
pub(super) fn comment(parser: &mut Parser) -> Result<String, SpecError> {
    let description = description(parser)?;
    annotation(parser)?;
    Ok(description)
}

/// Steps over an annotation, if one stands here.
pub(super) fn annotation(parser: &mut Parser) -> Result<bool, SpecError> {
    let start = parser.span;
    if !parser.take_word("annotation")? {
        return Ok(false);
    }
    if !parser.at_sign("(") {
        return Err(parser.expected("`(` behind `annotation`"));
    }
    let mut open = 0usize;
    loop {
        match parser.token {
            Token::Sign("(" | "{" | "[") => open += 1,
            Token::Sign(")" | "}" | "]") => open = open.saturating_sub(1),
            Token::End => {
                return Err(parser.syntax(
                    start,
                    "this annotation has no end: a closing `)` is missing",
                ));
            }
            _ => {}
        }
        parser.advance()?;
        if open == 0 {
            return Ok(true);
        }
    }
}
