//! From the light to a page: where texels are dense, where charts lie, and what the texels hold.

use crate::density::{DensityOptions, apportion};
use crate::options::{BakeOptions, DensityPolicy, Resolution};
use crate::raster::Lighting;
use crate::surface::Surface;
use crate::unwrap::{Atlas, Part, Room, UnwrapError, UnwrapOptions, unwrap, weighed_area, whole};

/// The share of a page that charts and their padding fill.
const FILLED: f64 = 0.95;

/// The share of a page's texels that charts cover, about, where light decides on density.
const COVERED: f64 = 0.8;

/// Where light decides on density and the charts leave room, they may still become denser by this factor:
/// more texels than the light asks for only make the file larger.
const SPARE: f64 = 1.25;

/// Lays the charts out.
pub(super) fn lay_out(lighting: &Lighting, options: &BakeOptions, texel: f64) -> Result<Atlas, UnwrapError> {
    let surfaces = lighting.surfaces();
    let room = match options.resolution {
        Resolution::Size(side) => Room::Square(side),
        Resolution::TexelsPerMetre(density) => Room::Density(density),
    };
    let mut unwrapping = UnwrapOptions { padding: options.padding, ..UnwrapOptions::new(room) };
    match options.density {
        DensityPolicy::Uniform => unwrap(surfaces, &whole(surfaces), &unwrapping),
        DensityPolicy::Light => {
            let (texels, longest) = match room {
                Room::Square(side) => (FILLED * f64::from(side).powi(2), f64::from(side) - 1.0),
                Room::Density(density) => {
                    let area: f64 = surfaces.iter().map(|s| s.area).sum();
                    let texels = area * density * density / COVERED;
                    (texels, 1.5 * texels.sqrt())
                }
                Room::Texels(texels) => (texels, 1.5 * texels.sqrt()),
            };
            let padding = options.padding.unwrap_or(1);
            let density = DensityOptions { texels, longest, padding, uniform_texel: texel };
            let mut parts = apportion(lighting, density).parts;
            let mean = normalize(surfaces, &mut parts);
            if let Room::Square(_) = room {
                unwrapping.most = Some(SPARE * mean);
            }
            unwrap(surfaces, &parts, &unwrapping)
        }
    }
}

/// Makes the parts' weights relative to their mean by area, so that a density means the same as for parts that
/// are all alike; returns the mean, texels a metre.
fn normalize(surfaces: &[Surface], parts: &mut [Part]) -> f64 {
    let area: f64 = surfaces.iter().map(|s| s.area).sum();
    let texels: f64 = parts.iter().map(|part| weighed_area(part, &surfaces[part.surface])).sum();
    let mean = (texels / area).sqrt();
    let mean = if mean.is_finite() && mean > 0.0 { mean } else { 1.0 };
    parts.iter_mut().for_each(|part| part.weight /= mean);
    mean
}
