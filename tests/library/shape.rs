//! The shape of the code: modules use each other one way (`src/lib.rs` has the map), told from the paths in the sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A module, and for each module that it uses the files that do.
type Graph = BTreeMap<String, BTreeMap<String, BTreeSet<PathBuf>>>;

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files
}

/// `src/a/b.rs` and `src/a/b/mod.rs` are `[a, b]`.
fn module_of(file: &Path, src: &Path) -> Vec<String> {
    let relative = file.strip_prefix(src).unwrap().with_extension("");
    let mut parts: Vec<String> = relative
        .iter()
        .map(|part| part.to_str().unwrap().to_owned())
        .collect();
    if parts.last().is_some_and(|p| p == "mod") {
        parts.pop();
    }
    parts
}

/// A source without what only tests see, and the modules among it: an item ends with `;` in its first line, or with a
/// `}` at the margin, as `cargo fmt` lays it out. Items inside others are left.
fn without_tests(text: &str) -> (String, BTreeSet<String>) {
    let (mut kept, mut modules) = (String::new(), BTreeSet::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line != "#[cfg(test)]" {
            kept.push_str(line);
            kept.push('\n');
            continue;
        }
        let item = lines.by_ref().find(|line| !line.starts_with("#["));
        let item = item.unwrap_or_default();
        if item.ends_with(';') {
            let name = item.trim_end_matches(';').rsplit_once("mod ");
            modules.extend(name.map(|(_, name)| name.to_owned()));
        } else {
            lines.by_ref().find(|line| *line == "}");
        }
    }
    (kept, modules)
}

/// The first names of what follows `crate::`: one, or those of a list in braces.
fn names_at(text: &str) -> Vec<String> {
    let name = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let Some(list) = text.strip_prefix('{') else {
        return vec![name(text)];
    };
    let (mut names, mut depth, mut from) = (Vec::new(), 0, 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            ',' if depth == 0 => {
                names.push(name(list[from..at].trim_start()));
                from = at + 1;
            }
            '}' if depth == 0 => {
                names.push(name(list[from..at].trim_start()));
                break;
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

/// Modules that a source names, from the root of the crate: `crate::..`, and `super::..` from where it stands, each with one
/// name behind it.
fn paths(text: &str, module: &[String]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(at) = ["crate::", "super::"]
        .iter()
        .filter_map(|start| rest.find(start))
        .min()
    {
        let inside = rest[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let upward = rest[at..].starts_with("super::");
        rest = &rest[at + "crate::".len()..];
        let mut levels = usize::from(upward);
        while upward && let Some(after) = rest.strip_prefix("super::") {
            levels += 1;
            rest = after;
        }
        if inside || levels > module.len() {
            continue;
        }
        let root = if upward {
            &module[..module.len() - levels]
        } else {
            &[]
        };
        for name in names_at(rest) {
            let mut path = root.to_vec();
            path.push(name);
            found.push(path);
        }
    }
    found
}

/// What the modules of `src/` use of each other, tests and their fixtures apart.
fn graph() -> Graph {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let read: Vec<_> = sources(&src)
        .into_iter()
        .map(|file| {
            let module = module_of(&file, &src);
            let (text, tests) = without_tests(&fs::read_to_string(&file).unwrap());
            (file, module, text, tests)
        })
        .collect();
    let of_tests: BTreeSet<Vec<String>> = read
        .iter()
        .flat_map(|(_, module, _, tests)| {
            tests.iter().map(|name| {
                let mut path = module.clone();
                path.push(name.clone());
                path
            })
        })
        .collect();
    let binary = ["lib", "main"];
    let top: BTreeSet<&String> = read
        .iter()
        .map(|(_, module, ..)| &module[0])
        .filter(|name| !binary.contains(&name.as_str()))
        .collect();
    let mut graph = Graph::new();
    for (file, module, text, _) in &read {
        let tested = (1..=module.len()).any(|length| of_tests.contains(&module[..length]));
        if tested || !top.contains(&module[0]) {
            continue;
        }
        for path in paths(text, module) {
            let used = &path[0];
            if *used != module[0] && top.contains(used) {
                let uses = graph.entry(module[0].clone()).or_default();
                uses.entry(used.clone())
                    .or_default()
                    .insert(file.strip_prefix(&src).unwrap().to_owned());
            }
        }
    }
    graph
}

fn reached<'a>(graph: &'a Graph, from: &str, seen: &mut BTreeSet<&'a String>) {
    for next in graph.get(from).into_iter().flat_map(BTreeMap::keys) {
        if seen.insert(next) {
            reached(graph, next, seen);
        }
    }
}

/// Uses that lie on a circle, with the files that make them.
fn circular(graph: &Graph) -> Vec<String> {
    let mut found = Vec::new();
    for (module, uses) in graph {
        for (used, files) in uses {
            let mut seen = BTreeSet::new();
            reached(graph, used, &mut seen);
            if seen.contains(module) {
                found.push(format!("{module} uses {used} in {files:?}"));
            }
        }
    }
    found
}

#[test]
fn modules_use_each_other_one_way() {
    let graph = graph();
    // What is read is what there is.
    assert!(graph["identify"].contains_key("moments"), "{graph:?}");
    assert!(graph["report"].contains_key("explain"), "{graph:?}");
    let circular = circular(&graph);
    assert!(circular.is_empty(), "{}", circular.join("\n"));
}

#[test]
fn uses_are_seen_however_they_are_written() {
    let module = ["report".to_owned(), "text".to_owned()];
    let found = |text: &str| -> Vec<String> {
        let (text, _) = without_tests(text);
        let paths = paths(&text, &module);
        paths.iter().map(|path| path.join("/")).collect()
    };
    assert_eq!(found("use crate::log::{Log, Roles};"), ["log"]);
    assert_eq!(
        found("use crate::{\n    log::{Log, Roles},\n    model,\n};"),
        ["log", "model"]
    );
    assert_eq!(found("use super::super::log::Log;"), ["log"]);
    assert_eq!(found("use super::json;"), ["report/json"]);
    assert_eq!(found("let a: crate::model::Pole = b;"), ["model"]);
    assert_eq!(
        found("/// [`Log`](crate::log::Log), my_crate::log"),
        ["log"]
    );
    let tests = "#[cfg(test)]\nmod tests {\n    use crate::log::Log;\n}\nuse crate::model::Pole;";
    assert_eq!(found(tests), ["model"]);
    let (_, modules) = without_tests("#[cfg(test)]\npub(crate) mod fixtures;\n");
    assert_eq!(modules, BTreeSet::from(["fixtures".to_owned()]));
}

#[test]
fn circles_are_found() {
    let mut graph = Graph::new();
    let mut add = |module: &str, used: &str| {
        let file = PathBuf::from(format!("{module}.rs"));
        let uses = graph.entry(module.to_owned()).or_default();
        uses.entry(used.to_owned()).or_default().insert(file);
    };
    add("log", "limits");
    add("identify", "log");
    add("report", "identify");
    add("identify", "validate");
    add("validate", "report");
    assert_eq!(
        circular(&graph),
        [
            "identify uses validate in {\"identify.rs\"}",
            "report uses identify in {\"report.rs\"}",
            "validate uses report in {\"validate.rs\"}"
        ]
    );
}
