//! Direct light in texels: closed form, and rays or cutting only where a shadow's edge falls.
//!
//! A surface's texels are halved into ever smaller blocks. For each block and emitter, what
//! stands in the shaft between them is handed down from the larger block, and filtered
//! whenever blocks have become clearly smaller. An empty shaft means closed form for all of
//! the block's texels; one occluder that hides everything, zero; a wide penumbra is
//! interpolated between a few exact values; only small blocks that a shadow's edge crosses
//! ask for visibility in every texel, and take several points a texel, which the texels are
//! then fitted to.

use glam::{DAffine2, DVec2, DVec3};

use super::cover::{Cover, Covering, take_after_neighbours};
use super::coverage::TexelSite;
use super::edge::fit_edges;
use super::fit::LightSample;
use super::penumbra::{SmoothBlock, is_soft};
use super::shadowing::{Shadowing, Standing};
use super::ways::TexelWays;
use crate::geom::polygon::rectangle;
use crate::geom::{Bounds, Ring, Slab};
use crate::solve::emitter::{Between, Effort, Emitter, Evaluation, Precision};
use crate::solve::form_factor::SurfacePoint;
use crate::solve::umbra::Occluders;
use crate::surface::Surface;
use crate::trace::Tracer;
use crate::unwrap::Chart;

/// Blocks of no more texels than this are not halved further: where texels at an edge are fitted, small ones tell
/// best which have to be;
const SMALL_BLOCK: usize = 8;
/// where each point is asked once, a few occluders more cost less than another shaft.
const SMALL_BLOCK_ONCE: usize = 24;

/// Blocks of so many texels are looked at for smooth penumbrae.
const SMOOTH_BLOCKS: std::ops::RangeInclusive<usize> = 17..=1024;

/// A block this many times smaller than the one whose shaft it inherited gets a shaft of its own.
const BLOCKS_A_SHAFT: usize = 3;

/// Blocks of more texels than this are worked on side by side.
const PARALLEL_BLOCK: usize = 4096;

/// Shadows of emitters that all together give less than this fraction of the scene's typical light are too faint to
/// be looked for: as much may be missed in a smooth penumbra.
const FAINT: f64 = 0.002;

/// A texel that receives direct light.
#[derive(Clone, Copy, Debug)]
pub(super) struct LitTexel {
    /// Its index among the sites.
    pub site: usize,
    /// Column and row.
    pub cell: [u32; 2],
    /// Region of the surface.
    pub region: u32,
    /// Where it is evaluated, plane coordinates.
    pub point: DVec2,
    /// What arrives.
    pub direct: DVec3,
    /// What arrives after a reflection, and all that the mesh holds where direct light is not evaluated here.
    pub indirect: DVec3,
    /// What is seen of it.
    pub covering: Covering,
    /// What arrives from the emitter at hand, and whether its shadow's edge is near.
    pub(super) now: DVec3,
    pub(super) is_at_edge: bool,
    /// Luminance of the light that shadows between here and the next texel may hide or let through.
    pub doubtful: f64,
}

/// What is done where a shadow's edge crosses a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    /// Texels are fitted to several points.
    Fitted,
    /// Each texel has the light at its own point.
    Once,
}

impl Edges {
    /// Blocks of no more texels than this are not halved further.
    fn small_block(self) -> usize {
        match self {
            Self::Fitted => SMALL_BLOCK,
            Self::Once => SMALL_BLOCK_ONCE,
        }
    }
}

impl LitTexel {
    /// A dark texel for the site with this index.
    #[must_use]
    pub(super) fn new(index: usize, site: &TexelSite) -> Self {
        Self {
            site: index,
            cell: [site.x, site.y],
            region: site.region,
            point: site.point,
            direct: DVec3::ZERO,
            indirect: DVec3::ZERO,
            covering: Covering::Seen,
            now: DVec3::ZERO,
            is_at_edge: false,
            doubtful: 0.0,
        }
    }
}

/// What all surfaces' texels need.
pub(super) struct DirectLight<'a> {
    /// The scene's triangles.
    pub tracer: &'a Tracer,
    /// Their convex outlines.
    pub occluders: &'a Occluders,
    /// What shines.
    pub emitters: &'a [Emitter],
    /// Mean luminance of the irradiance in the scene's mesh.
    pub typical: f64,
    /// What is done at shadows' edges.
    pub edges: Edges,
}

impl DirectLight<'_> {
    /// Adds what all emitters send to `texels` of one surface with its `chart`.
    pub(super) fn shine(
        &self,
        surface: &Surface,
        chart: &Chart,
        texels: &mut [LitTexel],
    ) -> (TexelWays, Effort) {
        let (mut ways, mut effort) = (TexelWays::default(), Effort::default());
        let extent = extent(texels);
        for work in self.shinings(surface, chart) {
            let done = work.shine_on(texels, extent, Inherited { between: None, texels: usize::MAX });
            ways.add(&done.ways);
            effort.add(done.effort);
            take_after_neighbours(texels, |t| &mut t.now);
            if !done.samples.is_empty() {
                fit_edges(texels, done.samples);
            }
            for texel in texels.iter_mut() {
                texel.direct += std::mem::take(&mut texel.now);
                texel.is_at_edge = false;
            }
        }
        (ways, effort)
    }

    /// Adds what all emitters send to `texels` within a chart that covers a rectangle of a surface, each asked
    /// once. What stands in the way is found among what stands before a larger rectangle, where that is `known`.
    pub(super) fn shine_once(
        &self,
        surface: &Surface,
        chart: &Chart,
        texels: &mut [LitTexel],
        known: Option<&Shadowing>,
    ) -> Shadowing {
        let corners = |pick: fn(DVec2, DVec2) -> DVec2| chart.outline.iter().copied().reduce(pick);
        let whole = (corners(DVec2::min).unwrap_or_default(), corners(DVec2::max).unwrap_or_default());
        let extent = extent(texels);
        let of = |(index, work): (usize, Shining)| {
            let standing = work.standing(&work.block(whole), known.map(|k| &k.0[index]));
            if !texels.is_empty() {
                work.shine_past(texels, extent, &work.block(extent), &standing);
            }
            for texel in texels.iter_mut() {
                texel.direct += std::mem::take(&mut texel.now);
            }
            standing
        };
        Shadowing(self.shinings(surface, chart).enumerate().map(of).collect())
    }

    /// Each emitter shining on a surface's chart.
    fn shinings<'a>(&'a self, surface: &'a Surface, chart: &'a Chart) -> impl Iterator<Item = Shining<'a>> {
        let plane_from_texel = chart.texel_from_plane.inverse();
        let outline = &chart.outline;
        let cover = Cover { tracer: self.tracer, surface, outline, step: texel_steps(chart) };
        let of = move |emitter| Shining { light: self, surface, outline, plane_from_texel, cover, emitter };
        self.emitters.iter().map(of)
    }
}

/// What came of a block.
#[derive(Default)]
pub(super) struct Done {
    pub(super) ways: TexelWays,
    pub(super) effort: Effort,
    pub(super) samples: Vec<LightSample>,
}

impl Done {
    fn of(ways: TexelWays, effort: Effort) -> Self {
        Self { ways, effort, samples: Vec::new() }
    }

    fn and(mut self, other: Self) -> Self {
        self.ways.add(&other.ways);
        self.effort.add(other.effort);
        self.samples.extend(other.samples);
        self
    }
}

/// From one texel of a chart to the next, right and down, plane coordinates.
pub(super) fn texel_steps(chart: &Chart) -> [DVec2; 2] {
    let plane_from_texel = chart.texel_from_plane.inverse();
    [DVec2::X, DVec2::Y].map(|d| plane_from_texel.transform_vector2(d))
}

/// One emitter shining on one surface.
pub(super) struct Shining<'a> {
    pub(super) light: &'a DirectLight<'a>,
    pub(super) surface: &'a Surface,
    /// What of the surface the chart shows.
    pub(super) outline: &'a Ring,
    pub(super) plane_from_texel: DAffine2,
    pub(super) cover: Cover<'a>,
    pub(super) emitter: &'a Emitter,
}

/// What a block inherits from a larger one.
#[derive(Clone, Copy)]
struct Inherited<'a> {
    /// What reaches into that one's shaft; `None` for a surface's whole, which inherits nothing.
    between: Option<&'a [u32]>,
    /// Texels in that one; the most that there can be where there is none.
    texels: usize,
}

pub(super) fn extent(texels: &[LitTexel]) -> (DVec2, DVec2) {
    texels
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), t| (lo.min(t.point), hi.max(t.point)))
}

impl Shining<'_> {
    fn shine_on(&self, texels: &mut [LitTexel], extent: (DVec2, DVec2), inherited: Inherited) -> Done {
        if texels.is_empty() {
            return Done::default();
        }
        let block = self.block(extent);
        if self.is_behind(&block) {
            return self.shine_past(texels, extent, &block, &Standing::Behind);
        }
        // A block that is not much smaller than the one before has about the same shaft.
        if texels.len() > self.light.edges.small_block().max(inherited.texels / BLOCKS_A_SHAFT) {
            return self.halve(texels, extent, inherited);
        }
        let standing = self.standing_before(&block, inherited.between);
        self.shine_past(texels, extent, &block, &standing)
    }

    fn shine_past(
        &self,
        texels: &mut [LitTexel],
        extent: (DVec2, DVec2),
        whole: &Slab,
        standing: &Standing,
    ) -> Done {
        let count = texels.len() as u64;
        let between = match standing {
            Standing::Behind => {
                return Done::of(TexelWays { behind: count, ..TexelWays::default() }, Effort::default());
            }
            Standing::Umbra => {
                return Done::of(TexelWays { umbra: count, ..TexelWays::default() }, Effort::default());
            }
            Standing::Nothing => {
                let effort = self.shine_freely(texels);
                return Done::of(TexelWays { lit: count, ..TexelWays::default() }, effort);
            }
            Standing::Some(between) => between,
            Standing::Many => {
                return self.shine_on(texels, extent, Inherited { between: None, texels: usize::MAX });
            }
        };
        if texels.len() <= self.light.edges.small_block() {
            return self.shadow_edge(texels, &self.light.occluders.polygons(self.light.tracer, between));
        }
        if SMOOTH_BLOCKS.contains(&texels.len())
            && let Some(done) = self.smooth_penumbra(texels, extent, whole.corners(), between)
        {
            return done;
        }
        let own = Inherited { between: Some(between), texels: texels.len() };
        self.halve(texels, extent, own)
    }

    fn halve(&self, texels: &mut [LitTexel], extent: (DVec2, DVec2), inherited: Inherited) -> Done {
        let (min, max) = extent;
        let axis = usize::from(max.y - min.y > max.x - min.x);
        let middle = 0.5 * (min[axis] + max[axis]);
        let cut = partition(texels, |t| t.point[axis] < middle);
        let parallel = texels.len() > PARALLEL_BLOCK;
        let (low, high) = texels.split_at_mut(cut);
        if low.is_empty() || high.is_empty() {
            // All in one place along the longer axis: they cannot be told apart.
            let all = if low.is_empty() { high } else { low };
            let between = inherited.between.unwrap_or_default();
            return self.shadow_edge(all, &self.light.occluders.polygons(self.light.tracer, between));
        }
        let (low_extent, high_extent) = (self::extent(low), self::extent(high));
        let work_low = |low| self.shine_on(low, low_extent, inherited);
        let work_high = |high| self.shine_on(high, high_extent, inherited);
        let (done, other) = if parallel {
            rayon::join(|| work_low(low), || work_high(high))
        } else {
            (work_low(low), work_high(high))
        };
        done.and(other)
    }

    /// The block in space that texels with points in this extent cover.
    fn block(&self, (min, max): (DVec2, DVec2)) -> Slab {
        let reach = 0.5 * (self.cover.step[0].abs() + self.cover.step[1].abs());
        let least = DVec2::splat(self.light.tracer.margin());
        let (low, high) = self.surface.extent();
        let (min, max) = ((min - reach).max(low) - least, (max + reach).min(high) + least);
        let Surface { frame, smooth, .. } = self.surface;
        match smooth {
            None => Slab::flat(rectangle(min, max).map(|p| frame.lift(p)).to_vec()),
            Some(smooth) => smooth.slab(frame, &rectangle(min, max)),
        }
    }

    /// A block that nothing shades.
    fn shine_freely(&self, texels: &mut [LitTexel]) -> Effort {
        let mut evaluation = Evaluation::new(Precision::TEXEL);
        for texel in texels {
            texel.now = self.irradiance(texel.point, Between::Nothing, &mut evaluation);
        }
        evaluation.effort
    }

    /// A block that soft shadows fall on, or faint ones, if their light is smooth all over it.
    fn smooth_penumbra(
        &self,
        texels: &mut [LitTexel],
        extent: (DVec2, DVec2),
        corners: &[DVec3],
        between: &[u32],
    ) -> Option<Done> {
        let occluders = self.light.occluders.polygons(self.light.tracer, between);
        let is_faint =
            self.emitter.at_most(Bounds::of(corners.iter().copied()), self.light.tracer.diagonal())
                < FAINT * self.light.typical / self.light.emitters.len() as f64;
        if !is_faint && !is_soft(corners, self.emitter, &occluders, self.light.tracer.diagonal()) {
            return None;
        }
        let mut evaluation = Evaluation::new(Precision::EMITTER);
        let light = |p| self.irradiance(p, Between::Polygons(&occluders), &mut evaluation);
        let block = SmoothBlock::fit(extent, self.light.typical, light)?;
        texels.iter_mut().for_each(|t| t.now = block.at(t.point));
        let ways = TexelWays { smooth: texels.len() as u64, ..TexelWays::default() };
        Some(Done::of(ways, evaluation.effort))
    }

    pub(super) fn irradiance(&self, point: DVec2, between: Between, evaluation: &mut Evaluation) -> DVec3 {
        let Surface { frame, smooth, .. } = self.surface;
        let receiver = SurfacePoint::receiving(frame, smooth.as_deref(), point, self.light.tracer.margin());
        self.emitter.irradiance(receiver, self.light.tracer, between, evaluation)
    }
}

/// Moves what satisfies `first` to the front; how many do.
fn partition<T>(items: &mut [T], first: impl Fn(&T) -> bool) -> usize {
    let mut count = 0;
    for i in 0..items.len() {
        if first(&items[i]) {
            items.swap(i, count);
            count += 1;
        }
    }
    count
}
