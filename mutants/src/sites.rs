//! Where a file can be changed, and into what.

use quote::ToTokens;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, ReturnType, UnOp};

/// A replacement.
pub struct Site {
    /// Place and replacement, as long as the line itself does not change.
    pub key: String,
    /// Bytes of the text.
    pub start: usize,
    pub end: usize,
    /// Line, from 1.
    pub line: usize,
    pub kind: Kind,
    /// For people.
    pub what: String,
}

pub enum Kind {
    /// The operator in bytes `from..to` becomes `with`.
    Operator {
        from: usize,
        to: usize,
        with: &'static str,
    },
    /// The sign before byte `inner` goes.
    Negation { inner: usize },
    /// The function returns `value` at once.
    Body { value: String },
}

impl Site {
    /// Whether `later` cannot stand beside this one.
    pub fn overlaps(&self, later: &Self) -> bool {
        match (&self.kind, &later.kind) {
            // At the begin of a body, where nothing else begins.
            (Kind::Body { .. }, _) | (_, Kind::Body { .. }) => false,
            _ => self.start < later.end && later.start < self.end,
        }
    }
}

/// All replacements in a file.
pub fn of(file: &str, text: &str) -> Vec<Site> {
    let parsed = syn::parse_file(text).unwrap_or_else(|error| panic!("{file}: {error}"));
    let mut finder = Finder {
        text,
        lines: std::iter::once(0)
            .chain(text.match_indices('\n').map(|(at, _)| at + 1))
            .collect(),
        sites: Vec::new(),
    };
    finder.visit_file(&parsed);
    let Finder {
        lines, mut sites, ..
    } = finder;
    let source: Vec<&str> = text.lines().collect();
    for site in &mut sites {
        let line = source[site.line - 1];
        let begin = lines[site.line - 1] + line.len() - line.trim_start().len();
        let at = match site.kind {
            Kind::Operator { from, .. } => from,
            _ => site.start,
        };
        let column = at as isize - begin as isize;
        site.key = format!("{file}|{}|{column}|{}", line.trim(), site.what);
    }
    sites
}

struct Finder<'a> {
    text: &'a str,
    /// Byte at which each line begins.
    lines: Vec<usize>,
    sites: Vec<Site>,
}

impl Finder<'_> {
    fn byte(&self, place: proc_macro2::LineColumn) -> usize {
        let begin = self.lines[place.line - 1];
        let rest = &self.text[begin..];
        begin
            + rest
                .char_indices()
                .nth(place.column)
                .map_or(rest.len(), |(i, _)| i)
    }

    fn bytes(&self, of: &impl Spanned) -> (usize, usize) {
        let span = of.span();
        (self.byte(span.start()), self.byte(span.end()))
    }

    fn push(&mut self, at: (usize, usize), line: usize, kind: Kind, what: String) {
        self.sites.push(Site {
            key: String::new(),
            start: at.0,
            end: at.1,
            line,
            kind,
            what,
        });
    }

    fn body(&mut self, signature: &syn::Signature, block: &syn::Block) {
        if block.stmts.is_empty() {
            return;
        }
        let returns = match &signature.output {
            ReturnType::Default => "()".to_owned(),
            ReturnType::Type(_, kind) => {
                let (start, end) = self.bytes(kind);
                self.text[start..end].replace(char::is_whitespace, "")
            }
        };
        let values: &[&str] = match returns.as_str() {
            "()" => &["()"],
            "bool" => &["true", "false"],
            "f64" => &["0.0", "1.0", "-1.0"],
            "usize" | "u64" | "i64" | "u32" | "i32" => &["0", "1"],
            "String" => &["String::new()"],
            other if other.starts_with("Option<") => &["None"],
            other if other.starts_with("Vec<") => &["Vec::new()"],
            other if other == "Result<()>" || other.starts_with("Result<(),") => &["Ok(())"],
            other if other.starts_with("Result<Option<") => &["Ok(None)"],
            _ => &[],
        };
        let (start, end) = self.bytes(block);
        for value in values {
            let kind = Kind::Body {
                value: (*value).to_owned(),
            };
            let what = format!("fn {} -> {value}", signature.ident);
            let line = signature.fn_token.span.start().line;
            self.push((start + 1, end - 1), line, kind, what);
        }
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("test")
            || a.path().is_ident("cfg") && a.to_token_stream().to_string().contains("test")
    })
}

impl<'a> Visit<'a> for Finder<'_> {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_const(&mut self, _: &'a syn::ItemConst) {}
    fn visit_impl_item_const(&mut self, _: &'a syn::ImplItemConst) {}
    fn visit_item_static(&mut self, _: &'a syn::ItemStatic) {}
    fn visit_type(&mut self, _: &'a syn::Type) {}
    fn visit_pat(&mut self, _: &'a syn::Pat) {}
    fn visit_macro(&mut self, _: &'a syn::Macro) {}

    fn visit_expr_repeat(&mut self, repeat: &'a syn::ExprRepeat) {
        // The length is a constant.
        self.visit_expr(&repeat.expr);
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        if !is_test(&item.attrs) && item.sig.constness.is_none() {
            self.body(&item.sig, &item.block);
            self.visit_block(&item.block);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if !is_test(&item.attrs) && item.sig.constness.is_none() {
            self.body(&item.sig, &item.block);
            self.visit_block(&item.block);
        }
    }

    fn visit_item_impl(&mut self, item: &'a syn::ItemImpl) {
        let words = item.trait_.as_ref().is_some_and(|(_, path, _)| {
            path.segments
                .last()
                .is_some_and(|s| s.ident == "Debug" || s.ident == "Display")
        });
        if !words {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_expr_binary(&mut self, binary: &'a syn::ExprBinary) {
        let others: &[&'static str] = match binary.op {
            BinOp::Lt(_) => &["<=", ">"],
            BinOp::Le(_) => &["<", ">"],
            BinOp::Gt(_) => &[">=", "<"],
            BinOp::Ge(_) => &[">", "<"],
            BinOp::Eq(_) => &["!="],
            BinOp::Ne(_) => &["=="],
            BinOp::Add(_) => &["-", "*"],
            BinOp::Sub(_) => &["+", "/"],
            BinOp::Mul(_) => &["/", "+"],
            BinOp::Div(_) => &["*"],
            BinOp::Rem(_) => &["/", "+"],
            BinOp::And(_) => &["||"],
            BinOp::Or(_) => &["&&"],
            BinOp::AddAssign(_) => &["-=", "*="],
            BinOp::SubAssign(_) => &["+=", "/="],
            BinOp::MulAssign(_) => &["/=", "+="],
            BinOp::DivAssign(_) => &["*="],
            _ => &[],
        };
        // A chain of `let` is no value.
        if !binary.to_token_stream().to_string().contains("let ") {
            let whole = self.bytes(binary);
            let (from, to) = self.bytes(&binary.op);
            let line = binary.op.span().start().line;
            for with in others {
                let what = format!("{} => {with}", &self.text[from..to]);
                self.push(whole, line, Kind::Operator { from, to, with }, what);
            }
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_unary(&mut self, unary: &'a syn::ExprUnary) {
        let what = match unary.op {
            UnOp::Not(_) => Some("! => "),
            UnOp::Neg(_) if !matches!(*unary.expr, syn::Expr::Lit(_)) => Some("- => "),
            _ => None,
        };
        if let Some(what) = what {
            let inner = self.bytes(&unary.expr).0;
            let line = unary.span().start().line;
            let kind = Kind::Negation { inner };
            self.push(self.bytes(unary), line, kind, what.to_owned());
        }
        visit::visit_expr_unary(self, unary);
    }
}
