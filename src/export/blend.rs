//! Vertices that the source does not have: weighted means of its own.
//!
//! What the corners agree on is kept byte for byte. What they do not is mixed linearly, in the
//! accessor's own type; directions keep their length, and integers that are numbers of something
//! (joints, an application's own) come from the strongest corner, since there is nothing between them.
//! Positions and texture coordinates in integers become floats: a step of theirs would be seen.

use super::accessor::{Component, Elements};

/// A blend as something to compare and sort by.
pub(super) type BlendKey = ([u32; 3], [u64; 3]);

/// A vertex made of up to three vertices of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blend {
    /// Ascending, those without weight last.
    sources: [u32; 3],
    weights: [f64; 3],
}

impl Blend {
    /// A source vertex itself.
    pub(super) fn copy_of(source: u32) -> Self {
        Self { sources: [source, 0, 0], weights: [1.0, 0.0, 0.0] }
    }

    /// Source vertices and their weights, of which the sum is 1.
    pub(super) fn new(sources: [u32; 3], weights: [f64; 3]) -> Self {
        let mut parts: Vec<(u32, f64)> = Vec::with_capacity(3);
        for (source, weight) in sources.into_iter().zip(weights).filter(|part| part.1 > 0.0) {
            match parts.iter_mut().find(|part| part.0 == source) {
                Some(part) => part.1 += weight,
                None => parts.push((source, weight)),
            }
        }
        parts.sort_by_key(|part| part.0);
        match parts[..] {
            [(source, _)] => Self::copy_of(source),
            _ => {
                let part = |i: usize| parts.get(i).copied().unwrap_or((0, 0.0));
                let parts = [part(0), part(1), part(2)];
                Self { sources: parts.map(|part| part.0), weights: parts.map(|part| part.1) }
            }
        }
    }

    /// The source vertex that this one is a copy of, if it is one.
    pub(super) fn original(&self) -> Option<u32> {
        (self.weights[1] == 0.0).then_some(self.sources[0])
    }

    /// Something to compare and sort by.
    pub(super) fn key(&self) -> BlendKey {
        (self.sources, self.weights.map(f64::to_bits))
    }

    /// The vertices and their weights.
    pub(super) fn parts(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.sources.into_iter().zip(self.weights).filter(|part| part.1 > 0.0)
    }

    fn strongest(&self) -> u32 {
        let first = (self.sources[0], self.weights[0]);
        self.parts().fold(first, |best, part| if part.1 > best.1 { part } else { best }).0
    }
}

/// How an attribute is mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Linearly.
    Linear,
    /// Linearly, in floats.
    Float,
    /// Linearly and back to length 1; a fourth component is a sign.
    Direction,
    /// Not at all: the strongest corner's.
    Choice,
}

impl Kind {
    /// The way for the attribute `name` of a primitive or of one of its morph targets.
    pub(super) fn of(name: &str, target: bool) -> Self {
        if name == "POSITION" || name.starts_with("TEXCOORD_") {
            Self::Float
        } else if (name == "NORMAL" || name == "TANGENT") && !target {
            Self::Direction
        } else if ["JOINTS_", "WEIGHTS_", "_FEATURE_ID_"].iter().any(|choice| name.starts_with(choice)) {
            Self::Choice
        } else {
            Self::Linear
        }
    }
}

/// The elements of `blends` made from those of the source.
pub(super) fn blend(elements: &Elements, kind: Kind, blends: &[Blend]) -> Elements {
    let widened = match kind {
        Kind::Float if elements.component != Component::F32 && elements.components > 0 => {
            Some(elements.widened())
        }
        _ => None,
    };
    let elements = widened.as_ref().unwrap_or(elements);
    let counted = elements.component != Component::F32 && !elements.normalized;
    let kind = if counted || elements.components == 0 { Kind::Choice } else { kind };
    let mut bytes = Vec::with_capacity(blends.len() * elements.size);
    for (index, blend) in blends.iter().enumerate() {
        match blend
            .original()
            .or_else(|| (kind == Kind::Choice || agree(elements, blend)).then(|| blend.strongest()))
        {
            Some(source) => bytes.extend_from_slice(elements.element(source).unwrap_or_default()),
            None => mix(elements, kind, blend, &mut bytes),
        }
        bytes.resize((index + 1) * elements.size, 0);
    }
    Elements { bytes, ..*elements }
}

/// Whether the blend's vertices have the same bytes.
fn agree(elements: &Elements, blend: &Blend) -> bool {
    let mut all = blend.parts().map(|part| elements.element(part.0));
    let first = all.next();
    all.all(|element| Some(element) == first)
}

fn mix(elements: &Elements, kind: Kind, blend: &Blend, bytes: &mut Vec<u8>) {
    let mut mean = vec![0.0; elements.components];
    for (source, weight) in blend.parts() {
        for (mean, value) in mean.iter_mut().zip(elements.numbers(source)) {
            *mean += weight * value;
        }
    }
    if kind == Kind::Direction {
        let strongest: Vec<f64> = elements.numbers(blend.strongest()).collect();
        let length = |v: &[f64]| v.iter().take(3).map(|x| x * x).sum::<f64>().sqrt();
        let (now, unit) = (length(&mean), elements.component.fraction_of());
        if now > 1e-6 * unit {
            mean.iter_mut().take(3).for_each(|x| *x *= unit / now);
        } else {
            mean.clone_from(&strongest); // opposite directions have no mean
        }
        if let (Some(sign), Some(&strongest)) = (mean.get_mut(3), strongest.get(3)) {
            *sign = strongest;
        }
    }
    mean.into_iter().for_each(|value| elements.component.write(value, bytes));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elements(component: Component, components: usize, values: &[f64]) -> Elements {
        let mut bytes = Vec::new();
        values.iter().for_each(|&value| component.write(value, &mut bytes));
        let size = components * bytes.len() / values.len();
        Elements { bytes, size, component, components, normalized: component != Component::F32 }
    }

    fn blended(elements: &Elements, kind: Kind, weights: [f64; 3]) -> Vec<f64> {
        blend(elements, kind, &[Blend::new([0, 1, 2], weights)]).numbers(0).collect()
    }

    #[test]
    fn equal_parts_are_one_vertex() {
        assert_eq!(Blend::new([7, 3, 7], [0.25, 0.0, 0.75]), Blend::copy_of(7));
        assert_eq!(Blend::new([7, 3, 5], [0.25, 0.75, 0.0]), Blend::new([3, 5, 7], [0.75, 0.0, 0.25]));
        assert_eq!(Blend::copy_of(0).original(), Some(0));
        assert_eq!(Blend::new([0, 1, 2], [0.5, 0.5, 0.0]).original(), None);
    }

    #[test]
    fn types_are_kept_or_become_floats() {
        let colours = elements(Component::U8, 2, &[0.0, 255.0, 200.0, 255.0, 9.0, 9.0]);
        assert_eq!(blended(&colours, Kind::Linear, [0.5, 0.5, 0.0]), [100.0, 255.0]);
        let sets = blend(&colours, Kind::Float, &[Blend::new([0, 1, 2], [0.5, 0.5, 0.0]), Blend::copy_of(1)]);
        assert_eq!((sets.component, sets.normalized, sets.size), (Component::F32, false, 8));
        let fraction = |x: f64| f64::from((x / 255.0) as f32);
        assert_eq!(sets.numbers(0).collect::<Vec<_>>(), [fraction(100.0), 1.0]);
        assert_eq!(sets.numbers(1).collect::<Vec<_>>(), [fraction(200.0), 1.0]);
        let numbers = Elements { normalized: false, ..colours };
        assert_eq!(blended(&numbers, Kind::Linear, [0.4, 0.6, 0.0]), [200.0, 255.0], "not mixed");
    }

    #[test]
    fn directions_stay_directions() {
        let tangents =
            elements(Component::F32, 4, &[1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, -1.0, 0.0, 0.0, 1.0]);
        let mean = blended(&tangents, Kind::Direction, [0.6, 0.4, 0.0]);
        assert!(
            (mean[0].hypot(mean[1]) - 1.0).abs() < 1e-6 && mean[0] > mean[1] && mean[3] == 1.0,
            "{mean:?}"
        );
        assert_eq!(blended(&tangents, Kind::Direction, [0.5, 0.0, 0.5]), [1.0, 0.0, 0.0, 1.0]);
        let bytes = elements(Component::I8, 3, &[127.0, 0.0, 0.0, 0.0, 127.0, 0.0, 0.0, 0.0, 127.0]);
        assert_eq!(blended(&bytes, Kind::Direction, [0.5, 0.5, 0.0]), [90.0, 90.0, 0.0]);
    }
}
