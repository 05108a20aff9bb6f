//! Which way texels took to their direct light.

use serde::Serialize;

/// How many texels took which way, once for each emitter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TexelWays {
    /// None of the emitter's light can reach them: they face away from it, or it from them.
    pub behind: u64,
    /// Nothing stands between: the closed form, and no ray.
    pub lit: u64,
    /// One occluder hides the whole emitter: zero, and no ray.
    pub umbra: u64,
    /// In a wide penumbra: interpolated between exact values.
    pub smooth: u64,
    /// A shadow falls on them: evaluated once.
    pub crossed: u64,
    /// A shadow's edge crosses them: evaluated at several points.
    pub edge: u64,
}

impl TexelWays {
    /// Adds others.
    pub(super) fn add(&mut self, other: &Self) {
        self.behind += other.behind;
        self.lit += other.lit;
        self.umbra += other.umbra;
        self.smooth += other.smooth;
        self.crossed += other.crossed;
        self.edge += other.edge;
    }
}
