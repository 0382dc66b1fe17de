//! The shape of the code: modules use each other one way (`src/lib.rs` has the map), told from the paths in the sources;
//! folders hold few files, and a file's name says which one it is.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Files in a folder, subfolders apart, so that its listing is read at a glance.
const MOST_FILES: usize = 12;
/// Folders of `src/` in which names of files are repeated, in them or outside. These lists only become shorter.
const REPEATING: [&str; 2] = ["explain/engine", "physics"];
/// Folders of `src/` that are not looked at for circles between their files, their subfolders included.
const ENTANGLED: [&str; 2] = ["explain/engine", "physics"];

/// A module, and for each module that it uses the files that do.
type Graph = BTreeMap<String, BTreeMap<String, BTreeSet<PathBuf>>>;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every file in a folder and its subfolders.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path);
        }
    }
    found
}

pub(crate) fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut sources = files(folder);
    sources.retain(|path| path.extension().is_some_and(|e| e == "rs"));
    sources
}

/// `src/a/b.rs` and `src/a/b/mod.rs` are `[a, b]`, the root of the crate is `[]`.
fn module_of(file: &Path, src: &Path) -> Vec<String> {
    let relative = file.strip_prefix(src).unwrap().with_extension("");
    let mut parts: Vec<String> = relative
        .iter()
        .map(|part| part.to_str().unwrap().to_owned())
        .collect();
    if ["mod", "lib", "main"].contains(&parts[parts.len() - 1].as_str()) {
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

/// A path, and what it is called from then on.
pub(crate) struct Named {
    pub(crate) path: Vec<String>,
    pub(crate) alias: Option<String>,
}

/// Adds the paths of a use tree, `a::{b, c::d as e}`, each behind `prefix`; gives what follows the tree.
pub(crate) fn read_tree<'a>(text: &'a str, prefix: &[String], found: &mut Vec<Named>) -> &'a str {
    let name = |text: &'a str| -> (String, &'a str) {
        let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_'));
        let (name, rest) = text.split_at(end.unwrap_or(text.len()));
        (name.to_owned(), rest)
    };
    if let Some(mut rest) = text.strip_prefix('{') {
        loop {
            rest = rest.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
            if rest.is_empty() || rest.starts_with('}') {
                return rest.strip_prefix('}').unwrap_or(rest);
            }
            let before = rest.len();
            rest = read_tree(rest, prefix, found);
            if rest.len() == before {
                return rest;
            }
        }
    }
    let (first, rest) = name(text);
    if first.is_empty() {
        return rest;
    }
    let mut path = prefix.to_vec();
    path.push(first);
    match rest.strip_prefix("::") {
        Some(inner) if inner.starts_with(|c: char| c.is_alphabetic() || c == '_' || c == '{') => {
            read_tree(inner, &path, found)
        }
        _ => {
            let (alias, rest) = match rest.strip_prefix(" as ") {
                Some(alias) => name(alias),
                None => (String::new(), rest),
            };
            let alias = Some(alias).filter(|alias| !alias.is_empty());
            found.push(Named { path, alias });
            rest
        }
    }
}

/// Paths that a source names, from the root of the crate: behind `crate::`, and behind `super::` from where it stands.
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
        let above = if upward { module.len() - levels } else { 0 };
        rest = read_tree(rest, &module[..above], &mut found);
    }
    found.into_iter().map(|named| named.path).collect()
}

/// Names that a module takes from the modules in it, each with that module.
fn exports(text: &str) -> BTreeMap<String, String> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("use ") {
        let line = text[..at].rsplit('\n').next().unwrap_or_default();
        if line.is_empty() || line.starts_with("pub") {
            let tree = text[at + "use ".len()..].trim_start_matches("self::");
            read_tree(tree, &[], &mut found);
        }
    }
    found
        .into_iter()
        .filter(|named| named.path.len() > 1)
        .map(|named| {
            let last = named.path[named.path.len() - 1].clone();
            (named.alias.unwrap_or(last), named.path[0].clone())
        })
        .collect()
}

/// A source as it is looked at.
struct Read {
    /// From `src/`.
    file: PathBuf,
    module: Vec<String>,
    /// Without comments and without what only tests see.
    code: String,
    /// Paths that it names, those of its comments too.
    paths: Vec<Vec<String>>,
    /// Without those.
    paths_of_code: Vec<Vec<String>>,
}

/// The sources without tests and their fixtures.
fn read() -> Vec<Read> {
    let src = root().join("src");
    let (mut read, mut of_tests) = (Vec::new(), BTreeSet::new());
    for file in sources(&src) {
        let module = module_of(&file, &src);
        if module.iter().any(|part| part == "tests") {
            continue;
        }
        let (text, tests) = without_tests(&fs::read_to_string(&file).unwrap());
        of_tests.extend(tests.into_iter().map(|name| {
            let mut path = module.clone();
            path.push(name);
            path
        }));
        let code = |line: &&str| !line.trim_start().starts_with("//");
        let code = text.lines().filter(code).collect::<Vec<_>>().join("\n");
        read.push(Read {
            file: file.strip_prefix(&src).unwrap().to_owned(),
            paths: paths(&text, &module),
            paths_of_code: paths(&code, &module),
            module,
            code,
        });
    }
    read.retain(|Read { module, .. }| {
        !(1..=module.len()).any(|length| of_tests.contains(&module[..length]))
    });
    read
}

/// What the modules in the module `root` use of each other. Between the modules of `src/` links in the documentation
/// count too; inside one of them a part may point to the function that it is a part of.
fn graph(read: &[Read], root: &[&str]) -> Graph {
    // The module in `root` that a path leads into.
    let inside = |path: &[String]| -> Option<String> {
        path.starts_with(&root.iter().map(ToString::to_string).collect::<Vec<_>>())
            .then(|| path.get(root.len()).cloned())?
    };
    let modules: BTreeSet<String> = read.iter().filter_map(|r| inside(&r.module)).collect();
    let exported: BTreeMap<String, String> = read
        .iter()
        .filter(|source| source.module == root)
        .flat_map(|source| exports(&source.code))
        .collect();
    let mut graph = Graph::new();
    for source in read {
        let Some(user) = inside(&source.module) else {
            continue;
        };
        let paths = match root {
            [] => &source.paths,
            _ => &source.paths_of_code,
        };
        for path in paths {
            let Some(name) = inside(path) else {
                continue;
            };
            let used = if modules.contains(&name) {
                &name
            } else if let Some(used) = exported.get(&name) {
                used
            } else {
                continue;
            };
            if *used != user && modules.contains(used) {
                let uses = graph.entry(user.clone()).or_default();
                let files = uses.entry(used.clone()).or_default();
                files.insert(source.file.clone());
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

/// Folders of `src/` with what holds for them, each as a path from there.
fn folders() -> BTreeMap<String, Vec<PathBuf>> {
    let src = root().join("src");
    let mut folders = BTreeMap::<String, Vec<PathBuf>>::new();
    for file in files(&src) {
        let folder = file.parent().unwrap().strip_prefix(&src).unwrap();
        let folder = folder.to_str().unwrap().replace('\\', "/");
        folders.entry(folder).or_default().push(file);
    }
    folders
}

/// Names of files, other than those that Rust and Cargo ask for, that stand in several of the places.
fn repeated<'a>(places: impl IntoIterator<Item = &'a PathBuf>) -> Vec<Vec<&'a PathBuf>> {
    let mut named = BTreeMap::<_, Vec<_>>::new();
    for file in places {
        named
            .entry(file.file_name().unwrap())
            .or_default()
            .push(file);
    }
    for given in ["mod.rs", "lib.rs", "main.rs"] {
        named.remove(std::ffi::OsStr::new(given));
    }
    named
        .into_values()
        .filter(|files| files.len() > 1)
        .collect()
}

#[test]
fn modules_use_each_other_one_way() {
    let graph = graph(&read(), &[]);
    // What is read is what there is.
    assert!(graph["identify"].contains_key("moments"), "{graph:?}");
    assert!(graph["report"].contains_key("explain"), "{graph:?}");
    let circular = circular(&graph);
    assert!(circular.is_empty(), "{}", circular.join("\n"));
}

#[test]
fn files_and_subfolders_use_each_other_one_way() {
    let read = read();
    let identify = graph(&read, &["identify"]);
    assert!(identify["method"].contains_key("subspace"), "{identify:?}");
    let order = graph(&read, &["identify", "order"]);
    assert!(order["select_order"].contains_key("evidence"), "{order:?}");
    let linear = graph(&read, &["explain", "linear"]);
    assert!(linear["search"].contains_key("screening"), "{linear:?}");
    let mut found = Vec::new();
    for folder in folders().into_keys() {
        let modules: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
        let listed = |entangled: &&str| Path::new(&folder).starts_with(entangled);
        if !modules.is_empty() && !ENTANGLED.iter().any(listed) {
            let circular = circular(&graph(&read, &modules));
            found.extend(
                circular
                    .into_iter()
                    .map(|circle| format!("{folder}: {circle}")),
            );
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn folders_hold_few_files() {
    let mut crowded = folders();
    crowded.retain(|_, files| files.len() > MOST_FILES);
    let crowded: Vec<String> = crowded.into_keys().collect();
    assert!(
        crowded.is_empty(),
        "folders with more than {MOST_FILES} files: {crowded:?}"
    );
}

#[test]
fn names_of_files_are_not_repeated() {
    let src = root().join("src");
    let all = sources(&src);
    let beside = |file: &&PathBuf| {
        let listed = |folder: &&str| file.starts_with(src.join(folder));
        !REPEATING.iter().any(listed)
    };
    let found = repeated(all.iter().filter(beside));
    assert!(found.is_empty(), "{found:#?}");
    for folder in REPEATING {
        let found = repeated(&all);
        let mut found = found.iter().flatten();
        let still = found.any(|file| file.starts_with(src.join(folder)));
        assert!(
            still,
            "{folder} repeats no name any more: take it from the list"
        );
    }
    let tests = sources(&root().join("tests"));
    let found = repeated(&tests);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn uses_are_seen_however_they_are_written() {
    let module = ["report".to_owned(), "text".to_owned()];
    let found = |text: &str| -> Vec<String> {
        let (text, _) = without_tests(text);
        let paths = paths(&text, &module);
        paths.iter().map(|path| path.join("/")).collect()
    };
    assert_eq!(
        found("use crate::log::{Log, Roles};"),
        ["log/Log", "log/Roles"]
    );
    assert_eq!(
        found("use crate::{\n    log::{Log, Roles},\n    model as plant,\n};\nuse crate::linalg;"),
        ["log/Log", "log/Roles", "model", "linalg"]
    );
    assert_eq!(found("use super::super::log::Log;"), ["log/Log"]);
    assert_eq!(
        found("use super::{json, number};"),
        ["report/json", "report/number"]
    );
    assert_eq!(found("use super::*;"), [""; 0]);
    assert_eq!(
        found("let a: Vec<crate::model::Pole> = crate::log::of(super::b::<f64>());"),
        ["model/Pole", "log/of", "report/b"]
    );
    assert_eq!(
        found("/// [`Log`](crate::log::Log), my_crate::log"),
        ["log/Log"]
    );
    let tests = "#[cfg(test)]\nmod tests {\n    use crate::log::Log;\n}\nuse crate::model::Pole;";
    assert_eq!(found(tests), ["model/Pole"]);
    let (_, modules) = without_tests("#[cfg(test)]\npub(crate) mod fixtures;\n");
    assert_eq!(modules, BTreeSet::from(["fixtures".to_owned()]));
    assert_eq!(
        exports("mod a;\npub use a::{B, c::D as E};\nuse self::a::f;\n"),
        ["B", "E", "f"]
            .map(|name| (name.to_owned(), "a".to_owned()))
            .into()
    );
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
