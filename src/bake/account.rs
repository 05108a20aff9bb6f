//! What a bake reports about itself.

use glam::DVec3;

use crate::authored::Authored;
use crate::cob::{Cob, CobState};
use crate::element::Facet;
use crate::options::BakeOptions;
use crate::progress::Progress;
use crate::raster::TexelCounts;
use crate::report::{DensityReport, LayoutReport, PageReport, Report};
use crate::scene::Scene;
use crate::solve::Solution;
use crate::surface::{Surface, SurfaceSet};
use crate::unwrap::{Atlas, Chart, PageArea, area_within};

use super::written::Written;

/// Says which contacts were lost.
pub(super) fn warn_of_surfaces(set: &SurfaceSet, progress: &mut dyn Progress) {
    if set.dropped_contacts > 0 {
        progress.warn(&format!(
            "{} contact lines between surfaces could not be used; light may leak along them",
            set.dropped_contacts
        ));
    }
}

/// Names the materials whose reflectance was clamped.
pub(super) fn warn_of_reflectance(scene: &Scene, options: &BakeOptions, progress: &mut dyn Progress) {
    let mut used = vec![false; scene.materials.len()];
    scene.placements.iter().for_each(|p| used[p.material] = true);
    let clamped: Vec<&str> = scene
        .materials
        .iter()
        .zip(used)
        .filter(|(m, used)| *used && m.reflectance.max_element() > options.max_reflectance)
        .map(|(m, _)| m.name.as_str())
        .collect();
    if !clamped.is_empty() {
        progress.warn(&format!(
            "reflectance clamped to {} for {}; light would hardly die out otherwise (--max-reflectance)",
            options.max_reflectance,
            listed(&clamped)
        ));
    }
}

/// The first few names, and how many more there are.
fn listed(names: &[&str]) -> String {
    const MOST: usize = 4;
    let mut text = names.iter().take(MOST).map(|n| format!("{n:?}")).collect::<Vec<_>>().join(", ");
    if names.len() > MOST {
        text += &format!(" and {} more", names.len() - MOST);
    }
    text
}

/// Says that vertices or edges were lost.
pub(super) fn warn_of_dropped(dropped: usize, progress: &mut dyn Progress) {
    if dropped > 0 {
        progress.warn(&format!(
            "{dropped} points or edges of the mesh could not be triangulated and were left out"
        ));
    }
}

/// Says that a kept layout lets light bleed.
pub(super) fn warn_of_shared_texels(shared: u64, texels: TexelCounts, progress: &mut dyn Progress) {
    if shared > 0 {
        progress.warn(&format!(
            "{shared} of {} texels are read from parts of a kept TEXCOORD_1 that are no neighbours, so that light bleeds \
             from one to another; ask for a larger --size, or leave --keep-uv1 out",
            texels.covered
        ));
    }
}

/// Whose layout was kept.
pub(super) fn layouts(authored: &Authored, shared_texels: u64) -> LayoutReport {
    let (kept, others) = authored.nodes();
    LayoutReport { kept: kept as u64, not_kept: others as u64, shared_texels }
}

pub(super) fn leaf_count(facets: &[Facet]) -> u64 {
    facets.iter().map(|f| f.leaves().count() as u64).sum()
}

/// Fills in what the solver did.
pub(super) fn fill_report(report: &mut Report, scene: &Scene, surfaces: &[Surface], solution: &Solution) {
    report.scene.triangles = scene.triangles.len() as u64;
    report.scene.surfaces = surfaces.len() as u64;
    report.scene.lights = scene.lights.len() as u64;
    report.scene.emitters =
        surfaces.iter().filter(|s| scene.materials[s.material].emission.cmpgt(DVec3::ZERO).any()).count()
            as u64;
    report.elements.at_end = leaf_count(&solution.facets);
    report.elements.splits.cob = solution.direct.cob_splits;
    report.elements.splits.gradient = solution.direct.gradient_splits + solution.gathering.splits;
    report.elements.splits.uniform = solution.direct.uniform_splits;
    for facet in &solution.facets {
        for element in &facet.elements {
            match element.cob.state() {
                CobState::Uninitialized => report.cob.uninitialized += 1,
                CobState::Empty => report.cob.empty += 1,
                CobState::NotEmpty => report.cob.not_empty += 1,
            }
        }
        report.cob.bytes_total += (facet.elements.len() * size_of::<Cob>() + facet.cobs.bytes()) as u64;
    }
    report.cob.bytes_per_empty = size_of::<Cob>() as f64;
    report.cob.seconds = solution.direct.cob_time.as_secs_f64();
    report.cob.splits = solution.direct.cob_splits;
    report.cob.splits_saved_by_shaft = solution.direct.saved_by_shaft;
    report.cob.splits_saved_by_umbra = solution.direct.saved_by_umbra;
    report.shots = solution.shots;
    report.rays = solution.rays;
    report.energy.emitted = solution.energy.emitted;
    report.energy.absorbed = solution.energy.absorbed;
    report.energy.escaped = solution.energy.escaped;
    report.energy.unshot = solution.energy.unshot;
}

/// Fills in what became of the texels.
pub(super) fn fill_texels(report: &mut Report, (surfaces, atlas): (&[Surface], &Atlas), texels: TexelCounts) {
    report.rays += texels.effort.rays;
    report.texels.covered = texels.covered;
    report.texels.evaluated = texels.evaluated;
    report.texels.dilated = texels.dilated;
    report.texels.ways = texels.ways;
    report.lightmap.seams = texels.seams;
    report.texels.exact = texels.effort.exact;
    report.texels.by_rays = texels.effort.by_rays;
    report.lightmap.width = atlas.pages.iter().map(|page| page.width).max().unwrap_or(0);
    report.lightmap.height = atlas.pages.iter().map(|page| page.height).max().unwrap_or(0);
    report.lightmap.texels_per_metre = atlas.texels_per_metre;
    report.lightmap.charts = atlas.charts.len() as u64;
    let all = atlas.pages.iter().map(PageArea::texels).sum::<u64>() as f64;
    report.lightmap.utilisation = texels.covered as f64 / all.max(1.0);
    report.lightmap.padding = texels.dilated as f64 / all.max(1.0);
    report.lightmap.gutter = atlas.gutter;
    report.lightmap.density = density(surfaces, atlas);
}

/// What each page holds.
pub(super) fn pages(atlas: &Atlas, written: &Written) -> Vec<PageReport> {
    let page = |(index, area): (usize, &PageArea)| {
        let bytes = written.pages.get(index).copied().unwrap_or_default();
        PageReport {
            width: area.width,
            height: area.height,
            charts: atlas.charts.iter().filter(|chart| chart.page == index).count() as u64,
            bytes: bytes.exr,
            png_bytes: bytes.png,
        }
    };
    atlas.pages.iter().enumerate().map(page).collect()
}

/// How fine the charts are that show something.
fn density(surfaces: &[Surface], atlas: &Atlas) -> DensityReport {
    let of = |chart: &Chart| {
        let density = chart.texel_from_plane.matrix2.determinant().abs().sqrt();
        (density, area_within(&surfaces[chart.surface], &chart.outline))
    };
    let mut charts: Vec<(f64, f64)> = atlas.charts.iter().map(of).filter(|&(_, area)| area > 0.0).collect();
    charts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = charts.iter().map(|(_, area)| area).sum();
    let mut below = 0.0;
    let median = charts.iter().find(|(_, area)| {
        below += area;
        below >= 0.5 * all
    });
    let value = |chart: Option<&(f64, f64)>| chart.map_or(0.0, |&(density, _)| density);
    DensityReport { least: value(charts.first()), median: value(median), greatest: value(charts.last()) }
}
