//! Which triangles let light through.

use std::sync::Arc;

use glam::DVec3;

use crate::scene::{Coverage, Scene, Triangle};
use crate::trace::Screen;

/// A triangle that is not there all over.
#[derive(Debug)]
struct Cutout(Coverage);

impl Screen for Cutout {
    fn coverage(&self, barycentric: DVec3) -> f64 {
        self.0.at(barycentric)
    }
}

/// A triangle that stands in nobody's way.
#[derive(Debug)]
struct Nothing;

impl Screen for Nothing {
    fn coverage(&self, _: DVec3) -> f64 {
        0.0
    }
}

/// For each of the scene's triangles how it lets light through; `None` where it is solid.
pub(super) fn of_triangles(scene: &Scene) -> Vec<Option<Arc<dyn Screen>>> {
    let of = |(index, triangle): (usize, &Triangle)| -> Option<Arc<dyn Screen>> {
        let casts = scene.placements.get(triangle.placement as usize).is_none_or(|p| p.settings.cast);
        if casts { Some(Arc::new(Cutout(scene.coverage(index)?))) } else { Some(Arc::new(Nothing)) }
    };
    scene.triangles.iter().enumerate().map(of).collect()
}
