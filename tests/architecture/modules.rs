//! Modules of a crate use one another one way: no circles between siblings, at any depth.
//!
//! Reads the sources with `syn`: paths that begin with `crate`, `super`, `self` or a child's name, in
//! `use` as elsewhere. A name that a module re-exports counts as use of where it comes from. A module
//! and what lies within it are one thing: a parent uses its children, and they may use what stands in
//! their parent. Code for tests alone does not count.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use syn::visit::Visit;

type ModulePath = Vec<String>;

/// A crate's modules: what each one imports by name, and the paths that it mentions.
#[derive(Default)]
struct Modules {
    /// Name to path as written, by module.
    imports: BTreeMap<ModulePath, BTreeMap<String, Vec<String>>>,
    /// Paths as written, by module.
    mentions: BTreeMap<ModulePath, BTreeSet<Vec<String>>>,
    /// Modules in files of their own that are for tests alone.
    for_tests: BTreeSet<ModulePath>,
}

struct Reader<'a> {
    module: ModulePath,
    modules: &'a mut Modules,
}

fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute
                    .parse_args::<syn::Ident>()
                    .is_ok_and(|name| name == "test")
    })
}

/// Stem of the file that `#[path = "..."]` names.
fn file_of(item: &syn::ItemMod) -> Option<String> {
    let named = item
        .attrs
        .iter()
        .find_map(|attribute| match &attribute.meta {
            syn::Meta::NameValue(meta) if meta.path.is_ident("path") => Some(&meta.value),
            _ => None,
        })?;
    let syn::Expr::Lit(syn::ExprLit {
        lit: syn::Lit::Str(file),
        ..
    }) = named
    else {
        return None;
    };
    let stem = Path::new(&file.value()).file_stem()?.to_str()?.to_owned();
    Some(stem)
}

impl Reader<'_> {
    fn mention(&mut self, path: Vec<String>) {
        let mentions = self.modules.mentions.entry(self.module.clone());
        mentions.or_default().insert(path);
    }

    fn import(&mut self, tree: &syn::UseTree, mut path: Vec<String>) {
        match tree {
            syn::UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.import(&part.tree, path);
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(tree, path.clone());
                }
            }
            syn::UseTree::Glob(_) => self.mention(path),
            syn::UseTree::Name(name) => {
                let name = name.ident.to_string();
                let known_as = if name == "self" {
                    path.last().cloned().unwrap_or_default()
                } else {
                    path.push(name.clone());
                    name
                };
                self.imported(known_as, path);
            }
            syn::UseTree::Rename(rename) => {
                if rename.ident != "self" {
                    path.push(rename.ident.to_string());
                }
                self.imported(rename.rename.to_string(), path);
            }
        }
    }

    fn imported(&mut self, known_as: String, path: Vec<String>) {
        let imports = self.modules.imports.entry(self.module.clone()).or_default();
        imports.insert(known_as, path.clone());
        self.mention(path);
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let attributes = match item {
            syn::Item::Fn(item) => &item.attrs,
            syn::Item::Impl(item) => &item.attrs,
            syn::Item::Mod(item) => &item.attrs,
            syn::Item::Struct(item) => &item.attrs,
            syn::Item::Use(item) => &item.attrs,
            _ => &Vec::new(),
        };
        if !is_for_tests(attributes) {
            syn::visit::visit_item(self, item);
        } else if let syn::Item::Mod(item) = item {
            let mut path = self.module.clone();
            path.push(file_of(item).unwrap_or_else(|| item.ident.to_string()));
            self.modules.for_tests.insert(path);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&item.tree, Vec::new());
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments = path.segments.iter();
        self.mention(segments.map(|segment| segment.ident.to_string()).collect());
        syn::visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, makro: &'ast syn::Macro) {
        // What stands in `format!("{}", crate::x())` is tokens only: arguments that are expressions.
        let arguments = makro.parse_body_with(
            syn::punctuated::Punctuated::<syn::Expr, syn::Token![,]>::parse_terminated,
        );
        for argument in arguments.iter().flatten() {
            self.visit_expr(argument);
        }
        syn::visit::visit_macro(self, makro);
    }
}

impl Modules {
    fn read(&mut self, folder: &Path, module: &ModulePath) {
        let mut entries: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        entries.sort();
        for path in entries {
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let mut inner = module.clone();
            if path.is_dir() {
                inner.push(stem);
                self.read(&path, &inner);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                if !["lib", "main", "mod"].contains(&stem.as_str()) {
                    inner.push(stem);
                }
                let file = syn::parse_file(&std::fs::read_to_string(&path).unwrap()).unwrap();
                self.add(inner, &file);
            }
        }
    }

    fn add(&mut self, module: ModulePath, file: &syn::File) {
        self.mentions.entry(module.clone()).or_default();
        let mut reader = Reader {
            module,
            modules: self,
        };
        reader.visit_file(file);
    }

    fn has(&self, module: &ModulePath) -> bool {
        self.mentions.contains_key(module)
    }

    /// The module that a path leads to, as written in a module; none if it leads out of the crate.
    fn target(&self, from: &ModulePath, path: &[String], depth: usize) -> Option<ModulePath> {
        if depth == 0 {
            return None;
        }
        let mut at = from.clone();
        let mut segments = path.iter().peekable();
        let mut anchored = false;
        while let Some(segment) = segments.peek() {
            match segment.as_str() {
                "crate" => at.clear(),
                "super" => drop(at.pop()),
                "self" => {}
                _ => break,
            }
            anchored = true;
            segments.next();
        }
        for segment in segments {
            let mut child = at.clone();
            child.push(segment.clone());
            if self.has(&child) {
                at = child;
            } else {
                let imports = self.imports.get(&at);
                let Some(import) = imports.and_then(|imports| imports.get(segment)) else {
                    break;
                };
                // A name of the module itself, not the path under which it is imported here.
                if *import == *path && at == *from {
                    break;
                }
                at = self.target(&at, import, depth - 1)?;
            }
            anchored = true;
        }
        anchored.then_some(at)
    }

    /// Uses between siblings, by the path of their parent, each with one place that shows it.
    fn edges(&self) -> BTreeMap<ModulePath, BTreeMap<(String, String), String>> {
        let mut edges: BTreeMap<ModulePath, BTreeMap<(String, String), String>> = BTreeMap::new();
        let counts = |module: &ModulePath| {
            let mut outer = (0..=module.len()).map(|length| &module[..length]);
            outer.all(|outer| !self.for_tests.contains(outer))
        };
        for (from, mentions) in self.mentions.iter().filter(|(from, _)| counts(from)) {
            for path in mentions {
                let Some(to) = self.target(from, path, 8) else {
                    continue;
                };
                let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
                if let (Some(a), Some(b)) = (from.get(common), to.get(common)) {
                    edges
                        .entry(from[..common].to_vec())
                        .or_default()
                        .entry((a.clone(), b.clone()))
                        .or_insert_with(|| format!("{} uses {}", from.join("::"), path.join("::")));
                }
            }
        }
        edges
    }
}

/// The shortest circle through each module that is on one.
fn circles(edges: &BTreeMap<(String, String), String>) -> BTreeSet<Vec<String>> {
    let uses = |node: &str| {
        let node = node.to_owned();
        edges
            .keys()
            .filter(move |(a, _)| *a == node)
            .map(|(_, b)| b.clone())
    };
    let starts: BTreeSet<&String> = edges.keys().map(|(a, _)| a).collect();
    let shortest = starts.into_iter().filter_map(|start| {
        let mut before: BTreeMap<String, String> = BTreeMap::new();
        let mut queue = VecDeque::from([start.clone()]);
        while let Some(node) = queue.pop_front() {
            for next in uses(&node) {
                if next == *start {
                    let mut way = vec![node.clone()];
                    let mut at = node;
                    while let Some(previous) = before.get(&at) {
                        way.push(previous.clone());
                        at.clone_from(previous);
                    }
                    way.reverse();
                    return Some(way);
                }
                if !before.contains_key(&next) {
                    before.insert(next.clone(), node.clone());
                    queue.push_back(next);
                }
            }
        }
        None
    });
    // The same circle once, from its first module.
    let turned = shortest.map(|mut way| {
        let first = (0..way.len()).min_by_key(|&index| &way[index]).unwrap_or(0);
        way.rotate_left(first);
        way
    });
    turned.collect()
}

#[test]
fn modules_of_a_crate_use_one_another_one_way() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
    let mut found = Vec::new();
    let mut folders: Vec<_> = std::fs::read_dir(&crates)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    folders.sort();
    for folder in folders {
        let mut modules = Modules::default();
        modules.read(&folder.join("src"), &Vec::new());
        let name = folder.file_name().unwrap().to_str().unwrap();
        for (parent, edges) in modules.edges() {
            for way in circles(&edges) {
                let next = way.iter().cycle().skip(1);
                let places = way.iter().zip(next).map(|(a, b)| {
                    let edge = (a.clone(), b.clone());
                    format!("    {}\n", edges[&edge])
                });
                found.push(format!(
                    "{}: {}\n{}",
                    [&[name.to_owned()], &parent[..]].concat().join("::"),
                    way.join(" <-> "),
                    places.collect::<String>()
                ));
            }
        }
    }
    assert!(
        found.is_empty(),
        "circles between modules:\n{}",
        found.join("")
    );
}

#[test]
fn a_circle_is_found() {
    let mut modules = Modules::default();
    for (module, text) in [
        ("a", "use super::b::Thing; pub struct Own;"),
        ("b", "pub use inner::Thing; mod inner;"),
        ("b/inner", "pub struct Thing(crate::Renamed);"),
        ("", "pub use a::Own as Renamed; mod a; mod b;"),
    ] {
        let parts = module.split('/').filter(|part| !part.is_empty());
        let module: ModulePath = parts.map(str::to_owned).collect();
        modules.add(module, &syn::parse_file(text).unwrap());
    }
    let edges = modules.edges();
    let expected = vec!["a".to_owned(), "b".to_owned()];
    assert_eq!(circles(&edges[&Vec::new()]), BTreeSet::from([expected]));
}
