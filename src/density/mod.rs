//! Stage 6: how fine the texels have to be, and where.
//!
//! The light is surveyed first: sampled on grids over every surface that become finer where it bends or
//! breaks (`survey`). What each halving of the samples' spacing changes is the error that texels of that
//! spacing leave. Then surfaces are cut into rectangular parts, each with a spacing along either axis,
//! such that the sum of squared errors and a price for every texel is least; the price is raised until
//! the texels fit the page (`cut`); where something hangs closely over a surface, its outline is a place to cut
//! at (`lines`). This is rate–distortion optimal pruning of a tree of cuts
//! (P. A. Chou, T. Lookabaugh and R. M. Gray, "Optimal Pruning with Applications to Tree-Structured
//! Source Coding and Modeling", 1989), with the bits being texels.

mod cut;
mod detail;
mod lines;
mod survey;

use std::sync::Arc;

use glam::DVec2;

use crate::raster::Lighting;
use crate::surface::Surface;
use crate::unwrap::{Part, area_within};
use lines::KnownLine;

/// What is known before the light is looked at, or before surfaces are cut.
#[derive(Clone, Copy, Debug)]
pub struct DensityOptions {
    /// How many texels all charts may take together with the gaps between them.
    pub texels: f64,
    /// The longest that a chart may be, texels.
    pub longest: f64,
    /// Free texels between two charts.
    pub gutter: u32,
    /// A texel's side if all were alike, metres.
    pub uniform_texel: f64,
}

/// What the light is like on all surfaces. Asking the light is what costs; cutting for another number of
/// texels asks nothing anew.
pub struct LightSurvey(survey::Surveys);

impl LightSurvey {
    /// Looks at the light, about as closely as that many texels will show it.
    #[must_use]
    pub fn of(lighting: &Lighting, options: DensityOptions) -> Self {
        Self(survey::survey(lighting, options))
    }

    /// Cuts the surfaces that were looked at into parts whose texels are as fine as the light needs, times
    /// the surface's entry in `weights`: ordered by surface, the parts' weights are texels a metre.
    ///
    /// With weight `w` a spacing `h` costs what `w h` would cost without, `w²` times over. That makes it `w` times
    /// finer wherever it was best, whether light bends there or breaks; counting errors alone as worse
    /// would not (best spacings go with the third to the sixth root of what errors cost).
    #[must_use]
    pub fn cut(&self, surfaces: &[Surface], weights: &[f64], options: DensityOptions) -> Vec<Part> {
        let weigh = |mut parts: Vec<Part>| {
            parts.iter_mut().for_each(|part| part.weight *= weights[part.surface]);
            parts
        };
        let texels = |parts: &[Part]| -> f64 {
            let of = |part: &Part| {
                area_within(&surfaces[part.surface], &part.outline) * part.weight.element_product()
            };
            parts.iter().map(of).sum()
        };
        let finest = weights.iter().copied().fold(1.0, f64::max);
        let options = DensityOptions { longest: options.longest / finest, ..options };
        let plain = cut::cut(surfaces, &self.0, options);
        if weights.iter().all(|&w| w == 1.0) {
            return plain;
        }
        // All together may take no more texels than before.
        let before = texels(&plain);
        let factor = before / texels(&weigh(plain));
        let factor = if factor.is_finite() { factor } else { 1.0 };
        weigh(cut::cut(surfaces, &self.0, DensityOptions { texels: factor * options.texels, ..options }))
    }

    /// Points at which light was evaluated.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.0.samples
    }
}

/// How much error there is at each spacing: levels count halvings of a surface's first spacing.
const LEVELS: usize = 14;

/// For either axis, what halving the samples' spacing for the `n + 1`-th time changes: mean squared
/// difference of irradiance, in the scene's units squared.
type Energy = [[f32; LEVELS]; 2];

/// A rectangle of a surface and the error in it.
#[derive(Clone, Debug)]
struct Cell {
    min: DVec2,
    max: DVec2,
    energy: Energy,
    /// The same for parts that end at all of its `lines`.
    smooth: Energy,
    /// The known lines through the rectangle that was looked at first, which this is a part of.
    lines: Arc<[KnownLine]>,
    /// Halvings that were looked at, for either axis; what `energy` tells of finer ones is a guess.
    levels: [usize; 2],
}

/// What is known of the light on one surface.
#[derive(Clone, Debug)]
struct SurfaceSurvey {
    /// The surface's bounding rectangle.
    min: DVec2,
    max: DVec2,
    /// The spacing before the first halving, metres.
    base: DVec2,
    /// Cells that hold something of the surface; they do not overlap.
    cells: Vec<Cell>,
}
