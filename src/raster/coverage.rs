//! stub
use crate::surface::Surface;
use crate::unwrap::Atlas;
/// stub
#[derive(Clone, Copy, Debug)]
pub struct TexelSite {
    /// stub
    pub x: u32,
    /// stub
    pub y: u32,
    /// stub
    pub surface: u32,
    /// stub
    pub region: u32,
    /// stub
    pub point: glam::DVec2,
}
/// stub
#[must_use]
pub fn sites(_: &[Surface], _: &Atlas, _: &(dyn Fn(usize, usize) -> bool + Sync)) -> Vec<TexelSite> {
    Vec::new()
}
