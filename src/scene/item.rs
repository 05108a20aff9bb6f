//! How messages name a thing in the document: by glTF index, with its name where it has one.

use std::fmt;

/// Longer names are cut: they come from the file and go to a terminal.
const LONGEST_NAME: usize = 48;

/// A thing in the document, displayed as `node 3 ("Lamp")` or `mesh 0 ("Wall"), primitive 2`.
///
/// Boxed, as errors that name two things should stay small.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item(Box<Parts>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct Parts {
    /// The singular of the document's list: `node`, `mesh`, `bufferView` …
    kind: &'static str,
    /// Index into that list.
    index: usize,
    name: Option<String>,
    /// A part that has an index of its own, such as a mesh's primitive.
    part: Option<(&'static str, usize)>,
}

impl Item {
    /// The `index`-th entry of the list of `kind`s.
    pub(super) fn new(kind: &'static str, index: usize, name: Option<&str>) -> Self {
        let name = name.filter(|name| !name.is_empty()).map(str::to_owned);
        Self(Box::new(Parts { kind, index, name, part: None }))
    }

    /// One part of this item.
    pub(super) fn part(mut self, kind: &'static str, index: usize) -> Self {
        self.0.part = Some((kind, index));
        self
    }
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Parts { kind, index, name, part } = &*self.0;
        write!(f, "{kind} {index}")?;
        if let Some(name) = name {
            write!(f, " (\"{}\")", shown(name))?;
        }
        if let Some((kind, index)) = part {
            write!(f, ", {kind} {index}")?;
        }
        Ok(())
    }
}

/// Text from the file, made safe to print: control characters escaped, long text cut.
pub(super) fn shown(text: &str) -> String {
    let mut out: String = text.chars().take(LONGEST_NAME).flat_map(char::escape_debug).collect();
    if text.chars().nth(LONGEST_NAME).is_some() {
        out.push('…');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_and_cut() {
        let name = format!("\u{1b}[31m{}", "x".repeat(500));
        let text = Item::new("mesh", 2, Some(&name)).part("primitive", 1).to_string();
        assert!(
            text.starts_with("mesh 2 (\"\\u{1b}[31mxxx") && text.ends_with("…\"), primitive 1"),
            "{text}"
        );
        assert!(text.len() < 100, "{text}");
    }
}
