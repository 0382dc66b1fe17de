//! The public API as a list that is checked in: a change of it is seen in review, and not by accident.
//!
//! Read from the sources, laid out by `cargo fmt`: `src/lib.rs` names the modules and their `mod.rs` the names that they show,
//! each by `pub use` without `*`. Of a type its public fields or variants are listed, and the functions of its own. What traits
//! do for it is not, nor are types that are returned but not named. `UPDATE_PUBLIC_API=1 cargo test --test library public_api`
//! writes the list.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const LIST: &str = "docs/public_api.txt";
const KINDS: [&str; 6] = ["const", "enum", "fn", "struct", "trait", "type"];

fn read(file: &Path) -> String {
    fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

/// The file of a module, from the folder `src`.
fn file_of(module: &[&str]) -> PathBuf {
    let folder = Path::new("src").join(module.iter().collect::<PathBuf>());
    match module {
        [] => folder.join("lib.rs"),
        _ if folder.join("mod.rs").exists() => folder.join("mod.rs"),
        _ => folder.with_extension("rs"),
    }
}

/// Names that a source takes from elsewhere, each as its path and what it is called here; of the API alone or all.
fn uses(text: &str, public: bool) -> Vec<(Vec<&str>, &str)> {
    let mut found = Vec::new();
    for start in ["pub use ", "pub(crate) use ", "pub(super) use "] {
        for (at, _) in text.match_indices(start) {
            let whole_line = at == 0 || text[..at].ends_with('\n');
            if !whole_line || (public && start != "pub use ") {
                continue;
            }
            let tree = text[at + start.len()..].split(';').next().unwrap();
            let (path, names) = match tree.split_once("::{") {
                Some((path, names)) => (path, names.trim_end_matches('}')),
                None => tree.rsplit_once("::").unwrap(),
            };
            assert!(
                !names.contains(['{', '*']),
                "{tree}: one name after the other"
            );
            for name in names.split(',').map(str::trim).filter(|n| !n.is_empty()) {
                let (name, alias) = name.split_once(" as ").unwrap_or((name, name));
                let path = path.split("::").filter(|part| *part != "self");
                found.push((path.chain([name]).collect(), alias));
            }
        }
    }
    found
}

/// Where an item is defined: the file, and where its line begins.
fn definition(module: &[&str], name: &str) -> (PathBuf, usize) {
    let file = file_of(module);
    let text = read(&file);
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let words = line
            .strip_prefix("pub ")
            .map(|rest| rest.splitn(2, ' ').collect::<Vec<_>>());
        if let Some([kind, rest]) = words.as_deref()
            && KINDS.contains(kind)
            && rest
                .strip_prefix(name)
                .is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        {
            return (file, at);
        }
        at += line.len();
    }
    let used = uses(&text, false)
        .into_iter()
        .find(|(_, alias)| *alias == name);
    let (path, _) = used.unwrap_or_else(|| panic!("{}: `{name}` is not here", file.display()));
    let (name, path) = path.split_last().unwrap();
    match path {
        ["crate", path @ ..] => definition(path, name),
        ["super", path @ ..] => definition(&[&module[..module.len() - 1], path].concat(), name),
        path => definition(&[module, path].concat(), name),
    }
}

/// A declaration in one line, up to its body.
fn declaration(text: &str) -> String {
    let end = text.find(['{', ';']).unwrap_or(text.len());
    let words = text[..end].split_whitespace().collect::<Vec<_>>().join(" ");
    words
        .replace("( ", "(")
        .replace(", )", ")")
        .replace(",)", ")")
}

/// What a block at the margin holds: lines that start one level in, each with what follows it.
fn members(block: &str) -> impl Iterator<Item = &str> {
    let end = block.find("\n}").unwrap_or(block.len());
    block[..end]
        .match_indices("\n    ")
        .map(move |(at, space)| &block[at + space.len()..end])
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Adds an item, and what is public of it.
fn list(shown: &str, module: &[&str], name: &str, found: &mut BTreeSet<String>) {
    let (file, at) = definition(module, name);
    let text = read(&file);
    let item = &text[at + "pub ".len()..];
    let kind = item.split(' ').next().unwrap();
    if matches!(kind, "fn" | "const" | "type") {
        found.insert(format!(
            "{shown}: {}",
            declaration(item).split(" = ").next().unwrap()
        ));
        return;
    }
    found.insert(format!("{shown}: {kind}"));
    if item[..item.find('\n').unwrap()].ends_with('{') {
        for member in members(item) {
            let line = member.split('\n').next().unwrap().trim_end_matches(',');
            let of_enum = kind == "enum" && line.starts_with(|c: char| c.is_ascii_uppercase());
            let of_trait = kind == "trait" && line.starts_with("fn ");
            if of_enum || of_trait {
                found.insert(format!(
                    "{shown}::{}",
                    declaration(member).split(',').next().unwrap()
                ));
            } else if let Some(field) = line.strip_prefix("pub ") {
                found.insert(format!("{shown}.{field}"));
            }
        }
    }
    let mut files = Vec::new();
    sources(file.parent().unwrap(), &mut files);
    for text in files.iter().map(|file| read(file)) {
        for (at, _) in text.match_indices("\nimpl") {
            let head = text[at + 1..].split(" {\n").next().unwrap();
            let of = head
                .trim_start_matches("impl")
                .rsplit("> ")
                .next()
                .unwrap()
                .trim();
            if head.contains(" for ") || of.split('<').next() != Some(name) {
                continue;
            }
            for member in members(&text[at + 1..]).filter_map(|m| m.strip_prefix("pub ")) {
                found.insert(format!(
                    "{shown}::{}",
                    declaration(member).split(" = ").next().unwrap()
                ));
            }
        }
    }
}

/// Adds what a module shows, and the modules in it.
fn walk(module: &[&str], found: &mut BTreeSet<String>) {
    let text = read(&file_of(module));
    let shown = |name: &str| [module, &[name]].concat().join("::");
    for (_, name) in uses(&text, true) {
        list(&shown(name), module, name, found);
    }
    let mut hidden = false;
    for line in text.lines() {
        let words = line.split(['(', ' ', '<', ';', ':']).collect::<Vec<_>>();
        match words[..] {
            ["pub", "mod", name, ""] if !hidden => walk(&[module, &[name]].concat(), found),
            ["pub", kind, name, ..] if KINDS.contains(&kind) => {
                list(&shown(name), module, name, found)
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
    let found = found
        .into_iter()
        .map(|line| line + "\n")
        .collect::<String>();
    if std::env::var_os("UPDATE_PUBLIC_API").is_some() {
        fs::write(LIST, &found).unwrap();
    }
    let listed = read(Path::new(LIST));
    let (found, listed): (BTreeSet<_>, BTreeSet<_>) =
        (found.lines().collect(), listed.lines().collect());
    let news: Vec<_> = found
        .difference(&listed)
        .map(|line| format!("+ {line}"))
        .collect();
    let gone: Vec<_> = listed
        .difference(&found)
        .map(|line| format!("- {line}"))
        .collect();
    assert!(
        news.is_empty() && gone.is_empty(),
        "not as in {LIST}:\n{}\n{}",
        news.join("\n"),
        gone.join("\n")
    );
}
