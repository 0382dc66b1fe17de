//! From a text in a flat subset of Modelica 3.6 to a [`ModelSpec`].
//!
//! ```text
//! text        = [ "within" [ name ] ";" ] { import } model
//! import      = "import" ( [ ident "=" ] name | name ".*" ) comment ";"
//! model       = [ "encapsulated" ] [ "partial" ] ( "model" | "block" | "class" ) ident [ texts ] { element }
//!               { "equation" { equation } [ ( "public" | "protected" ) { element } ] } "end" ident ";"
//! element     = import | declaration | "public" | "protected" | annotation ";"
//! declaration = { "final" | "constant" | "parameter" | "input" | "output" } type component { "," component } ";"
//! type        = "Real" | a type of Modelica.Units.SI, Modelica.Units.NonSI or Modelica.SIunits
//! component   = name [ "(" attribute { "," attribute } ")" ] [ "=" expression ] comment
//! attribute   = [ "final" ] ( ( "start" | "min" | "max" | "nominal" ) "=" expression
//!             | ( "unit" | "displayUnit" | "quantity" ) "=" texts | ( "fixed" | "unbounded" ) "=" ( "true" | "false" )
//!             | "stateSelect" "=" name )
//! equation    = expression "=" expression comment ";" | annotation ";"
//! comment     = [ texts ] [ annotation ]
//! texts       = text { "+" text }
//! annotation  = "annotation" "(" anything with balanced brackets ")"
//!
//! expression  = "if" expression "then" expression { "elseif" expression "then" expression } "else" expression | or
//! or          = and { "or" and }
//! and         = not { "and" not }
//! not         = [ "not" ] relation
//! relation    = sum [ ( "<" | "<=" | ">" | ">=" | "==" | "<>" ) sum ]
//! sum         = [ "+" | "-" ] product { ( "+" | "-" ) product }
//! product     = factor { ( "*" | "/" ) factor }
//! factor      = primary [ "^" primary ]
//! primary     = number | "true" | "false" | "time" | name | "der" "(" name ")" | "pre" "(" name ")"
//!             | "(" expression ")"
//!             | function "(" [ expression { "," expression } ] ")"
//! ```
//!
//! Names may be dotted (`motor.w`) and their parts quoted (`'speed of fan'`); a quoted name keeps its quotes. Conditions and
//! numbers are distinct types.

mod declarations;
pub(crate) mod draft;
mod grammar;
#[cfg(test)]
mod hostile;
mod names;
mod parser;
#[cfg(test)]
mod tests;
mod tokens;

pub(crate) use names::{constant, function_names, is_reserved, nearest};
pub(crate) use tokens::{Token, tokens};

use super::error::{MOST_ERRORS, SpecError, SpecErrorKind, shortened};
use super::expression::{Binary, Node, Span};
use super::spec::ModelSpec;
use declarations::{Declared, annotation, comment, construct, declaration, description};
use draft::{Draft, DraftEquation};
use parser::{FLATTEN, Parser};

/// Bytes of a text that are read.
const LONGEST: usize = 10_000_000;
/// Packages whose names are all imported.
const MOST_PACKAGES: usize = 32;

/// Reads a model, and settles which equation determines what and in which order.
///
/// # Errors
/// The first thing in the text that is wrong, contradictory or outside the subset. [`diagnose`] gives more than the first.
pub fn parse(text: &str) -> Result<ModelSpec, SpecError> {
    read(text).map_err(|mut errors| errors.swap_remove(0))
}

/// Reads a model and compares its units.
///
/// # Errors
/// At most eight errors, in the order of the text, none of which follows from another.
pub fn diagnose(text: &str) -> Result<ModelSpec, Vec<SpecError>> {
    let spec = read(text)?;
    let mut conflicts = super::units::unit_conflicts(&spec);
    conflicts.truncate(MOST_ERRORS);
    if conflicts.is_empty() {
        Ok(spec)
    } else {
        Err(conflicts)
    }
}

/// Errors are at least one, at most [`MOST_ERRORS`], and in the order of the text.
fn read(text: &str) -> Result<ModelSpec, Vec<SpecError>> {
    let found = match draft(text) {
        Ok(draft) => super::sort::determine(draft),
        Err(errors) => Err(errors),
    };
    found.map_err(|mut errors| {
        errors.sort_by_key(|e| (e.line, e.column));
        errors.truncate(MOST_ERRORS);
        errors
    })
}

fn draft(text: &str) -> Result<Draft<'_>, Vec<SpecError>> {
    if text.len() > LONGEST {
        let message = format!(
            "the text has {} bytes: more than {LONGEST} are not read",
            text.len()
        );
        let kind = SpecErrorKind::Limit(message);
        return Err(vec![SpecError::new(text, Span::default(), kind)]);
    }
    let mut parser = Parser::new(text).map_err(|e| vec![e])?;
    let mut declared = Declared::default();
    let read = model(&mut parser, &mut declared);
    let heading = match read {
        Ok(heading) => heading,
        Err(last) => {
            parser.errors.push(last);
            return Err(parser.errors);
        }
    };
    let resolved = parser.symbols.resolve(
        text,
        &declared.index,
        &parser.imports,
        &parser.unread,
        &mut parser.expressions,
    );
    parser.errors.extend(resolved);
    if !parser.errors.is_empty() {
        return Err(parser.errors);
    }
    Ok(Draft {
        text,
        name: heading.0.to_string(),
        description: heading.1,
        declarations: declared.declarations,
        equations: declared.equations,
        expressions: parser.expressions,
    })
}

/// The whole text: name and description of the model, whose parts are put into `declared`.
fn model<'a>(
    parser: &mut Parser<'a>,
    declared: &mut Declared<'a>,
) -> Result<(&'a str, String), SpecError> {
    if parser.token == Token::End {
        return Err(parser.syntax(
            parser.span,
            "the text is empty: expected `model Name ... end Name;`",
        ));
    }
    if parser.take_word("within")? {
        if parser.token == Token::Name {
            parser.advance()?;
        }
        parser.require_sign(";", "behind `within`")?;
    }
    while parser.at_word("import") {
        import(parser)?;
    }
    while parser.at_word("encapsulated") || parser.at_word("partial") {
        parser.advance()?;
    }
    let (name, description) = heading(parser)?;
    while !parser.at_word("end") {
        if parser.take_word("equation")? {
            equations(parser, declared)?;
            continue;
        }
        let start = parser.span.start;
        if let Err(error) = element(parser, declared) {
            let section_missing = *error.kind == SpecErrorKind::EquationTooEarly;
            parser.recover(error, start)?;
            if section_missing {
                equations(parser, declared)?;
            }
        }
    }
    ending(parser, name)?;
    if declared.declarations.is_empty() && parser.errors.is_empty() {
        return Err(parser.syntax(
            Span::default(),
            format!("the model `{}` declares no variable", shortened(name)),
        ));
    }
    Ok((name, description))
}

fn heading<'a>(parser: &mut Parser<'a>) -> Result<(&'a str, String), SpecError> {
    match (parser.token, parser.word()) {
        (Token::Name, "model" | "block" | "class") => parser.advance()?,
        (
            Token::Name,
            "package" | "function" | "record" | "connector" | "type" | "operator" | "pure"
            | "impure" | "expandable",
        ) => {
            return Err(construct(parser));
        }
        _ => {
            return Err(parser.expected("`model`: the text has to read `model Name ... end Name;`"));
        }
    }
    let (name, span) = (parser.word(), parser.span);
    if parser.token != Token::Name {
        return Err(parser.expected("the name of the model"));
    }
    if names::is_reserved(name) {
        return Err(parser.error(span, SpecErrorKind::Reserved(name.into())));
    }
    parser.advance()?;
    if parser.at_sign("=") {
        return Err(parser.unsupported(
            parser.span,
            "a model that is another one with changes is",
            FLATTEN,
        ));
    }
    if parser.token == Token::Name && parser.word().starts_with('\'') {
        return Err(parser.syntax(parser.span, "a description stands in double quotes"));
    }
    Ok((name, description(parser)?))
}

/// `import`, which stands here.
fn import(parser: &mut Parser) -> Result<(), SpecError> {
    parser.advance()?;
    let first = parser.word();
    // Each package is another meaning of every name.
    if parser.imports.packages.len() >= MOST_PACKAGES {
        let message = format!("more than {MOST_PACKAGES} imports of whole packages");
        return Err(parser.error(parser.span, SpecErrorKind::Limit(message)));
    }
    if parser.token != Token::Name {
        return Err(parser.expected("a name behind `import`"));
    }
    parser.advance()?;
    let short = |full: &'_ str| {
        full.rsplit_once('.')
            .map_or(0, |(package, _)| package.len() + 1)
    };
    if parser.take_sign("=")? {
        let full = parser.word();
        if parser.token != Token::Name {
            return Err(parser.expected("a name behind `=`"));
        }
        parser.imports.aliases.insert(first, full);
        parser.advance()?;
    } else if parser.take_sign(".*")? {
        parser.imports.packages.push(first);
    } else if parser.at_sign(".") {
        return Err(parser.unsupported(
            parser.span,
            "imports of several names are",
            "import each name in a line of its own",
        ));
    } else {
        parser.imports.aliases.insert(&first[short(first)..], first);
    }
    comment(parser)?;
    parser.require_sign(";", "behind the import")
}

fn element<'a>(parser: &mut Parser<'a>, declared: &mut Declared<'a>) -> Result<(), SpecError> {
    if parser.at_word("import") {
        return import(parser);
    }
    if parser.at_word("public") || parser.at_word("protected") {
        return parser.advance();
    }
    if annotation(parser)? {
        return parser.require_sign(";", "behind the annotation");
    }
    if parser.at_word("der") {
        return Err(parser.error(parser.span, SpecErrorKind::EquationTooEarly));
    }
    if parser.at_word("initial") {
        return Err(construct(parser));
    }
    if parser.token == Token::End {
        return Err(parser.expected("a declaration, `equation` or `end`"));
    }
    declaration(parser, declared)
}

fn equations(parser: &mut Parser, declared: &mut Declared) -> Result<(), SpecError> {
    loop {
        if parser.token == Token::Name
            && matches!(parser.word(), "end" | "equation" | "public" | "protected")
        {
            return Ok(());
        }
        let start = parser.span.start;
        match equation_or_annotation(parser) {
            Ok(equation) => declared.equations.extend(equation),
            Err(error) => parser.recover(error, start)?,
        }
    }
}

fn equation_or_annotation(parser: &mut Parser) -> Result<Option<DraftEquation>, SpecError> {
    if annotation(parser)? {
        parser.require_sign(";", "behind the annotation")?;
        return Ok(None);
    }
    if parser.token == Token::Name {
        match parser.word() {
            "parameter" | "constant" | "input" | "output" | "final" | "Real" | "import" => {
                return Err(
                    parser.syntax(parser.span, "declarations stand before the word `equation`")
                );
            }
            "when" | "for" | "if" | "while" | "connect" | "extends" | "algorithm" | "initial"
            | "reinit" | "assert" | "terminate" | "Integer" | "Boolean" | "String" | "flow"
            | "discrete" => {
                return Err(construct(parser));
            }
            _ => {}
        }
    }
    if parser.token == Token::End {
        return Err(parser.expected("an equation or `end`"));
    }
    equation(parser).map(Some)
}

fn equation(parser: &mut Parser) -> Result<DraftEquation, SpecError> {
    let start = parser.span.start;
    let first = parser.expressions.len();
    let left = parser.expression()?;
    if parser.at_sign(":=") {
        return Err(parser.syntax(parser.span, "`:=` stands in algorithms only: write `=`"));
    }
    if !parser.at_sign("=") {
        if parser.at_sign(";")
            && matches!(
                parser.expressions.node(left.id),
                Node::Binary(Binary::Equal, ..)
            )
        {
            return Err(parser.syntax(
                parser.expressions.span(left.id),
                "an equation is written with `=`; `==` compares",
            ));
        }
        return Err(parser.expected("an operator, or the `=` of the equation"));
    }
    if left.condition {
        let span = parser.expressions.span(left.id);
        let message =
            "the left side of the equation is a condition, and a number is needed".to_string();
        return Err(parser.error(span, SpecErrorKind::Type(message)));
    }
    parser.advance()?;
    let right = parser.number()?;
    let span = Span {
        start,
        end: parser.previous_end,
    };
    if parser.at_sign("=") {
        return Err(parser.syntax(
            parser.span,
            "a second `=` in one equation: write two equations",
        ));
    }
    comment(parser)?;
    parser.require_sign(";", "or an operator behind the equation")?;
    let root = left.id;
    let left = draft::DraftExpression { first, root };
    Ok(DraftEquation { left, right, span })
}

/// `end Name;` and nothing behind it.
fn ending(parser: &mut Parser, name: &str) -> Result<(), SpecError> {
    parser.advance()?;
    if parser.token != Token::Name {
        return Err(parser.expected(&format!(
            "`{}`, the name of the model, behind `end`",
            shortened(name)
        )));
    }
    if parser.word() != name {
        let message = format!(
            "`end {}` does not match `model {}`",
            shortened(parser.word()),
            shortened(name)
        );
        return Err(parser.syntax(parser.span, message));
    }
    parser.advance()?;
    parser.require_sign(";", "at the end of the model")?;
    if parser.token != Token::End {
        return Err(parser.expected("nothing behind the model: a text holds one model"));
    }
    Ok(())
}
