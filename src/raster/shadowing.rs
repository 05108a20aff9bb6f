//! What stands between an emitter and a rectangle of a surface, handed down to the rectangle's parts.

use super::direct::Shining;
use crate::geom::Slab;
use crate::surface::Surface;

/// So many triangles that stand before a part of a surface are remembered for its parts.
const MOST_REMEMBERED: usize = 512;

/// What stands between an emitter and a part of a surface.
#[derive(Clone, Debug)]
pub(super) enum Standing {
    /// The one lies behind the other: no light arrives.
    Behind,
    /// Nothing: all light arrives.
    Nothing,
    /// One occluder that hides the whole emitter: no light arrives.
    Umbra,
    /// These triangles reach into the shaft, ascending.
    Some(Vec<u32>),
    /// More triangles than are worth remembering do.
    Many,
}

/// What stands between all emitters and a part of a surface.
#[derive(Clone, Debug)]
pub struct Shadowing(pub(super) Vec<Standing>);

impl Shining<'_> {
    /// What stands before a rectangle, told from what is `known` of a larger one.
    pub(super) fn standing(&self, block: &Slab, known: Option<&Standing>) -> Standing {
        let found = match known {
            Some(known @ (Standing::Behind | Standing::Nothing | Standing::Umbra)) => return known.clone(),
            _ if self.is_behind(block) => return Standing::Behind,
            Some(Standing::Some(between)) => self.standing_before(block, Some(between)),
            Some(Standing::Many) | None => self.standing_before(block, None),
        };
        match found {
            Standing::Some(between) if between.len() > MOST_REMEMBERED => Standing::Many,
            found => found,
        }
    }

    /// Whether none of the emitter's light can reach a block.
    pub(super) fn is_behind(&self, block: &Slab) -> bool {
        let Surface { frame, smooth, .. } = self.surface;
        self.emitter.is_behind(block, frame.normal, smooth.as_deref(), self.light.tracer.margin())
    }

    /// What stands before a block that is not behind the emitter.
    pub(super) fn standing_before(&self, block: &Slab, inherited: Option<&[u32]>) -> Standing {
        let tracer = self.light.tracer;
        let Surface { frame, smooth, .. } = self.surface;
        let between = self.emitter.between(block, (frame, smooth.as_deref()), tracer, inherited);
        if between.is_empty() {
            Standing::Nothing
        } else if self.light.occluders.one_hides(block.corners(), self.emitter, tracer, &between) {
            Standing::Umbra
        } else {
            Standing::Some(between)
        }
    }
}
