//! Which file takes something from which, read from the imports and paths of a crate with re-exports resolved.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, ItemUse, UseTree, Visibility};

/// A path from the root of a crate, without `crate`.
type Segments = Vec<String>;

/// Arrows between the files of a crate: from a file to those it takes something from.
pub(super) type Arrows = BTreeMap<PathBuf, BTreeSet<PathBuf>>;

/// One module in a file of its own.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Names of the items that are defined here.
    items: BTreeSet<String>,
    /// Every `use`: the name it brings into scope (`*` for all of a module), its path, and whether it is a re-export.
    uses: Vec<(String, Segments, bool)>,
    /// Paths in code that start with `crate`, `self` or `super`, or that have two segments or more.
    paths: Vec<Segments>,
}

/// The modules of a crate by their paths.
pub(super) struct Crate {
    modules: BTreeMap<Segments, Module>,
}

impl Crate {
    /// Reads every file under the folder of a crate's `lib.rs`, its tests left out.
    pub(super) fn read(root: &Path) -> Self {
        let mut modules = BTreeMap::new();
        read_folder(root, root, &mut modules);
        assert!(!modules.is_empty(), "{} has no modules", root.display());
        Self { modules }
    }

    /// The arrows between the files. What a module re-exports draws none.
    pub(super) fn arrows(&self) -> Arrows {
        let mut arrows = Arrows::new();
        for (path, module) in &self.modules {
            let private = module.uses.iter().filter(|(.., is_reexport)| !is_reexport).map(|(_, target, _)| target);
            let targets = private.chain(&module.paths).filter_map(|target| self.file_of(path, target));
            let others = targets.filter(|file| *file != module.file).collect();
            arrows.insert(module.file.clone(), others);
        }
        arrows
    }

    /// The file in which the item stands that a path of a module names; `None` for what is not of this crate.
    fn file_of(&self, module: &Segments, target: &Segments) -> Option<PathBuf> {
        let absolute = self.absolute(module, target)?;
        self.resolve(&absolute, 0)
    }

    /// A path from the root of the crate: `super` and `self` resolved, and a first segment that an import brought in.
    fn absolute(&self, module: &Segments, target: &Segments) -> Option<Segments> {
        let (first, rest) = target.split_first()?;
        let mut base = match first.as_str() {
            "crate" => Segments::new(),
            "self" => module.clone(),
            "super" => module[..module.len().checked_sub(1)?].to_vec(),
            name => {
                let own = &self.modules[module];
                let import = own.uses.iter().find(|(known, path, _)| known == name && path != target);
                let child = [module.as_slice(), &[name.to_owned()]].concat();
                match import {
                    Some((_, path, _)) => self.absolute(module, path)?,
                    None if self.modules.contains_key(&child) => child,
                    None => return None,
                }
            }
        };
        for segment in rest {
            match segment.as_str() {
                "super" => drop(base.pop()),
                _ => base.push(segment.clone()),
            }
        }
        Some(base)
    }

    fn resolve(&self, path: &[String], depth: usize) -> Option<PathBuf> {
        assert!(depth < 32, "re-exports go round: {path:?}");
        let known = (0..=path.len()).rev().find(|end| self.modules.contains_key(&path[..*end]))?;
        let (module, rest) = path.split_at(known);
        let module = module.to_vec();
        let own = &self.modules[&module];
        let Some(name) = rest.first().filter(|name| !own.items.contains(*name)) else { return Some(own.file.clone()) };
        let exported = own.uses.iter().filter(|(known, ..)| known == name || known == "*");
        let mut targets = exported.filter_map(|(known, path, _)| {
            let mut target = self.absolute(&module, path)?;
            target.extend(rest[usize::from(known != "*")..].iter().cloned());
            Some(target)
        });
        targets.find_map(|target| self.resolve(&target, depth + 1)).or_else(|| Some(own.file.clone()))
    }
}

fn read_folder(root: &Path, folder: &Path, modules: &mut BTreeMap<Segments, Module>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            read_folder(root, &path, modules);
        } else if path.extension().is_some_and(|end| end == "rs")
            && !path.ends_with("tests.rs")
            && !path.ends_with("main.rs")
        {
            let file = path.strip_prefix(root).unwrap().to_owned();
            let mut segments: Segments =
                file.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
            segments.pop_if(|last| ["mod", "lib"].contains(&last.as_str()));
            let code = syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap();
            let mut module = Module { file, ..Module::default() };
            module.visit_file(&code);
            modules.insert(segments, module);
        }
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

impl Module {
    fn imports(&mut self, tree: &UseTree, before: &[String], is_reexport: bool) {
        let with = |name: String| [before, &[name]].concat();
        match tree {
            UseTree::Path(path) => self.imports(&path.tree, &with(path.ident.to_string()), is_reexport),
            UseTree::Name(name) if name.ident == "self" => {
                self.uses.push((before.last().unwrap().clone(), before.to_vec(), is_reexport));
            }
            UseTree::Name(name) => {
                self.uses.push((name.ident.to_string(), with(name.ident.to_string()), is_reexport));
            }
            UseTree::Rename(rename) => {
                self.uses.push((rename.rename.to_string(), with(rename.ident.to_string()), is_reexport));
            }
            UseTree::Glob(_) => self.uses.push(("*".into(), before.to_vec(), is_reexport)),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.imports(tree, before, is_reexport)),
        }
    }

    /// Paths in the tokens of a macro: `a::b::c`.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path = Segments::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(ident) if path.is_empty() || colons == 2 => {
                    path.push(ident.to_string());
                    colons = 0;
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                other => {
                    self.paths.extend((path.len() > 1).then(|| std::mem::take(&mut path)));
                    (path, colons) = (Segments::new(), 0);
                    match other {
                        TokenTree::Group(group) => self.tokens(group.stream()),
                        TokenTree::Ident(ident) => path.push(ident.to_string()),
                        _ => {}
                    }
                }
            }
        }
        self.paths.extend((path.len() > 1).then_some(path));
    }
}

impl<'ast> Visit<'ast> for Module {
    fn visit_item(&mut self, item: &'ast Item) {
        let (name, attributes) = match item {
            Item::Const(item) => (Some(&item.ident), &item.attrs),
            Item::Enum(item) => (Some(&item.ident), &item.attrs),
            Item::Fn(item) => (Some(&item.sig.ident), &item.attrs),
            Item::Macro(item) => (item.ident.as_ref(), &item.attrs),
            Item::Static(item) => (Some(&item.ident), &item.attrs),
            Item::Struct(item) => (Some(&item.ident), &item.attrs),
            Item::Trait(item) => (Some(&item.ident), &item.attrs),
            Item::Type(item) => (Some(&item.ident), &item.attrs),
            Item::Impl(item) => (None, &item.attrs),
            Item::Mod(ItemMod { attrs, content: Some(_), ident, .. }) => (Some(ident), attrs),
            Item::Mod(_) => return,
            Item::Use(ItemUse { vis, tree, attrs, .. }) => {
                if !is_test(attrs) {
                    self.imports(tree, &[], !matches!(vis, Visibility::Inherited));
                }
                return;
            }
            _ => return,
        };
        if !is_test(attributes) {
            self.items.extend(name.map(ToString::to_string));
            visit::visit_item(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 && path.leading_colon.is_none() {
            self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, code: &'ast syn::Macro) {
        self.tokens(code.tokens.clone());
        visit::visit_macro(self, code);
    }
}
