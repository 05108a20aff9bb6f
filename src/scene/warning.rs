//! Warnings, gathered so that a thousand alike make one sentence.

use std::fmt::Display;

/// So many things are named in one warning; the others are counted.
const NAMED: usize = 4;

/// Collects warnings by their text, in the order in which each text first came up.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    groups: Vec<Group>,
}

#[derive(Debug)]
struct Group {
    text: String,
    subjects: Vec<String>,
    more: usize,
}

impl Warnings {
    /// Notes that `text` holds for `subject`.
    pub(crate) fn about(&mut self, subject: impl Display, text: impl Into<String>) {
        let text = text.into();
        let group = match self.groups.iter_mut().position(|group| group.text == text) {
            Some(index) => self.groups.get_mut(index),
            None => {
                self.groups.push(Group { text, subjects: Vec::new(), more: 0 });
                self.groups.last_mut()
            }
        };
        if let Some(group) = group {
            if group.subjects.len() < NAMED {
                group.subjects.push(subject.to_string());
            } else {
                group.more += 1;
            }
        }
    }

    /// Notes something that concerns the whole document.
    pub(super) fn general(&mut self, text: impl Into<String>) {
        self.groups.push(Group { text: text.into(), subjects: Vec::new(), more: 0 });
    }

    /// One sentence for each text.
    pub(crate) fn into_sentences(self) -> Vec<String> {
        self.groups.into_iter().map(Group::into_sentence).collect()
    }
}

impl Group {
    fn into_sentence(self) -> String {
        if self.subjects.is_empty() {
            return self.text;
        }
        let named = self.subjects.join("; ");
        match self.more {
            0 => format!("{named}: {}", self.text),
            more => format!("{named} and {more} more: {}", self.text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_alike_make_one_sentence() {
        let mut warnings = Warnings::default();
        for index in 0..1000 {
            warnings.about(format_args!("node {index}"), "is odd");
        }
        warnings.general("no light");
        let sentences = warnings.into_sentences();
        assert_eq!(sentences, ["node 0; node 1; node 2; node 3 and 996 more: is odd", "no light"]);
    }
}
