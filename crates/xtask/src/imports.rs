//! No circle of imports among the modules of the engine: each can be read, tested and changed without what imports it.
//!
//! A module is what a file or folder of `crates/sutura/src` holds, all below it included. Paths from the root of the
//! crate are imports wherever they stand in code: in `use`, in expressions and types, within macros. What only tests
//! import does not count, nor does `lib.rs`, which names them all.

use crate::tally::{Tally, root};
use proc_macro2::{Ident, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::visit::{self, Visit};
use syn::{Attribute, UseTree};

/// The folder of the engine's sources.
const ENGINE: &str = "crates/sutura/src";

/// `cargo xtask imports [--list]`.
pub fn command(tally: &mut Tally, args: &[String]) -> Result<(), String> {
    match args {
        [] => check(tally),
        [list] if list == "--list" => {
            if let Ok(graph) = engine() {
                graph.imports.keys().for_each(|import| println!("{}", graph.line(import)));
            }
            check(tally);
        }
        _ => return Err("`imports` takes no argument but `--list`".into()),
    }
    Ok(())
}

/// Counts as failed, and says by which imports, where modules import each other in a circle.
pub fn check(tally: &mut Tally) {
    let result = engine().and_then(|graph| match graph.circles() {
        circles if circles.is_empty() => {
            Ok(format!("{} modules, {} imports", graph.modules.len(), graph.imports.len()))
        }
        circles => Err(graph.describe(&circles)),
    });
    if let Ok(counts) = &result {
        println!("   imports of the engine: {counts}, no circle");
    }
    tally.count("imports of the engine", result.map(|_| ()));
}

/// The modules of the engine.
fn engine() -> Result<Graph, String> {
    let mut sources = Vec::new();
    collect(&root().join(ENGINE), "", &mut sources)?;
    Graph::read(&sources)
}

/// Path below `folder`, with slashes, and text of every Rust file there.
fn collect(folder: &Path, below: &str, sources: &mut Vec<(String, String)>) -> Result<(), String> {
    let problem = |e: std::io::Error| format!("{}: {e}", folder.join(below).display());
    for entry in std::fs::read_dir(folder.join(below)).map_err(problem)? {
        let path = entry.map_err(problem)?.path();
        let name = format!("{below}{}", path.file_name().unwrap_or_default().display());
        if path.is_dir() {
            collect(folder, &format!("{name}/"), sources)?;
        } else if name.ends_with(".rs") {
            sources.push((name, std::fs::read_to_string(path).map_err(problem)?));
        }
    }
    Ok(())
}

/// Who imports whom.
struct Graph {
    modules: BTreeSet<String>,
    /// The importing module and the imported one, with the file and line of the first such import.
    imports: BTreeMap<(String, String), (String, usize)>,
}

impl Graph {
    /// Reads it from files with their paths below the folder of `lib.rs`; an error where a file is not Rust, or a path
    /// begins with what `lib.rs` does not name.
    fn read(sources: &[(String, String)]) -> Result<Self, String> {
        let mut sources: Vec<_> = sources.iter().filter(|(file, _)| !is_of_tests(file)).collect();
        sources.sort();
        let files = sources.iter().filter(|(file, _)| file != "lib.rs");
        let mut graph = Graph { modules: files.clone().map(|(f, _)| module(f)).collect(), imports: BTreeMap::new() };
        let parse = |file: &str, text: &str| {
            syn::parse_file(text).map_err(|e| format!("{ENGINE}/{file}:{}: {e}", e.span().start().line))
        };
        let lib = sources.iter().find(|(file, _)| file == "lib.rs").map_or("", |(_, text)| text);
        let names = exported(&parse("lib.rs", lib)?);
        for (file, text) in files {
            let mut reader = Reader { depth: depth(file), found: Vec::new() };
            reader.visit_file(&parse(file, text)?);
            let from = module(file);
            for Segment { name, line } in reader.found {
                let to = match names.get(&name) {
                    _ if graph.modules.contains(&name) => &name,
                    Some(origin) => origin,
                    None => return Err(format!("{ENGINE}/{file}:{line}: lib.rs has no module and no name `{name}`")),
                };
                // What `lib.rs` exports may also be of another crate.
                if *to != from && graph.modules.contains(to) {
                    graph.imports.entry((from.clone(), to.clone())).or_insert((file.clone(), line));
                }
            }
        }
        Ok(graph)
    }

    /// Sets of modules each of which imports every other one, directly or by way of others.
    fn circles(&self) -> Vec<BTreeSet<&str>> {
        let mut reach: BTreeSet<(&str, &str)> = self.imports.keys().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        let modules = || self.modules.iter().map(String::as_str);
        for via in modules() {
            for from in modules().filter(|from| reach.contains(&(*from, via))).collect::<Vec<_>>() {
                let beyond: Vec<_> = modules().filter(|to| reach.contains(&(via, *to))).collect();
                reach.extend(beyond.into_iter().map(|to| (from, to)));
            }
        }
        let circle = |a| modules().filter(|b| reach.contains(&(a, *b)) && reach.contains(&(*b, a))).collect();
        let circles: BTreeSet<BTreeSet<&str>> = modules().map(circle).collect();
        circles.into_iter().filter(|c| !c.is_empty()).collect()
    }

    /// The modules of each circle, and a place of each import within it.
    fn describe(&self, circles: &[BTreeSet<&str>]) -> String {
        let mut lines = Vec::new();
        for circle in circles {
            let names: Vec<&str> = circle.iter().copied().collect();
            lines.push(format!("{} modules import each other in a circle: {}", names.len(), names.join(", ")));
            let within = |(a, b): &&(String, String)| circle.contains(a.as_str()) && circle.contains(b.as_str());
            lines.extend(self.imports.keys().filter(within).map(|import| format!("  {}", self.line(import))));
        }
        lines.join("\n")
    }

    fn line(&self, import: &(String, String)) -> String {
        let (file, line) = &self.imports[import];
        format!("{:24} {ENGINE}/{file}:{line}", format!("{} -> {}", import.0, import.1))
    }
}

fn is_of_tests(file: &str) -> bool {
    file.split('/').any(|part| part == "tests" || part == "tests.rs")
}

/// The module that a file belongs to.
fn module(file: &str) -> String {
    file.split('/').next().unwrap_or_default().trim_end_matches(".rs").to_string()
}

/// How many modules a file is below the root of the crate.
fn depth(file: &str) -> usize {
    file.split('/').filter(|part| *part != "mod.rs").count()
}

/// The names that `lib.rs` exports, with the module or crate that each is from.
fn exported(lib: &syn::File) -> BTreeMap<String, String> {
    let mut leaves = Vec::new();
    for item in &lib.items {
        if let syn::Item::Use(item) = item {
            flatten(&item.tree, &[], &mut leaves);
        }
    }
    leaves.into_iter().filter_map(|leaf| Some((leaf.name, first_name(&leaf.path)?.name.clone()))).collect()
}

/// A part of a path.
#[derive(Debug, Clone)]
struct Segment {
    name: String,
    line: usize,
}

impl From<&Ident> for Segment {
    fn from(ident: &Ident) -> Self {
        Segment { name: ident.to_string(), line: ident.span().start().line }
    }
}

/// The first part of a path behind the words that say where it begins.
fn first_name(path: &[Segment]) -> Option<&Segment> {
    path.iter().find(|s| !matches!(s.name.as_str(), "crate" | "self" | "super"))
}

/// One thing imported by `use`, and what it is called there.
struct Leaf {
    path: Vec<Segment>,
    name: String,
}

/// Takes the groups of an import apart.
fn flatten(tree: &UseTree, before: &[Segment], leaves: &mut Vec<Leaf>) {
    let with = |segment: Segment| [before, &[segment]].concat();
    match tree {
        UseTree::Path(path) => flatten(&path.tree, &with((&path.ident).into()), leaves),
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, leaves)),
        UseTree::Name(name) => leaves.push(Leaf { path: with((&name.ident).into()), name: name.ident.to_string() }),
        UseTree::Rename(as_) => leaves.push(Leaf { path: with((&as_.ident).into()), name: as_.rename.to_string() }),
        UseTree::Glob(glob) => {
            let all = Segment { name: "*".into(), line: glob.star_token.spans[0].start().line };
            leaves.push(Leaf { path: with(all), name: "*".into() });
        }
    }
}

/// Finds the paths from the root of the crate in a file.
struct Reader {
    /// How many modules below the root what is read now is.
    depth: usize,
    /// The first name of each path behind `crate`, or behind as many `super` as lead to the root.
    found: Vec<Segment>,
}

impl Reader {
    fn note(&mut self, path: &[Segment]) {
        let up = path.iter().filter(|s| s.name == "super").count();
        let from_root = path.first().is_some_and(|s| s.name == "crate") || (up > 0 && up == self.depth);
        self.found.extend(first_name(path).filter(|_| from_root).cloned());
    }

    /// Macros have no syntax but tokens. What follows `crate::` there and is no name, as a group, is noted as it is.
    fn scan(&mut self, tokens: TokenStream) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        let is_colon = |tree: &TokenTree| matches!(tree, TokenTree::Punct(p) if p.as_char() == ':');
        for (i, tree) in trees.iter().enumerate() {
            match tree {
                TokenTree::Group(group) => self.scan(group.stream()),
                TokenTree::Ident(ident) => {
                    let mut path = vec![Segment::from(ident)];
                    let mut rest = &trees[i + 1..];
                    while let [a, b, next, after @ ..] = rest
                        && is_colon(a)
                        && is_colon(b)
                    {
                        path.push(Segment { name: next.to_string(), line: next.span().start().line });
                        rest = after;
                    }
                    self.note(&path);
                }
                _ => {}
            }
        }
    }
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| a.path().is_ident("cfg") && a.parse_args::<Ident>().is_ok_and(|what| what == "test"))
}

/// Passes over what has `#[cfg(test)]`.
macro_rules! without_tests {
    ($($visit:ident($node:ident);)*) => {$(
        fn $visit(&mut self, node: &'ast syn::$node) {
            if !is_for_tests(&node.attrs) {
                visit::$visit(self, node);
            }
        }
    )*};
}

impl<'ast> Visit<'ast> for Reader {
    without_tests! {
        visit_item_const(ItemConst);
        visit_item_fn(ItemFn);
        visit_item_impl(ItemImpl);
        visit_item_struct(ItemStruct);
        visit_impl_item_fn(ImplItemFn);
        visit_field(Field);
        visit_local(Local);
    }

    fn visit_item_mod(&mut self, node: &'ast syn::ItemMod) {
        if !is_for_tests(&node.attrs) {
            self.depth += 1;
            visit::visit_item_mod(self, node);
            self.depth -= 1;
        }
    }

    fn visit_item_use(&mut self, node: &'ast syn::ItemUse) {
        if !is_for_tests(&node.attrs) {
            let mut leaves = Vec::new();
            flatten(&node.tree, &[], &mut leaves);
            leaves.iter().for_each(|leaf| self.note(&leaf.path));
        }
    }

    fn visit_path(&mut self, node: &'ast syn::Path) {
        self.note(&node.segments.iter().map(|s| (&s.ident).into()).collect::<Vec<_>>());
        visit::visit_path(self, node);
    }

    fn visit_macro(&mut self, node: &'ast syn::Macro) {
        visit::visit_macro(self, node);
        self.scan(node.tokens.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(sources: &[(&str, &str)]) -> Result<Graph, String> {
        Graph::read(&sources.iter().map(|(file, text)| (file.to_string(), text.to_string())).collect::<Vec<_>>())
    }

    /// The imports of `a`, which is in one file, as `module:line`; there are modules `b`, `c` and `d`.
    fn imports_of(a: &str) -> Vec<String> {
        let lib = "pub use b::Bolt;\npub use c::{inner::Cup as Mug, Cap};\npub use glam;";
        let graph = read(&[("lib.rs", lib), ("a.rs", a), ("b.rs", ""), ("c/mod.rs", ""), ("d.rs", "")]).unwrap();
        assert!(graph.imports.keys().all(|(from, _)| from == "a"));
        graph.imports.iter().map(|((_, to), (_, line))| format!("{to}:{line}")).collect()
    }

    #[test]
    fn a_circle_is_found_with_a_place_for_each_import_within_it() {
        let graph = read(&[
            ("lib.rs", "mod rod;"),
            ("rod/mod.rs", "use crate::math::Pose;\n"),
            ("rod/factor.rs", "\nuse crate::row::Row;\nuse crate::row::Other;"),
            ("row.rs", "use crate::step;"),
            ("step.rs", "use crate::rod;\nuse crate::world;"),
            ("math.rs", ""),
            ("world.rs", "fn f() {}"),
        ])
        .unwrap();
        let circles = graph.circles();
        assert_eq!(circles, [BTreeSet::from(["rod", "row", "step"])]);
        let lines: Vec<String> =
            graph.describe(&circles).lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
        assert_eq!(
            lines,
            [
                "3 modules import each other in a circle: rod, row, step",
                "rod -> row crates/sutura/src/rod/factor.rs:2",
                "row -> step crates/sutura/src/row.rs:1",
                "step -> rod crates/sutura/src/step.rs:1",
            ]
        );
    }

    #[test]
    fn circles_that_share_no_module_are_told_apart() {
        let graph = read(&[
            ("a.rs", "use crate::{b, c};"),
            ("b.rs", "use crate::a;"),
            ("c.rs", "use crate::d;"),
            ("d.rs", "use crate::c;"),
            ("e.rs", "use crate::{a, d};"),
        ])
        .unwrap();
        assert_eq!(graph.circles(), [BTreeSet::from(["a", "b"]), BTreeSet::from(["c", "d"])]);
    }

    #[test]
    fn without_a_circle_there_is_none() {
        // Two ways to the same module, and a module that imports itself.
        let graph = read(&[
            ("a.rs", "use crate::{a::X, b, c};"),
            ("b.rs", "use crate::d;"),
            ("c.rs", "use crate::d;"),
            ("d.rs", ""),
        ])
        .unwrap();
        assert_eq!((graph.modules.len(), graph.imports.len()), (4, 4));
        assert!(graph.circles().is_empty());
    }

    #[test]
    fn groups_of_an_import_are_taken_apart() {
        assert_eq!(imports_of("use crate::{\n    b,\n    c::{self, x::{y, z}},\n};"), ["b:2", "c:3"]);
        assert_eq!(imports_of("pub(crate) use crate::c::x as y;"), ["c:1"]);
        assert_eq!(imports_of("use crate::d::*;"), ["d:1"]);
    }

    #[test]
    fn paths_in_code_are_imports() {
        assert_eq!(
            imports_of("fn f(x: &crate::b::X) -> u8 {\n    crate::c::g::<crate::d::T>(x)\n}"),
            ["b:1", "c:2", "d:2"]
        );
        assert_eq!(imports_of("impl crate::b::T for X {\n    const N: u8 = crate::c::N;\n}"), ["b:1", "c:2"]);
    }

    #[test]
    fn paths_in_macros_are_imports() {
        assert_eq!(imports_of("fn f() {\n    assert!(x == [crate::b::N,\n    crate::c::<T>()]);\n}"), ["b:2", "c:3"]);
        assert_eq!(imports_of("macro_rules! m { () => { $crate::d::x!() } }"), ["d:1"]);
        assert_eq!(imports_of("crate::b::structure!(X { y });"), ["b:1"]);
        assert!(read(&[("a.rs", "m!(use crate::{b, c};);"), ("b.rs", ""), ("c.rs", "")]).is_err());
    }

    #[test]
    fn names_that_lib_rs_exports_are_those_of_their_modules() {
        assert_eq!(imports_of("use crate::{Bolt, glam::DVec3};\nfn f() -> crate::Mug {}"), ["b:1", "c:2"]);
        let unknown = read(&[("lib.rs", "pub use b::Bolt;"), ("a.rs", "\nuse crate::Bult;"), ("b.rs", "")]);
        assert!(unknown.err().unwrap().contains("a.rs:2: lib.rs has no module and no name `Bult`"));
        assert!(read(&[("a.rs", "use crate::*;"), ("b.rs", "")]).is_err());
    }

    #[test]
    fn super_that_leads_to_the_root_counts_and_no_other() {
        assert_eq!(imports_of("use super::b;\nmod inner { use super::c; use super::super::d; }"), ["b:1", "d:2"]);
        assert_eq!(imports_of("pub(super) fn f() { m!(super::c::x()) }"), ["c:1"]);
        let files = [("a/mod.rs", "use super::b;"), ("a/x.rs", "use super::c;\nuse super::super::d;")];
        let graph = read(&[&files[..], &[("b.rs", ""), ("c.rs", ""), ("d.rs", "")]].concat()).unwrap();
        assert_eq!(graph.imports.keys().map(|(_, to)| to.as_str()).collect::<Vec<_>>(), ["b", "d"]);
    }

    #[test]
    fn tests_comments_and_strings_do_not_count() {
        let tests = "#[cfg(test)]\nmod tests {\n    use crate::b;\n    fn f() { crate::c::f(); }\n}\n";
        assert!(imports_of(tests).is_empty());
        assert!(imports_of(&tests.replace("mod tests", "pub(crate) mod tests")).is_empty());
        assert_eq!(imports_of(&tests.replace("(test)", "(not(test))")), ["b:3", "c:4"]);
        assert!(imports_of("#[cfg(test)]\nmod tests;\n#[cfg(test)]\nuse crate::b;").is_empty());
        assert!(imports_of("struct X;\nimpl X {\n    #[cfg(test)]\n    fn f() { crate::b::f(); }\n}").is_empty());
        let words = "//! [`crate::b`]\n\n/// [`crate::b::X`] crate::c\n// use crate::d;\nfn f() { m!(\"crate::b\"); }";
        assert!(imports_of(words).is_empty());
        let files = [("a/tests.rs", "use crate::b;"), ("a/tests/x.rs", "use crate::b;"), ("a.rs", ""), ("b.rs", "")];
        assert!(read(&files).unwrap().imports.is_empty());
    }

    #[test]
    fn the_engine_is_read() {
        let graph = engine().unwrap();
        let import = |from: &str, to: &str| graph.imports.contains_key(&(from.to_string(), to.to_string()));
        assert!(graph.modules.len() > 20 && import("world", "state") && import("model", "math"));
        assert!(!graph.modules.contains("lib") && !graph.modules.contains("tests"));
    }
}
