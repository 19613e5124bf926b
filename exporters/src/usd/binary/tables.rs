//! The tables of a binary file that is being written; equal entries are stored once.

use super::{END_OF_SET, Rep, codec};
use std::collections::HashMap;

/// A path with its children.
struct PathEntry {
    /// Token of its last element.
    token: u32,
    is_property: bool,
    children: Vec<u32>,
}

/// The tables, with indices for finding equal entries.
#[derive(Default)]
pub(super) struct Tables {
    tokens: Vec<String>,
    token_by_text: HashMap<String, u32>,
    strings: Vec<u32>,
    string_by_token: HashMap<u32, u32>,
    fields: Vec<(u32, Rep)>,
    field_by_content: HashMap<(u32, Rep), u32>,
    field_sets: Vec<u32>,
    set_by_fields: HashMap<Vec<u32>, u32>,
    paths: Vec<PathEntry>,
    path_by_element: HashMap<(u32, u32, bool), u32>,
    /// Path, set of fields, kind.
    specs: Vec<[u32; 3]>,
}

impl Tables {
    /// Tables with the root path, which has index 0.
    pub(super) fn new() -> Self {
        let mut tables = Self::default();
        // Negative tokens mark properties, so that none may have token 0.
        tables.token(";-)");
        let token = tables.token("/");
        tables.paths.push(PathEntry { token, is_property: false, children: Vec::new() });
        tables
    }

    pub(super) fn token(&mut self, text: &str) -> u32 {
        if let Some(&token) = self.token_by_text.get(text) {
            return token;
        }
        let token = self.tokens.len() as u32;
        self.tokens.push(text.to_owned());
        self.token_by_text.insert(text.to_owned(), token);
        token
    }

    pub(super) fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        *self.string_by_token.entry(token).or_insert_with(|| {
            self.strings.push(token);
            self.strings.len() as u32 - 1
        })
    }

    pub(super) fn field(&mut self, name: &str, rep: Rep) -> u32 {
        let token = self.token(name);
        *self.field_by_content.entry((token, rep)).or_insert_with(|| {
            self.fields.push((token, rep));
            self.fields.len() as u32 - 1
        })
    }

    /// The path with a parent and a last element (`Name`, `{set=variant}`).
    pub(super) fn path(&mut self, parent: u32, element: &str, is_property: bool) -> u32 {
        let token = self.token(element);
        let next = self.paths.len() as u32;
        let path = *self.path_by_element.entry((parent, token, is_property)).or_insert(next);
        if path == next {
            self.paths.push(PathEntry { token, is_property, children: Vec::new() });
            self.paths[parent as usize].children.push(path);
        }
        path
    }

    /// The path with a text that has no variants: `/Scene/Prim.property`.
    pub(super) fn path_by_text(&mut self, text: &str) -> u32 {
        let (prims, property) = match text.split_once('.') {
            Some((prims, property)) => (prims, Some(property)),
            None => (text, None),
        };
        let mut path = 0;
        for element in prims.split('/').filter(|e| !e.is_empty()) {
            path = self.path(path, element, false);
        }
        property.map_or(path, |name| self.path(path, name, true))
    }

    pub(super) fn spec(&mut self, path: u32, fields: Vec<u32>, kind: u32) {
        let sets = &mut self.field_sets;
        let set = *self.set_by_fields.entry(fields).or_insert_with_key(|fields| {
            let first = sets.len() as u32;
            sets.extend(fields);
            sets.push(END_OF_SET);
            first
        });
        self.specs.push([path, set, kind]);
    }

    /// Encodes the tables, in the order of [`super::SECTIONS`].
    pub(super) fn sections(&self) -> [Vec<u8>; 6] {
        [
            self.token_section(),
            with_count(
                &self.strings.iter().flat_map(|s| s.to_le_bytes()).collect::<Vec<_>>(),
                self.strings.len(),
            ),
            self.field_section(),
            {
                let mut out = (self.field_sets.len() as u64).to_le_bytes().to_vec();
                push_ints(&mut out, &self.field_sets);
                out
            },
            self.path_section(),
            {
                let mut out = (self.specs.len() as u64).to_le_bytes().to_vec();
                for column in 0..3 {
                    push_ints(&mut out, &self.specs.iter().map(|s| s[column]).collect::<Vec<_>>());
                }
                out
            },
        ]
    }

    fn token_section(&self) -> Vec<u8> {
        let mut text = Vec::new();
        for token in &self.tokens {
            text.extend_from_slice(token.as_bytes());
            text.push(0);
        }
        let block = codec::compress(&text);
        let mut out = Vec::new();
        for number in [self.tokens.len(), text.len(), block.len()] {
            out.extend((number as u64).to_le_bytes());
        }
        out.extend(block);
        out
    }

    fn field_section(&self) -> Vec<u8> {
        let mut out = (self.fields.len() as u64).to_le_bytes().to_vec();
        push_ints(&mut out, &self.fields.iter().map(|f| f.0).collect::<Vec<_>>());
        let reps: Vec<u8> = self.fields.iter().flat_map(|f| f.1.0.to_le_bytes()).collect();
        push_block(&mut out, &codec::compress(&reps));
        out
    }

    /// Paths, parents before children: index, token of the last element (negative for properties), and where the sibling is.
    fn path_section(&self) -> Vec<u8> {
        let mut walk = PathWalk::default();
        walk.visit(self, 0, false);
        let mut out = Vec::new();
        for _ in 0..2 {
            out.extend((self.paths.len() as u64).to_le_bytes());
        }
        push_ints(&mut out, &walk.paths);
        for column in [&walk.tokens, &walk.jumps] {
            push_block(&mut out, &codec::compress_ints(column));
        }
        out
    }
}

/// The columns of the table of paths.
#[derive(Default)]
struct PathWalk {
    paths: Vec<u32>,
    tokens: Vec<i32>,
    jumps: Vec<i32>,
}

impl PathWalk {
    fn visit(&mut self, tables: &Tables, path: u32, has_sibling: bool) {
        let node = &tables.paths[path as usize];
        let place = self.paths.len();
        self.paths.push(path);
        self.tokens.push(if node.is_property { -(node.token as i32) } else { node.token as i32 });
        self.jumps.push(0);
        for (i, &child) in node.children.iter().enumerate() {
            self.visit(tables, child, i + 1 < node.children.len());
        }
        self.jumps[place] = match (node.children.is_empty(), has_sibling) {
            (false, true) => (self.paths.len() - place) as i32,
            (true, true) => 0,
            (false, false) => -1,
            (true, false) => -2,
        };
    }
}

fn with_count(bytes: &[u8], count: usize) -> Vec<u8> {
    let mut out = (count as u64).to_le_bytes().to_vec();
    out.extend_from_slice(bytes);
    out
}

fn push_block(out: &mut Vec<u8>, block: &[u8]) {
    out.extend((block.len() as u64).to_le_bytes());
    out.extend_from_slice(block);
}

fn push_ints(out: &mut Vec<u8>, values: &[u32]) {
    let values: Vec<i32> = values.iter().map(|&v| v as i32).collect();
    push_block(out, &codec::compress_ints(&values));
}
