//! The modules of a source tree: what each file defines, imports and names.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// A module's place: the names from the root of the crate on.
pub(crate) type ModulePath = Vec<String>;

/// One file, with what it names.
#[derive(Debug)]
pub(crate) struct File {
    /// Relative to the folder of the sources, with `/`.
    pub(crate) path: String,
    /// Module of the file.
    pub(crate) module: ModulePath,
    /// True if only tests compile it.
    pub(crate) test: bool,
    /// Every path in it.
    pub(crate) names: Vec<Name>,
    /// Every string literal outside documentation, and its line.
    pub(crate) literals: Vec<(usize, String)>,
}

/// A path in the code.
#[derive(Clone, Debug)]
pub(crate) struct Name {
    /// The module, inline ones included, that it stands in.
    pub(crate) module: ModulePath,
    /// Segments of the path.
    pub(crate) segments: Vec<String>,
    pub(crate) line: usize,
    pub(crate) kind: Kind,
    /// True if only tests compile it.
    pub(crate) test: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A private `use` of one name.
    Import,
    /// A `pub use`, whatever its visibility, of one name.
    Reexport,
    /// A `use` of everything in a module.
    Glob,
    /// An expression, a type, a pattern, an attribute or a macro's argument.
    Code,
}

/// The target of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    Module(ModulePath),
    Item(ModulePath, String),
}

/// The names that a module brings into scope.
#[derive(Debug, Default)]
struct Scope {
    file: usize,
    defined: BTreeSet<String>,
    /// Names and the paths that they stand for.
    imported: Vec<(String, Vec<String>)>,
    globs: Vec<Vec<String>>,
}

/// A source tree.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    pub(crate) files: Vec<File>,
    scopes: BTreeMap<ModulePath, Scope>,
}

/// The module of the file at `path`.
fn module_of(path: &str) -> ModulePath {
    let mut parts: ModulePath = path.trim_end_matches(".rs").split('/').map(String::from).collect();
    if parts.last().is_some_and(|last| last == "mod") || parts == ["lib"] {
        parts.pop();
    }
    parts
}

impl Tree {
    /// The tree of these files: paths relative to the folder of the sources, and texts.
    ///
    /// # Panics
    ///
    /// If a file is not Rust.
    pub(crate) fn new<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut tree = Self::default();
        tree.scopes.entry(ModulePath::new()).or_default();
        let mut test_modules = BTreeSet::new();
        for (path, source) in files {
            let syntax = syn::parse_file(source).unwrap_or_else(|e| panic!("{path}:{}: {e}", line(e.span())));
            let module = module_of(path);
            let index = tree.files.len();
            let file = File { path: path.into(), module: module.clone(), test: false, names: vec![], literals: vec![] };
            tree.files.push(file);
            tree.scopes.entry(module.clone()).or_default().file = index;
            let mut reader = Reader { tree: &mut tree, index, module, test: false, depth: 0, tests: &mut test_modules };
            reader.visit_file(&syntax);
        }
        for file in &mut tree.files {
            file.test = (1..=file.module.len()).any(|n| test_modules.contains(&file.module[..n]));
        }
        tree
    }

    /// The file that holds the module.
    pub(crate) fn file_of(&self, module: &[String]) -> usize {
        self.scopes[module].file
    }

    /// The target of a path; `None` for other crates, variables, and names that syntax alone does not resolve.
    pub(crate) fn resolve(&self, module: &[String], segments: &[String]) -> Option<Target> {
        self.resolve_unless(module, segments, &mut Vec::new())
    }

    /// The target of a path like [`Tree::resolve`], but for names that are being looked up already.
    fn resolve_unless(
        &self,
        module: &[String],
        segments: &[String],
        pending: &mut Vec<(ModulePath, String)>,
    ) -> Option<Target> {
        let mut at = module.to_vec();
        let mut rest = segments;
        match rest.first()?.as_str() {
            "crate" => {
                at.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            _ => {}
        }
        while rest.first().is_some_and(|first| first == "super") {
            at.pop()?;
            rest = &rest[1..];
        }
        for (n, name) in rest.iter().enumerate() {
            match self.look_up(&at, name, n + 1 == rest.len(), pending)? {
                Target::Module(inner) => at = inner,
                item => return Some(item),
            }
        }
        Some(Target::Module(at))
    }

    /// The target of a name in a module; items are preferred to modules at the end of a path.
    fn look_up(
        &self,
        module: &[String],
        name: &str,
        last: bool,
        pending: &mut Vec<(ModulePath, String)>,
    ) -> Option<Target> {
        let key = (module.to_vec(), name.to_owned());
        if pending.contains(&key) {
            return None;
        }
        let scope = self.scopes.get(module)?;
        let child = [module, &[name.to_owned()]].concat();
        let child = self.scopes.contains_key(&child).then_some(Target::Module(child));
        let item = scope.defined.contains(name).then(|| Target::Item(module.to_vec(), name.into()));
        let here = if last { item.or(child) } else { child.or(item) };
        if here.is_some() {
            return here;
        }
        pending.push(key);
        let named = scope.imported.iter().filter(|(alias, _)| alias == name);
        let mut found: Vec<Target> = named.filter_map(|(_, path)| self.resolve_unless(module, path, pending)).collect();
        if found.is_empty() {
            let globs = scope.globs.iter().filter_map(|path| match self.resolve_unless(module, path, pending)? {
                Target::Module(from) => Some(from),
                Target::Item(..) => None,
            });
            let globs: Vec<ModulePath> = globs.collect();
            found = globs.iter().filter_map(|from| self.look_up(from, name, last, pending)).collect();
        }
        pending.pop();
        let preferred = found.iter().find(|target| matches!(target, Target::Item(..)) == last);
        preferred.or(found.first()).cloned()
    }
}

/// Reads one file into a tree.
struct Reader<'a> {
    tree: &'a mut Tree,
    index: usize,
    module: ModulePath,
    test: bool,
    /// Number of blocks around this place. Items in blocks are not items of the module.
    depth: usize,
    tests: &'a mut BTreeSet<ModulePath>,
}

impl Reader<'_> {
    fn scope(&mut self) -> &mut Scope {
        let index = self.index;
        self.tree.scopes.entry(self.module.clone()).or_insert_with(|| Scope { file: index, ..Scope::default() })
    }

    fn define(&mut self, name: &syn::Ident) {
        if self.depth == 0 {
            self.scope().defined.insert(plain(name));
        }
    }

    fn name(&mut self, segments: Vec<String>, span: Span, kind: Kind) {
        let (module, test) = (self.module.clone(), self.test);
        self.tree.files[self.index].names.push(Name { module, segments, line: line(span), kind, test });
    }

    /// Visits the nodes that `#[cfg(test)]` may be written at.
    fn under(&mut self, attributes: &[syn::Attribute], visit: impl FnOnce(&mut Self)) {
        let outer = self.test;
        self.test |= attributes.iter().any(is_test);
        visit(self);
        self.test = outer;
    }

    /// Every name that a `use` brings in.
    fn import(&mut self, tree: &syn::UseTree, prefix: &[String], kind: Kind) {
        let with = |name: &syn::Ident| [prefix, &[plain(name)]].concat();
        match tree {
            syn::UseTree::Path(path) => self.import(&path.tree, &with(&path.ident), kind),
            syn::UseTree::Name(name) if name.ident == "self" => {
                self.bring(prefix.last().cloned().unwrap_or_default(), prefix.to_vec(), name.span(), kind);
            }
            syn::UseTree::Name(name) => self.bring(plain(&name.ident), with(&name.ident), name.span(), kind),
            syn::UseTree::Rename(rename) => {
                let path = if rename.ident == "self" { prefix.to_vec() } else { with(&rename.ident) };
                self.bring(plain(&rename.rename), path, rename.span(), kind);
            }
            syn::UseTree::Glob(glob) => {
                self.scope().globs.push(prefix.to_vec());
                self.name(prefix.to_vec(), glob.span(), Kind::Glob);
            }
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(tree, prefix, kind)),
        }
    }

    fn bring(&mut self, alias: String, path: Vec<String>, span: Span, kind: Kind) {
        self.scope().imported.push((alias, path.clone()));
        self.name(path, span, kind);
    }

    /// Paths and literals of a macro's tokens, which have no further syntax.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut start = Span::call_site();
        // Colons since the last name, and whether that follows a dot.
        let (mut colons, mut member) = (0, false);
        for token in tokens {
            match &token {
                TokenTree::Ident(ident) => {
                    if colons != 2 || path.is_empty() {
                        self.path_in_tokens(&mut path, start, member);
                        start = ident.span();
                        member = colons == usize::MAX;
                    }
                    path.push(plain(ident));
                    colons = 0;
                    continue;
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' && colons < 2 => {
                    colons += 1;
                    continue;
                }
                TokenTree::Punct(punct) if punct.as_char() == '.' => colons = usize::MAX,
                TokenTree::Group(group) => {
                    self.tokens(group.stream());
                    colons = 0;
                }
                TokenTree::Literal(literal) => {
                    if let Ok(syn::Lit::Str(text)) = syn::parse_str(&literal.to_string()) {
                        self.tree.files[self.index].literals.push((line(literal.span()), text.value()));
                    }
                    colons = 0;
                }
                TokenTree::Punct(_) => colons = 0,
            }
            self.path_in_tokens(&mut path, start, member);
        }
        self.path_in_tokens(&mut path, start, member);
    }

    fn path_in_tokens(&mut self, path: &mut Vec<String>, start: Span, member: bool) {
        let path = std::mem::take(path);
        if !path.is_empty() && !member {
            self.name(path, start, Kind::Code);
        }
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        use syn::Item;
        let (attributes, name): (&[syn::Attribute], Option<&syn::Ident>) = match item {
            Item::Const(i) => (&i.attrs, Some(&i.ident)),
            Item::Enum(i) => (&i.attrs, Some(&i.ident)),
            Item::Fn(i) => (&i.attrs, Some(&i.sig.ident)),
            Item::Impl(i) => (&i.attrs, None),
            Item::Macro(i) => (&i.attrs, i.ident.as_ref()),
            Item::Mod(i) => (&i.attrs, None),
            Item::Static(i) => (&i.attrs, Some(&i.ident)),
            Item::Struct(i) => (&i.attrs, Some(&i.ident)),
            Item::Trait(i) => (&i.attrs, Some(&i.ident)),
            Item::Type(i) => (&i.attrs, Some(&i.ident)),
            Item::Union(i) => (&i.attrs, Some(&i.ident)),
            Item::Use(i) => (&i.attrs, None),
            _ => (&[], None),
        };
        if let Some(name) = name {
            self.define(name);
        }
        self.under(attributes, |reader| visit::visit_item(reader, item));
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.module.push(plain(&item.ident));
        if item.content.is_some() {
            let _ = self.scope();
        } else if self.test {
            self.tests.insert(self.module.clone());
        }
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if item.leading_colon.is_none() {
            let private = matches!(item.vis, syn::Visibility::Inherited);
            self.import(&item.tree, &[], if private { Kind::Import } else { Kind::Reexport });
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.under(&item.attrs, |reader| visit::visit_impl_item_fn(reader, item));
    }

    fn visit_block(&mut self, block: &'ast syn::Block) {
        self.depth += 1;
        visit::visit_block(self, block);
        self.depth -= 1;
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let segments = path.segments.iter().map(|segment| plain(&segment.ident)).collect();
            self.name(segments, path.span(), Kind::Code);
        }
        visit::visit_path(self, path);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_attribute(&mut self, attribute: &'ast syn::Attribute) {
        if !attribute.path().is_ident("doc") {
            if let syn::Meta::List(list) = &attribute.meta {
                self.tokens(list.tokens.clone());
            }
            visit::visit_attribute(self, attribute);
        }
    }

    fn visit_macro(&mut self, invocation: &'ast syn::Macro) {
        self.visit_path(&invocation.path);
        self.tokens(invocation.tokens.clone());
    }

    fn visit_lit_str(&mut self, literal: &'ast syn::LitStr) {
        self.tree.files[self.index].literals.push((line(literal.span()), literal.value()));
    }
}

/// True if the attribute restricts its item to tests.
fn is_test(attribute: &syn::Attribute) -> bool {
    attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
}

/// A name without `r#`.
fn plain(name: &syn::Ident) -> String {
    let name = name.to_string();
    name.strip_prefix("r#").map_or(name.clone(), str::to_owned)
}

fn line(span: Span) -> usize {
    span.start().line
}
