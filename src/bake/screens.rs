//! Which triangles let light through.

use std::sync::Arc;

use glam::DVec3;

use crate::scene::{Coverage, Scene};
use crate::trace::Screen;

/// A triangle that is not there all over.
#[derive(Debug)]
struct Cutout(Coverage);

impl Screen for Cutout {
    fn coverage(&self, barycentric: DVec3) -> f64 {
        self.0.at(barycentric)
    }
}

/// For each of the scene's triangles how it lets light through; `None` where it is solid.
pub(super) fn of_triangles(scene: &Scene) -> Vec<Option<Arc<dyn Screen>>> {
    let of = |triangle| Some(Arc::new(Cutout(scene.coverage(triangle)?)) as Arc<dyn Screen>);
    (0..scene.triangles.len()).map(of).collect()
}
