//! stub
use super::{PlanarRegion, Triangulation};
/// stub
#[must_use]
pub fn triangulate(_: PlanarRegion) -> Triangulation {
    Triangulation::default()
}
