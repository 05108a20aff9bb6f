//! Lengths that follow from the scene's area and the lightmap's resolution.

use crate::options::{BakeOptions, Direct, Resolution};
use crate::surface::Surface;

use super::budget::texels_for;
use super::page::FILLED;

/// About how many patches the scene's area is divided into; small surfaces come on top.
const PATCHES: f64 = 500.0;

/// Share of a page that charts fill, about: what a texel's size is guessed with before the charts are packed.
const UTILISATION: f64 = 0.6;

/// With direct light evaluated in texels, elements need not follow its shadows closer than this many texels.
const TEXELS_AN_ELEMENT: f64 = 2.5;

/// Patches have no shorter sides than this many texels.
const TEXELS_A_PATCH: f64 = 4.0;

/// Reflected light is followed into corners that a uniform atlas would not show: texels are finer where light is.
const ELEMENTS_A_TEXEL: f64 = 2.0;

/// The lengths, metres.
pub(super) struct Scale {
    /// The side of the patches that shoot.
    pub(super) patch_size: f64,
    /// Elements no larger are not split for direct light,
    pub(super) threshold: f64,
    /// and these not for reflected light.
    pub(super) indirect_threshold: f64,
    /// A texel's side if all were alike.
    pub(super) texel: f64,
}

impl Scale {
    pub(super) fn of(surfaces: &[Surface], options: &BakeOptions) -> Self {
        let area: f64 = surfaces.iter().map(|s| s.area).sum();
        let texel = match options.resolution {
            Resolution::Size(side) => {
                (area / UTILISATION).sqrt() / (f64::from(side) * f64::from(options.pages).sqrt())
            }
            Resolution::TexelsPerMetre(density) => 1.0 / density,
            Resolution::Bytes(bytes) => {
                let page = texels_for(bytes, options.quantity) / FILLED;
                (area / UTILISATION / page).sqrt()
            }
        };
        let patch_size = (area / PATCHES).sqrt();
        let threshold = options.subdivision_threshold.unwrap_or(match options.direct {
            Direct::Mesh => texel,
            Direct::Texel => TEXELS_AN_ELEMENT * texel,
        });
        let indirect_threshold = options.subdivision_threshold.unwrap_or(texel / ELEMENTS_A_TEXEL);
        Self {
            patch_size: patch_size.max(threshold).max(TEXELS_A_PATCH * texel),
            threshold,
            indirect_threshold,
            texel,
        }
    }
}
