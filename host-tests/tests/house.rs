//! The house: arrows between the files of a crate, and between the rooms of the firmware, point one way; comments are
//! as wide as declared.
//!
//! An arrow leads from a file to one that it names by `crate::` or `super::`. A folder's own file and the files in it
//! are one idea told in parts: arrows between them are not counted, nor are those of tests.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syn::buffer::{Cursor, TokenBuffer};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, Macro, Meta, UseTree};

/// Sources of each crate.
const CRATES: [&str; 19] = [
    "src",
    "crates/canopen-node/src",
    "crates/friction-compensation/src",
    "host-tests/src",
    "tools/bus/src",
    "tools/comparison/src",
    "tools/emulator/src",
    "tools/excitation/src",
    "tools/fleet/src",
    "tools/identification/src",
    "tools/jointctl/src",
    "tools/logs/src",
    "tools/node/src",
    "tools/panel/src",
    "tools/plant/src",
    "tools/python/src",
    "tools/report/src",
    "tools/rigid-body/src",
    "tools/robot/src",
];

/// Folders of comments that are held to their width.
const COMMENTED: [&str; 5] = ["src", "crates", "host-tests", "tools", "fuzz"];
/// Columns of a comment, at most: `max_width` of rustfmt.toml.
const WIDTH: usize = 120;

/// Rooms of a crate and the rooms that each may name; the boards' program (`main`, `tasks`, `board`) may name all.
const ROOMS: [(&str, &str, &[&str]); 7] = [
    ("crates/friction-compensation/src", "friction", &["dsp", "quantity", "sine"]),
    ("crates/friction-compensation/src", "compensation", &["friction", "quantity"]),
    ("crates/friction-compensation/src", "parameters", &["dsp", "friction", "quantity"]),
    ("src", "motor", &[]),
    ("src", "sensors", &["motor"]),
    ("src", "joint", &["motor", "sensors"]),
    ("src", "objects", &["hardware", "joint", "motor", "reset_record"]),
];

/// Path of a module within its crate; the crate's root is empty.
type Module = Vec<String>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Rust files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if path.file_name().is_some_and(|name| name != "target") {
                found.extend(files(&path));
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Module that a file is.
fn module(source: &Path, file: &Path) -> Module {
    let relative = file.strip_prefix(source).unwrap().with_extension("");
    let mut module: Module = relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if module.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        module.pop();
    }
    module
}

fn is_test(attributes: &[Attribute]) -> bool {
    let test = |attribute: &Attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Ident>().is_ok_and(|name| name == "test")
    };
    attributes.iter().any(test)
}

/// Names that a file uses, as paths from the crate's root.
struct Names {
    module: Module,
    found: Vec<Module>,
}

impl Names {
    fn take(&mut self, path: &[String]) {
        let Some(first) = path.first() else { return };
        let above = path.iter().take_while(|part| *part == "super").count();
        match first.as_str() {
            "crate" => self.found.push(path[1..].to_vec()),
            "super" if above <= self.module.len() => {
                let base = self.module[..self.module.len() - above].iter();
                self.found.push(base.chain(&path[above..]).cloned().collect());
            }
            _ => {}
        }
    }

    fn take_tokens(&mut self, tokens: TokenBuffer) {
        let mut found = Vec::new();
        paths(tokens.begin(), &mut found);
        found.iter().for_each(|path| self.take(path));
    }

    fn tree(&mut self, tree: &UseTree, before: &mut Module) {
        match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.tree(&path.tree, before);
                before.pop();
            }
            UseTree::Group(group) => group.items.iter().for_each(|item| self.tree(item, before)),
            UseTree::Name(name) => self.take(&[&before[..], &[name.ident.to_string()]].concat()),
            UseTree::Rename(name) => self.take(&[&before[..], &[name.ident.to_string()]].concat()),
            UseTree::Glob(_) => self.take(&before.clone()),
        }
    }
}

/// Paths among the tokens of a macro or an attribute, with those in its brackets.
fn paths(mut at: Cursor, found: &mut Vec<Module>) {
    while !at.eof() {
        if let Some((inner, _, _, rest)) = at.any_group() {
            paths(inner, found);
            at = rest;
        } else if let Some((name, mut rest)) = at.ident() {
            let mut path = vec![name.to_string()];
            while let Some((name, after)) = next_of_path(rest) {
                path.push(name);
                rest = after;
            }
            found.push(path);
            at = rest;
        } else if let Some((_, rest)) = at.token_tree() {
            at = rest;
        }
    }
}

fn colon(at: Cursor) -> Option<Cursor> {
    at.punct().filter(|(punct, _)| punct.as_char() == ':').map(|(_, rest)| rest)
}

/// The name behind `::`.
fn next_of_path(at: Cursor) -> Option<(String, Cursor)> {
    let (name, rest) = colon(colon(at)?)?.ident()?;
    Some((name.to_string(), rest))
}

impl<'ast> Visit<'ast> for Names {
    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let Meta::List(list) = &attribute.meta {
            self.take_tokens(TokenBuffer::new2(list.tokens.clone()));
        }
    }

    fn visit_macro(&mut self, called: &'ast Macro) {
        self.take_tokens(TokenBuffer::new2(called.tokens.clone()));
        visit::visit_macro(self, called);
    }

    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            Item::Mod(module) if is_test(&module.attrs) => {}
            Item::Mod(module) if module.content.is_some() => {
                self.module.push(module.ident.to_string());
                visit::visit_item(self, item);
                self.module.pop();
            }
            Item::Fn(function) if is_test(&function.attrs) => {}
            Item::Impl(block) if is_test(&block.attrs) => {}
            Item::Use(names) if is_test(&names.attrs) => {}
            Item::Use(names) => self.tree(&names.tree, &mut Vec::new()),
            _ => visit::visit_item(self, item),
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.take(&path.segments.iter().map(|segment| segment.ident.to_string()).collect::<Module>());
        visit::visit_path(self, path);
    }
}

/// Modules that each module of a crate names, itself and tests aside.
fn arrows(source: &Path) -> BTreeMap<Module, BTreeSet<Module>> {
    let files = files(source);
    let modules: BTreeSet<Module> = files.iter().map(|file| module(source, file)).collect();
    let mut arrows: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
    for file in &files {
        let from = module(source, file);
        if from.iter().any(|part| part == "tests" || part.ends_with("_tests")) {
            continue;
        }
        let text = fs::read_to_string(file).unwrap();
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let mut names = Names { module: from.clone(), found: Vec::new() };
        names.visit_file(&parsed);
        let of_file = arrows.entry(from.clone()).or_default();
        for name in names.found {
            let longest = (0..=name.len()).rev().map(|length| name[..length].to_vec());
            let to = longest.into_iter().find(|module| modules.contains(module)).unwrap_or_default();
            if to != from {
                of_file.insert(to);
            }
        }
    }
    arrows
}

/// A circle of arrows, if there is one, from a module back to itself.
fn circle(arrows: &BTreeMap<Module, BTreeSet<Module>>) -> Option<Vec<Module>> {
    fn follow(
        at: &Module,
        arrows: &BTreeMap<Module, BTreeSet<Module>>,
        way: &mut Vec<Module>,
        done: &mut BTreeSet<Module>,
    ) -> Option<Vec<Module>> {
        if let Some(begin) = way.iter().position(|module| module == at) {
            return Some([&way[begin..], std::slice::from_ref(at)].concat());
        }
        if !done.insert(at.clone()) {
            return None;
        }
        way.push(at.clone());
        let found = arrows.get(at).into_iter().flatten().find_map(|to| follow(to, arrows, way, done));
        way.pop();
        found
    }
    let mut done = BTreeSet::new();
    arrows.keys().find_map(|from| follow(from, arrows, &mut Vec::new(), &mut done))
}

/// Arrows without those between a folder's own file and the files in it.
fn between_ideas(mut arrows: BTreeMap<Module, BTreeSet<Module>>) -> BTreeMap<Module, BTreeSet<Module>> {
    for (from, to) in &mut arrows {
        to.retain(|to| !from.starts_with(to) && !to.starts_with(from));
    }
    arrows
}

fn told(way: &[Module]) -> String {
    way.iter().map(|module| module.join("::")).collect::<Vec<_>>().join(" -> ")
}

#[test]
fn no_files_of_a_crate_name_each_other_in_a_circle() {
    let mut circles = Vec::new();
    for name in CRATES {
        let arrows = between_ideas(arrows(&root().join(name)));
        assert!(arrows.values().any(|to| !to.is_empty()) || name == "tools/python/src", "{name}: no arrows are found");
        if let Some(circle) = circle(&arrows) {
            circles.push(format!("{name}: {}", told(&circle)));
        }
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn rooms_of_the_firmware_name_only_what_lies_below_them() {
    let mut wrong = Vec::new();
    for (crate_name, room, below) in ROOMS {
        let arrows = arrows(&root().join(crate_name));
        let of_room = arrows.iter().filter(|(from, _)| from.first().is_some_and(|first| first == room));
        let named: BTreeSet<&String> = of_room.flat_map(|(_, to)| to).filter_map(|to| to.first()).collect();
        wrong.extend(
            named
                .iter()
                .filter(|name| **name != room && !below.contains(&name.as_str()))
                .map(|name| format!("{room} names {name}")),
        );
        let unused = below.iter().filter(|name| !named.iter().any(|named| named == *name));
        wrong.extend(unused.map(|name| format!("{room} no longer names {name}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Numbers of the lines whose comment is too wide. Rows of tables, code and drawings are as wide as they have to be.
fn wide(text: &str) -> Vec<usize> {
    let mut code = false;
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let Some(comment) = line.trim_start().strip_prefix("//") else {
            code = false;
            continue;
        };
        let content = comment.trim_start_matches(['/', '!']);
        code ^= content.trim_start().starts_with("```");
        let drawn = code || content.starts_with(" |") || content.starts_with("   ");
        if !drawn && line.chars().count() > WIDTH {
            found.push(number + 1);
        }
    }
    found
}

#[test]
fn no_comment_is_wider_than_declared() {
    let line = |content: &str, width: usize| format!("    //{content}{}\n", "x".repeat(width - 6 - content.len()));
    assert!(wide(&line("! ", WIDTH)).is_empty());
    assert_eq!(wide(&(line(" ", 9) + &line("/ ", WIDTH + 1))), [2]);
    assert!(wide(&line("! | ", WIDTH + 1)).is_empty());
    let mut all = Vec::new();
    for file in COMMENTED.iter().flat_map(|folder| files(&root().join(folder))) {
        let text = fs::read_to_string(&file).unwrap();
        all.extend(wide(&text).into_iter().map(|number| format!("{}:{number}", file.display())));
    }
    assert!(all.is_empty(), "comments wider than {WIDTH} columns:\n{}", all.join("\n"));
}

#[test]
fn a_circle_is_found_and_told() {
    let module = |name: &str| vec![name.to_owned()];
    let with = |pairs: &[(&str, &str)]| {
        let mut arrows: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
        for (from, to) in pairs {
            arrows.entry(module(from)).or_default().insert(module(to));
        }
        circle(&arrows)
    };
    assert_eq!(with(&[("a", "b"), ("b", "c"), ("a", "c")]), None);
    assert_eq!(told(&with(&[("z", "a"), ("a", "b"), ("b", "c"), ("c", "a")]).unwrap()), "a -> b -> c -> a");
    let text = "use crate::{one::Two, three};\nuse super::four::*;\n#[cfg(test)]\nmod tests { use crate::no; }\nfn f() { crate::five::six(); }
        #[error(\"{}\", super::seven::eight(x))] struct S;
        fn g() { let _ = format!(\"{}\", [(crate::nine::ten)]); }";
    let mut names = Names { module: vec!["own".into(), "file".into()], found: Vec::new() };
    names.visit_file(&syn::parse_file(text).unwrap());
    let found: Vec<String> = names.found.iter().map(|name| name.join("::")).collect();
    assert_eq!(found, ["one::Two", "three", "own::four", "five::six", "own::seven::eight", "nine::ten"]);
}
