//! The photometric (or radiometric) quantities that travel between stages.
//!
//! All are linear Rec. 709 RGB triples in the scene's own units; glTF gives nits
//! for surfaces, candela for point and spot lights, lux for directional ones.
//! The newtypes keep apart what could be swapped by mistake at a stage's border;
//! inside the solver's loops the bare [`DVec3`] is used, and its name says which
//! quantity it holds.

use glam::DVec3;
use serde::Serialize;

/// Light that arrives at a surface per area, `E` (lux or W/m²).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Irradiance(pub DVec3);

/// Light that leaves a surface per area and projected solid angle, `L` (nits).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Radiance(pub DVec3);

/// Light that leaves a surface per area, emitted and reflected: `B = π L + ρ E`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Radiosity(pub DVec3);

/// The share of arriving light that a Lambertian surface sends out again, `ρ`, in `[0, 1]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Reflectance(pub DVec3);

/// Relative luminance of linear Rec. 709 RGB.
#[must_use]
pub fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}
