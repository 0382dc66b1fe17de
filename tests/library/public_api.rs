//! The public API as a list that is checked in: a change of it is seen in review, and not by accident.
//!
//! Read from the sources as `cargo fmt` lays them out: `src/lib.rs` names the modules, and their `mod.rs` the names that they
//! show. Of a type its public fields or variants are listed, and its own functions; not what traits do for it.
//! `UPDATE_PUBLIC_API=1 cargo test --test library public_api` writes the list.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::shape::{read_tree, sources};

const LIST: &str = "docs/public_api.txt";
const KINDS: [&str; 6] = ["const", "enum", "fn", "struct", "trait", "type"];

/// The file of a module, and its text.
fn read(module: &[String]) -> (PathBuf, String) {
    let folder = Path::new("src").join(module.iter().collect::<PathBuf>());
    let files = [
        folder.join("lib.rs"),
        folder.join("mod.rs"),
        folder.with_extension("rs"),
    ];
    let file = files.into_iter().find(|file| file.exists()).unwrap();
    let text = fs::read_to_string(&file).unwrap();
    (file, text)
}

/// Names that a source takes from elsewhere: path, and what each is called here.
fn uses(text: &str, starts: &[&str]) -> Vec<(Vec<String>, String)> {
    let mut found = Vec::new();
    for start in starts {
        for (at, _) in text.match_indices(start) {
            read_tree(&text[at + start.len()..], &[], &mut found);
        }
    }
    let last = |path: &[String]| path[path.len() - 1].clone();
    found
        .into_iter()
        .map(|n| (n.path.clone(), n.alias.unwrap_or_else(|| last(&n.path))))
        .collect()
}

/// Kind and name of the public item that a line begins.
fn item(line: &str) -> Option<(&str, &str)> {
    let (kind, rest) = line.strip_prefix("pub ")?.split_once(' ')?;
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
    Some((kind, &rest[..end.unwrap_or(rest.len())]))
}

/// Where an item is defined: the file, and its text from there on.
fn definition(module: &[String], name: &str) -> (PathBuf, String) {
    let (file, text) = read(module);
    let here = |line: &&str| item(line).is_some_and(|(k, n)| KINDS.contains(&k) && n == name);
    if let Some(line) = text.lines().find(here) {
        let at = text.find(&format!("\n{line}\n")).unwrap() + 1;
        return (file, text[at..].to_owned());
    }
    let starts = ["\npub use ", "\npub(crate) use ", "\npub(super) use "];
    let (path, _) = uses(&text, &starts)
        .into_iter()
        .find(|(_, alias)| alias == name)
        .unwrap_or_else(|| panic!("{}: `{name}` is not here", file.display()));
    let (name, path) = path.split_last().unwrap();
    match path.first().map(String::as_str) {
        Some("crate") => definition(&path[1..], name),
        Some("self") => definition(&[module, &path[1..]].concat(), name),
        Some("super") => definition(&[&module[..module.len() - 1], &path[1..]].concat(), name),
        _ => definition(&[module, path].concat(), name),
    }
}

/// A declaration in one line, without its body or value.
fn declaration(text: &str) -> String {
    let end = text.find(['{', ';']).unwrap_or(text.len());
    let words = text[..end].split_whitespace().collect::<Vec<_>>();
    let line = words.join(" ").replace("( ", "(").replace(", )", ")");
    line.split(" = ").next().unwrap().to_owned()
}

/// What stands in a block one level in, each with what follows it.
fn members(block: &str) -> impl Iterator<Item = &str> {
    let block = &block[..block.find("\n}").unwrap_or(block.len())];
    block.split_inclusive("\n    ").scan(0, |at, part| {
        *at += part.len();
        Some(&block[*at..])
    })
}

/// Adds an item, and what is public of it.
fn list(shown: &str, module: &[String], name: &str, found: &mut BTreeSet<String>) {
    let (file, text) = definition(module, name);
    let (kind, _) = item(&text).unwrap();
    if matches!(kind, "fn" | "const" | "type") {
        found.insert(format!("{shown}: {}", declaration(&text["pub ".len()..])));
        return;
    }
    found.insert(format!("{shown}: {kind}"));
    let whole = text.lines().next().unwrap().ends_with('{');
    for member in members(&text).filter(|_| whole) {
        let line = member.lines().next().unwrap_or_default();
        let variant = kind == "enum" && line.starts_with(|c: char| c.is_ascii_uppercase());
        if variant || (kind == "trait" && line.starts_with("fn ")) {
            let head = declaration(member);
            let end = head.find(if variant { ',' } else { '\n' });
            found.insert(format!("{shown}::{}", &head[..end.unwrap_or(head.len())]));
        } else if let Some(field) = line.strip_prefix("pub ") {
            found.insert(format!("{shown}.{}", field.trim_end_matches(',')));
        }
    }
    for file in sources(file.parent().unwrap()) {
        let text = fs::read_to_string(file).unwrap();
        for (at, _) in text.match_indices("\nimpl") {
            let head = text[at + 1..].lines().next().unwrap();
            let of = head.trim_start_matches("impl").trim_end_matches(" {");
            let of = of.rsplit("> ").next().unwrap().trim();
            if head.contains(" for ") || of.split('<').next() != Some(name) {
                continue;
            }
            for member in members(&text[at + 1..]).filter_map(|m| m.strip_prefix("pub ")) {
                found.insert(format!("{shown}::{}", declaration(member)));
            }
        }
    }
}

/// Adds what a module shows, and the modules in it.
fn walk(module: &[String], found: &mut BTreeSet<String>) {
    let (_, text) = read(module);
    let inner = |name: &str| [module, &[name.to_owned()]].concat();
    for (_, name) in uses(&text, &["\npub use "]) {
        list(&inner(&name).join("::"), module, &name, found);
    }
    let mut hidden = false;
    for line in text.lines() {
        match item(line) {
            Some(("mod", name)) if line.ends_with(';') && !hidden => walk(&inner(name), found),
            Some((kind, name)) if KINDS.contains(&kind) => {
                list(&inner(name).join("::"), module, name, found);
            }
            _ => {}
        }
        hidden = line == "#[doc(hidden)]" || (hidden && line.starts_with("#["));
    }
}

#[test]
fn public_api_is_as_listed() {
    let mut found = BTreeSet::new();
    walk(&[], &mut found);
    let list: Vec<String> = found.into_iter().collect();
    if std::env::var_os("UPDATE_PUBLIC_API").is_some() {
        fs::write(LIST, list.join("\n") + "\n").unwrap();
    }
    let listed = fs::read_to_string(LIST).unwrap();
    let (new, old): (BTreeSet<_>, BTreeSet<_>) = (
        list.iter().map(String::as_str).collect(),
        listed.lines().collect(),
    );
    let (added, gone) = (&new - &old, &old - &new);
    assert!(
        new == old,
        "not as in {LIST}: added {added:#?}, gone {gone:#?}"
    );
}
