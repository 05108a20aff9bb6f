//! From the light to a page: where texels are dense, where charts lie, and what the texels hold.

use crate::density::{DensityOptions, LightSurvey};
use crate::error::Error;
use crate::options::{BakeOptions, DensityPolicy, Resolution};
use crate::progress::Stage;
use crate::raster::{Lighting, Lightmap, Rasterized, TexelCounts, rasterize};
use crate::report::Recorder;
use crate::scene::Scene;
use crate::surface::Surface;
use crate::unwrap::{
    Atlas, Block, Part, Room, UnwrapError, UnwrapOptions, area_within, mean_gutter, unwrap_groups, whole,
};

use super::budget::{self, texels_for};
use super::cells::fill_cells;
use super::enter;

/// The share of a page that charts and the gaps between them fill.
pub(super) const FILLED: f64 = 0.95;

/// The share of a page's texels that charts cover, about, where light decides on density.
const COVERED: f64 = 0.8;

/// Where light decides on density and the charts leave room, they may still become denser by this factor:
/// more texels than the light asks for only make the file larger.
const SPARE: f64 = 1.25;

/// No chart is longer than this many times the side of a square page, where the page may take any shape.
const LONGEST: f64 = 1.5;

/// A finished page, or a finished sheet of several.
pub(super) struct Page {
    pub(super) atlas: Atlas,
    pub(super) lightmap: Lightmap,
    /// What the surfaces send out, where the options ask for a preview.
    pub(super) preview: Option<Lightmap>,
    pub(super) texels: TexelCounts,
}

/// Makes pages of one solution.
pub(super) struct PageMaker<'a> {
    lighting: &'a Lighting<'a>,
    options: &'a BakeOptions,
    /// A texel's side if all were alike, metres.
    texel: f64,
    /// Where the light needs texels, if it decides; it is asked once, for about the texels that are expected.
    survey: Option<LightSurvey>,
    wishes: Wishes,
}

/// What is wished of charts.
pub(super) struct Wishes {
    /// How many times as dense as else texels lie on each surface.
    pub(super) weights: Vec<f64>,
    /// The node of each placement: its surfaces share a page where they can.
    pub(super) nodes: Vec<usize>,
    /// Surfaces that keep the input's layout. Where there are some, texels are as dense everywhere.
    pub(super) blocks: Vec<Block>,
    /// For each surface whether it gets a chart of its own.
    pub(super) charted: Vec<bool>,
}

impl Wishes {
    pub(super) fn new(
        scene: &Scene,
        surfaces: &[Surface],
        weights: Vec<f64>,
        mut blocks: Vec<Block>,
    ) -> Self {
        let mut charted = vec![true; surfaces.len()];
        if !blocks.is_empty() {
            let is_lit = |s: &Surface| scene.placements.get(s.placement).is_none_or(|p| p.settings.bake);
            charted = surfaces.iter().map(is_lit).collect();
        }
        for block in &mut blocks {
            block.members.iter().for_each(|member| charted[member.surface] = false);
            let sum: f64 = block.members.iter().map(|member| weights[member.surface]).sum();
            block.weight = sum / block.members.len().max(1) as f64;
        }
        let nodes = scene.placements.iter().map(|placement| placement.node).collect();
        Self { weights, nodes, blocks, charted }
    }

    /// The fewest charts that are packed.
    pub(super) fn charts(&self) -> usize {
        self.blocks.len() + self.charted.iter().filter(|&&charted| charted).count()
    }
}

impl<'a> PageMaker<'a> {
    pub(super) fn new(
        lighting: &'a Lighting<'a>,
        options: &'a BakeOptions,
        texel: f64,
        wishes: Wishes,
    ) -> Self {
        let mut maker = Self { lighting, options, texel, survey: None, wishes };
        if options.density == DensityPolicy::Light {
            let density = maker.density(maker.room(), options.padding);
            maker.survey = Some(LightSurvey::of(lighting, density));
        }
        maker
    }

    /// The page that the options ask for.
    pub(super) fn page(&self, recorder: &mut Recorder) -> Result<Page, Error> {
        match self.options.resolution {
            Resolution::Bytes(bytes) => budget::within(self, bytes, recorder),
            _ => self.page_of(self.room(), self.options.padding, recorder),
        }
    }

    /// A page of that size; `padding` as in the options.
    pub(super) fn page_of(
        &self,
        room: Room,
        padding: Option<u32>,
        recorder: &mut Recorder,
    ) -> Result<Page, Error> {
        enter(recorder, Stage::Unwrap)?;
        let atlas = self.lay_out(room, padding)?;
        self.paint(atlas, recorder)
    }

    /// The least page that there can be: every surface is one chart of one texel.
    pub(super) fn least_page(&self, recorder: &mut Recorder) -> Result<Page, Error> {
        enter(recorder, Stage::Unwrap)?;
        let surfaces = self.lighting.surfaces();
        let unwrapping = self.unwrapping(Room::Texels(0.0), Some(self.options.padding.unwrap_or(0)));
        let atlas = self.unwrap(&self.whole(surfaces), &unwrapping)?;
        self.paint(atlas, recorder)
    }

    /// Surfaces that keep the input's layout.
    pub(super) fn blocks(&self) -> &[Block] {
        &self.wishes.blocks
    }

    /// What a page of this solution holds.
    pub(super) fn options(&self) -> &BakeOptions {
        self.options
    }

    fn paint(&self, atlas: Atlas, recorder: &mut Recorder) -> Result<Page, Error> {
        enter(recorder, Stage::Raster)?;
        let Rasterized { mut lightmap, mut preview, counts: mut texels } = rasterize(self.lighting, &atlas);
        if self.options.mips > 0 {
            let (surfaces, mips) = (self.lighting.surfaces(), self.options.mips);
            texels.dilated = fill_cells(&mut lightmap, surfaces, &atlas, mips);
            if let Some(preview) = &mut preview {
                fill_cells(preview, surfaces, &atlas, mips);
            }
        }
        Ok(Page { atlas, lightmap, preview, texels })
    }

    /// How large the page becomes, or about how large.
    fn room(&self) -> Room {
        match self.options.resolution {
            Resolution::Size(side) => Room::Square(side),
            Resolution::TexelsPerMetre(density) => Room::Density(density),
            Resolution::Bytes(bytes) => Room::Texels(texels_for(bytes, self.options.quantity)),
        }
    }

    fn unwrapping(&self, room: Room, padding: Option<u32>) -> UnwrapOptions {
        let BakeOptions { mips, pages, .. } = *self.options;
        UnwrapOptions { padding, mips, pages, ..UnwrapOptions::new(room) }
    }

    fn lay_out(&self, room: Room, padding: Option<u32>) -> Result<Atlas, UnwrapError> {
        let surfaces = self.lighting.surfaces();
        let mut unwrapping = self.unwrapping(room, padding);
        let parts = match &self.survey {
            None => {
                let mut parts = self.whole(surfaces);
                parts.iter_mut().for_each(|part| part.weight *= self.wishes.weights[part.surface]);
                parts
            }
            Some(survey) => {
                let mut parts = survey.cut(surfaces, &self.wishes.weights, self.density(room, padding));
                let mean = normalize(surfaces, &mut parts);
                if !matches!(room, Room::Density(_)) {
                    unwrapping.most = Some(SPARE * mean);
                }
                parts
            }
        };
        self.unwrap(&parts, &unwrapping)
    }

    /// A part for each surface that gets a chart of its own.
    fn whole(&self, surfaces: &[Surface]) -> Vec<Part> {
        let mut parts = whole(surfaces);
        parts.retain(|part| self.wishes.charted[part.surface]);
        parts
    }

    fn unwrap(&self, parts: &[Part], unwrapping: &UnwrapOptions) -> Result<Atlas, UnwrapError> {
        let node = |surface: &Surface| self.wishes.nodes.get(surface.placement).copied().unwrap_or(0);
        unwrap_groups(self.lighting.surfaces(), (&self.wishes.blocks, parts), &node, unwrapping)
    }

    /// What deciding on density must know of the page.
    fn density(&self, room: Room, padding: Option<u32>) -> DensityOptions {
        let texels = match room {
            Room::Square(side) => f64::from(self.options.pages) * FILLED * f64::from(side).powi(2),
            Room::Density(density) => {
                let area: f64 = self.lighting.surfaces().iter().map(|s| s.area).sum();
                area * density * density / COVERED
            }
            Room::Texels(texels) => texels,
        };
        let longest = match room {
            Room::Square(side) => f64::from(side) - 1.0,
            _ => LONGEST * texels.sqrt(),
        };
        let gutter = mean_gutter(padding, self.options.mips);
        DensityOptions { texels, longest, gutter, uniform_texel: self.texel }
    }
}

/// Makes the parts' weights relative to their mean by area, so that a density means the same as for parts that
/// are all alike; returns the mean, texels a metre.
fn normalize(surfaces: &[Surface], parts: &mut [Part]) -> f64 {
    let area: f64 = surfaces.iter().map(|s| s.area).sum();
    let of =
        |part: &Part| area_within(&surfaces[part.surface], &part.outline) * part.weight.element_product();
    let texels: f64 = parts.iter().map(of).sum();
    let mean = (texels / area).sqrt();
    let mean = if mean.is_finite() && mean > 0.0 { mean } else { 1.0 };
    parts.iter_mut().for_each(|part| part.weight /= mean);
    mean
}
