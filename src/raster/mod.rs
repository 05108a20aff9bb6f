//! Stage 7: from charts and the radiosity mesh to texels.
//!
//! Every texel that a bilinear lookup inside a chart can touch is evaluated at a point of its
//! own chart and outside of any solid that stands there; the gaps between charts are filled
//! from it.

mod buried;
mod cover;
mod coverage;
mod dilate;
mod direct;
mod edge;
mod fit;
mod locate;
mod penumbra;
mod reflected;
mod seams;
mod shadowing;
mod ways;

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::element::SurfaceAppearance;
use crate::light::luminance;
use crate::options::{BakeOptions, Direct, Quantity};
use crate::retriangulate::{RadiosityMesh, SurfaceMesh};
use crate::solve::emitter::{Effort, Emitter};
use crate::solve::umbra::Occluders;
use crate::surface::{Region, Surface};
use crate::trace::Tracer;
use crate::unwrap::{Atlas, Chart, PageArea};
use buried::{Outlook, outlook};
use cover::{Cover, take_after_neighbours};
use coverage::chart_sites;
pub use coverage::{SitePosition, TexelSite, sites};
pub use dilate::dilate;
use direct::{DirectLight, Edges, LitTexel, texel_steps};
use locate::TriangleLocator;
use reflected::fit_reflected;
pub use seams::SeamReport;
pub use shadowing::Shadowing;
pub use ways::TexelWays;

/// A finished lightmap page, or several in one sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Lightmap {
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// Row by row from the top: the quantity asked for, linear RGB.
    pub texels: Vec<[f32; 3]>,
}

impl Lightmap {
    /// A page of a sheet; what of it lies outside the sheet is left out.
    #[must_use]
    pub fn page(&self, area: PageArea) -> Cow<'_, Self> {
        if (area.row, area.width, area.height) == (0, self.width, self.height) {
            return Cow::Borrowed(self);
        }
        let rows = self.texels.chunks(self.width.max(1) as usize);
        let rows = rows.skip(area.row as usize).take(area.height as usize);
        let texels = rows.flat_map(|row| row.iter().take(area.width as usize)).copied().collect();
        Cow::Owned(Self { width: area.width.min(self.width), height: area.height, texels })
    }
}

/// What texels are made from.
pub struct RasterInput<'a> {
    /// The surfaces.
    pub surfaces: &'a [Surface],
    /// The light on them.
    pub mesh: &'a RadiosityMesh,
    /// The scene's triangles.
    pub tracer: &'a Tracer,
    /// Their convex outlines.
    pub occluders: &'a Occluders,
    /// What shines.
    pub emitters: &'a [Emitter],
    /// Mean luminance of the irradiance on all surfaces.
    pub typical: f64,
    /// Reflectance and emission, for [`Quantity::Radiosity`] and previews.
    pub appearance: &'a (dyn SurfaceAppearance + Sync),
    /// The caller's options.
    pub options: &'a BakeOptions,
}

/// Tells the light on any part of the surfaces.
pub struct Lighting<'a> {
    input: &'a RasterInput<'a>,
    /// For each surface's regions whether nobody sees them.
    buried: Vec<Vec<bool>>,
    locators: Vec<TriangleLocator<'a>>,
}

/// What [`Lighting::at_centres`] found.
#[derive(Clone, Debug)]
pub struct Look {
    /// Texel by texel.
    pub light: Vec<Option<PointLight>>,
    /// What stands between the rectangle and what shines; `None` where that was not asked.
    pub shadowing: Option<Shadowing>,
}

/// What is known of a rectangle from a look at a larger one.
pub struct CloserLook<'a> {
    /// Texel by texel the light that is known.
    pub light: &'a [Option<PointLight>],
    /// What stands before the larger one.
    pub shadowing: Option<&'a Shadowing>,
}

/// The light at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Irradiance.
    pub irradiance: DVec3,
    /// Luminance of the light that shadows between this point and the next may hide or let through.
    pub doubtful: f64,
    /// Whether the point is the texel's centre, not the nearest of a surface that ends before it.
    pub is_centre: bool,
}

/// What rasterizing took.
#[derive(Clone, Copy, Debug, Default)]
pub struct TexelCounts {
    /// Texels that lie in a chart or are touched by a lookup inside it.
    pub covered: u64,
    /// Texels whose direct light was evaluated.
    pub evaluated: u64,
    /// Texels filled from their neighbours.
    pub dilated: u64,
    /// How they came by it, emitters times texels.
    pub ways: TexelWays,
    /// Evaluations of direct light and rays, emitters times points.
    pub effort: Effort,
    /// How well the charts agree where they meet.
    pub seams: SeamReport,
}

impl<'a> Lighting<'a> {
    /// Sorts the mesh's triangles and finds the regions that nobody sees.
    #[must_use]
    pub fn new(input: &'a RasterInput<'a>) -> Self {
        let locators = input.mesh.surfaces.par_iter().map(TriangleLocator::new).collect();
        Self { input, buried: buried_regions(input), locators }
    }

    /// The surfaces.
    #[must_use]
    pub fn surfaces(&self) -> &'a [Surface] {
        self.input.surfaces
    }

    /// The scene's triangles.
    #[must_use]
    pub fn tracer(&self) -> &'a Tracer {
        self.input.tracer
    }

    /// How many emitters light the surfaces.
    #[must_use]
    pub fn emitters(&self) -> usize {
        self.input.emitters.len()
    }

    /// The irradiance at the texel centres of a page of `size` texels that `chart`, a rectangle of its surface,
    /// alone lies in, row by row; `None` where nothing of the surface that is seen is near. Where light is
    /// [known](CloserLook::light) it is not evaluated again.
    #[must_use]
    pub fn at_centres(&self, chart: &Chart, size: (u32, u32), closer: Option<&CloserLook>) -> Look {
        let surface = &self.input.surfaces[chart.surface];
        let sites = chart_sites(surface, chart, size, &|region| !self.buried[chart.surface][region]);
        let mut light = vec![None; size.0 as usize * size.1 as usize];
        if let Some(closer) = closer {
            light.copy_from_slice(closer.light);
        }
        let place = |[x, y]: [u32; 2]| y as usize * size.0 as usize + x as usize;
        let is_wanted = |site: &TexelSite| {
            site.position != SitePosition::Buried && light[place([site.x, site.y])].is_none()
        };
        let wanted = sites.iter().enumerate().filter(|(_, site)| is_wanted(site));
        let mut texels: Vec<LitTexel> = wanted.map(|(index, site)| LitTexel::new(index, site)).collect();
        let shadowing = (self.input.options.direct == Direct::Texel).then(|| {
            let known = closer.and_then(|c| c.shadowing);
            self.direct(Edges::Once).shine_once(surface, chart, &mut texels, known)
        });
        self.add_indirect(chart.surface, &mut texels);
        for texel in &texels {
            let irradiance = texel.direct + texel.indirect;
            let is_centre = sites[texel.site].position == SitePosition::Centre;
            light[place(texel.cell)] = Some(PointLight { irradiance, doubtful: texel.doubtful, is_centre });
        }
        Look { light, shadowing }
    }

    fn direct(&self, edges: Edges) -> DirectLight<'a> {
        DirectLight {
            tracer: self.input.tracer,
            occluders: self.input.occluders,
            emitters: self.input.emitters,
            typical: self.input.typical,
            edges,
        }
    }

    /// Looks up what the mesh holds.
    fn add_indirect(&self, surface: usize, texels: &mut [LitTexel]) {
        for texel in texels {
            let (direct, indirect) = self.locators[surface].light_at(texel.point, texel.region);
            texel.indirect =
                if self.input.options.direct == Direct::Mesh { direct + indirect } else { indirect };
        }
    }
}

/// The pages of one atlas.
#[derive(Clone, Debug)]
pub struct Rasterized {
    /// The lightmap.
    pub lightmap: Lightmap,
    /// What the surfaces send out, `L + ρ E / π` in nits, where the options ask for a preview.
    pub preview: Option<Lightmap>,
    /// What it took.
    pub counts: TexelCounts,
}

/// Computes all texels of all pages.
#[must_use]
pub fn rasterize(lighting: &Lighting, atlas: &Atlas) -> Rasterized {
    let input = lighting.input;
    let is_open = |surface: usize, region: usize| !lighting.buried[surface][region];
    let sites = sites(input.surfaces, atlas, &is_open);
    let mut of_chart: Vec<Vec<usize>> = vec![Vec::new(); atlas.charts.len()];
    for (index, site) in sites.iter().enumerate() {
        of_chart[site.chart as usize].push(index);
    }
    let lit: Vec<(Vec<LitTexel>, TexelWays, Effort)> = of_chart
        .par_iter()
        .zip(&atlas.charts)
        .map(|(indices, chart)| chart_texels(lighting, chart, (indices, &sites)))
        .collect();
    let size = (atlas.width, atlas.height);
    let count = size.0 as usize * size.1 as usize;
    let (mut texels, mut owners) = (vec![[0.0; 3]; count], vec![None; count]);
    let mut counts = TexelCounts { covered: sites.len() as u64, ..TexelCounts::default() };
    for (lit, ways, effort) in &lit {
        if input.options.direct == Direct::Texel {
            counts.evaluated += lit.len() as u64;
        }
        counts.ways.add(ways);
        counts.effort.add(*effort);
        for texel in lit {
            let site = &sites[texel.site];
            let at = site.y as usize * size.0 as usize + site.x as usize;
            texels[at] = texel.direct.as_vec3().to_array();
            owners[at] = Some(site.chart);
        }
    }
    counts.seams = seams::join(input.surfaces, atlas, &mut texels, &owners);
    let mut valid: Vec<bool> = owners.iter().map(Option::is_some).collect();
    let finished = sites.par_iter().map(|site| {
        let at = site.y as usize * size.0 as usize + site.x as usize;
        let irradiance = DVec3::from_array(texels[at].map(f64::from));
        let chart = &atlas.charts[site.chart as usize];
        let preview = input.options.preview.map(|_| radiosity(input, chart, site.point, irradiance) / PI);
        (at, quantity(input, chart, site.point, irradiance), preview)
    });
    let mut preview = input.options.preview.map(|_| vec![[0.0; 3]; count]);
    for (at, value, sent_out) in finished.collect::<Vec<_>>() {
        texels[at] = value.as_vec3().to_array();
        if let (Some(preview), Some(sent_out)) = (&mut preview, sent_out) {
            preview[at] = sent_out.as_vec3().to_array();
        }
    }
    tracing::debug!(?counts, "texels");
    let before = valid.iter().filter(|&&v| v).count();
    let half = atlas.gutter.div_ceil(2);
    if let Some(preview) = &mut preview {
        dilate(preview, &mut valid.clone(), size, half);
    }
    dilate(&mut texels, &mut valid, size, half);
    counts.dilated = (valid.iter().filter(|&&v| v).count() - before) as u64;
    let page = |texels| Lightmap { width: size.0, height: size.1, texels };
    Rasterized { lightmap: page(texels), preview: preview.map(page), counts }
}

/// A gap with less light than this fraction of the brightest region of its surface is dark.
const DARK: f64 = 1e-2;

/// Less than this is none: the inside of a hollow pillar, say, whose foot must not darken the floor around it.
const BLACK: f64 = 1e-4;

/// For each surface's regions whether nobody sees them.
fn buried_regions(input: &RasterInput) -> Vec<Vec<bool>> {
    let brightest = |mesh: &SurfaceMesh, region: usize| {
        let corners = mesh.triangles.iter().zip(&mesh.regions).filter(|(_, r)| **r as usize == region);
        corners
            .flat_map(|(t, _)| t.iter().map(|&v| &mesh.vertices[v as usize]))
            .map(|v| luminance(v.direct + v.indirect))
            .fold(0.0, f64::max)
    };
    input
        .surfaces
        .par_iter()
        .zip(&input.mesh.surfaces)
        .map(|(surface, mesh)| {
            if surface.regions.len() < 2 {
                return vec![false; surface.regions.len()];
            }
            let light: Vec<f64> = (0..surface.regions.len()).map(|r| brightest(mesh, r)).collect();
            let most = light.iter().copied().fold(0.0, f64::max);
            let is_buried = |(region, &light): (&Region, &f64)| match outlook(surface, region, input.tracer) {
                Outlook::Open => light < BLACK * most,
                Outlook::Narrow => light < DARK * most,
                Outlook::Backs => true,
            };
            surface.regions.iter().zip(&light).map(is_buried).collect()
        })
        .collect()
}

/// The irradiance of one chart's texels, in `direct`.
fn chart_texels(
    lighting: &Lighting,
    chart: &Chart,
    (indices, sites): (&[usize], &[TexelSite]),
) -> (Vec<LitTexel>, TexelWays, Effort) {
    let (input, surface) = (lighting.input, chart.surface);
    let mut texels: Vec<LitTexel> =
        indices.iter().map(|&index| LitTexel::new(index, &sites[index])).collect();
    let step = texel_steps(chart);
    let cover =
        Cover { tracer: input.tracer, surface: &input.surfaces[surface], outline: &chart.outline, step };
    cover.uncover(&mut texels);
    let (mut ways, mut effort) = (TexelWays::default(), Effort::default());
    if input.options.direct == Direct::Texel {
        (ways, effort) = lighting.direct(Edges::Fitted).shine(&input.surfaces[surface], chart, &mut texels);
    }
    lighting.add_indirect(surface, &mut texels);
    // Where direct light is the mesh's too, lookups have both, and the dark that one makes beside a shadow stays.
    if input.options.direct == Direct::Texel {
        fit_reflected(lighting, chart, &cover, &mut texels);
    }
    take_after_neighbours(&mut texels, |t| &mut t.indirect);
    for texel in &mut texels {
        texel.direct += texel.indirect;
    }
    (texels, ways, effort)
}

/// What a texel holds that shows a place of a surface with this irradiance.
fn quantity(input: &RasterInput, chart: &Chart, point: DVec2, irradiance: DVec3) -> DVec3 {
    match input.options.quantity {
        Quantity::Irradiance => irradiance,
        Quantity::Radiance => irradiance / PI,
        Quantity::Radiosity => radiosity(input, chart, point, irradiance),
    }
}

/// What the part of the surface that a texel shows sends out, materials averaged over it.
fn radiosity(input: &RasterInput, chart: &Chart, point: DVec2, irradiance: DVec3) -> DVec3 {
    let step = texel_steps(chart);
    let half = 0.5 * (step[0].abs() + step[1].abs());
    let (min, max) = (point - half, point + half);
    input.appearance.exitance(chart.surface, min, max)
        + input.appearance.reflectance(chart.surface, min, max) * irradiance
}
