//! The whole way: from a file to a lightmapped scene and its report.

use std::path::Path;

use glam::DVec3;

use crate::authored::Authored;
use crate::element::{Facet, MeshOptions, SceneAppearance, build};
use crate::error::Error;
use crate::export::{Baked, encode};
use crate::options::{BakeOptions, DensityPolicy, Normals, Resolution, Toggle};
use crate::progress::{Progress, Stage};
use crate::raster::{Lighting, Lightmap, RasterInput};
use crate::report::{Recorder, Report};
use crate::retriangulate::RadiosityMesh;
use crate::retriangulate::mesh::radiosity_mesh;
use crate::scene::{ImportOptions, Scene};
use crate::solve::{Problem, Solution, solve};
use crate::surface::{Geometry, Surface, build_surfaces};
use crate::trace::Tracer;
use crate::unwrap::{Atlas, blocks, check_side, shared_texels};
use page::{Page, PageMaker, Wishes};
use scale::Scale;
use written::Written;

mod account;
mod budget;
mod cells;
mod page;
mod scale;
mod screens;
mod weights;
mod written;

/// Samples keep this fraction of the scene's diagonal from outlines.
const NUDGE: f64 = 1e-5;

/// They keep this many texels, too: light at a wall's foot that changes within less is none that a lightmap shows.
const NUDGE_TEXELS: f64 = 0.1;

/// What a bake gives.
#[derive(Clone, Debug)]
pub struct BakeResult {
    /// The output as a binary glTF, ready to be written.
    pub glb: Vec<u8>,
    /// The pages that `glb` holds, at full precision, one below another in one sheet; see [`Atlas::pages`].
    pub lightmap: Lightmap,
    /// The planar surfaces of the scene.
    pub surfaces: Vec<Surface>,
    /// The elements over them, with what each received.
    pub facets: Vec<Facet>,
    /// The solution on conforming triangles, one entry per surface.
    pub mesh: RadiosityMesh,
    /// Where each surface lies in the pages, in the same order.
    pub atlas: Atlas,
    /// What was done and what it cost.
    pub report: Report,
}

/// Bakes the scene in the glTF or GLB file at `path`. Writes nothing.
///
/// The result depends on the file, the options and the build; not on the number of threads.
///
/// # Errors
/// An option out of its range, a scene that cannot be read or lit, or the caller's wish to stop.
pub fn bake(path: &Path, options: &BakeOptions, progress: &mut dyn Progress) -> Result<BakeResult, Error> {
    options.validate()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build()
        .map_err(|source| Error::Threads { threads: options.threads, source })?;
    pool.install(|| {
        let mut recorder = Recorder::new(progress);
        recorder.begin(Stage::Import);
        let BakeOptions { scene, dynamic, normals, .. } = *options;
        let scene = crate::scene::load(path, &ImportOptions { scene, dynamic, normals })?;
        run(&scene, options, recorder)
    })
}

/// Bakes a scene that was [loaded](crate::scene::load) before, for [`Normals::Shading`] with its
/// [normals](ImportOptions::normals). See [`bake`].
///
/// # Errors
/// As [`bake`]. Runs in the caller's rayon thread pool; `options.threads` has no effect.
pub fn bake_scene(
    scene: &Scene,
    options: &BakeOptions,
    progress: &mut dyn Progress,
) -> Result<BakeResult, Error> {
    options.validate()?;
    run(scene, options, Recorder::new(progress))
}

fn run(scene: &Scene, options: &BakeOptions, mut recorder: Recorder) -> Result<BakeResult, Error> {
    scene.warnings.iter().for_each(|w| recorder.warn(w));
    enter(&mut recorder, Stage::Surfaces)?;
    let tracer = tracer(scene);
    let authored = authored(scene, options, &mut recorder)?;
    let mut geometry = Geometry { coordinates: authored.coordinates(), ..Geometry::from(scene) };
    if options.normals == Normals::Geometric {
        geometry.normals = &[];
    }
    let set = build_surfaces(&geometry, &tracer);
    account::warn_of_surfaces(&set, &mut recorder);
    account::warn_of_reflectance(scene, options, &mut recorder);
    let surfaces = set.surfaces;
    let weights = weights::of_surfaces(scene, &surfaces, options)?;
    let wishes = Wishes::new(scene, &surfaces, weights, blocks(&authored, &surfaces, scene));
    // A layout from elsewhere is as dense as it is.
    let density = if wishes.blocks.is_empty() { options.density } else { DensityPolicy::Uniform };
    let options = &BakeOptions { density, ..options.clone() };
    if let Resolution::Size(side) = options.resolution {
        check_side(wishes.charts(), (side, options.pages), options.padding)?;
    }
    let appearance = SceneAppearance::new(scene, &surfaces, options.max_reflectance);
    let scale = Scale::of(&surfaces, options);
    let mesh_options = MeshOptions {
        patch_size: scale.patch_size,
        nudge: (NUDGE * tracer.diagonal()).max(NUDGE_TEXELS * scale.texel),
        lift: tracer.margin(),
    };
    let facets = build(&surfaces, &appearance, mesh_options);
    let initial = account::leaf_count(&facets);

    enter(&mut recorder, Stage::Solve)?;
    let problem = Problem {
        tracer: &tracer,
        surfaces: &surfaces,
        appearance: &appearance,
        lights: &scene.lights,
        options,
        patch_size: scale.patch_size,
        threshold: scale.threshold,
        indirect_threshold: scale.indirect_threshold,
        texel: scale.texel,
    };
    let solution = solve(&problem, facets, &mut |done| {
        recorder.advance(done);
        !recorder.is_cancelled()
    })
    .ok_or(Error::Cancelled)?;

    let options = &BakeOptions { gather_error: Some(solution.gather_error), ..options.clone() };

    enter(&mut recorder, Stage::Retriangulate)?;
    let (mesh, dropped) = radiosity_mesh(&surfaces, &solution.facets);
    account::warn_of_dropped(dropped, &mut recorder);

    enter(&mut recorder, Stage::Unwrap)?;
    let raster_input = RasterInput {
        surfaces: &surfaces,
        mesh: &mesh,
        tracer: &tracer,
        occluders: &solution.occluders,
        emitters: &solution.emitters,
        typical: solution.typical,
        appearance: &appearance,
        options,
    };
    let lighting = Lighting::new(&raster_input);
    let maker = PageMaker::new(&lighting, options, scale.texel, wishes);
    let Page { atlas, lightmap, preview, texels } = maker.page(&mut recorder)?;
    let shared = shared_texels((&surfaces, maker.blocks()), (&authored, scene), &atlas);
    account::warn_of_shared_texels(shared, texels, &mut recorder);

    enter(&mut recorder, Stage::Export)?;
    let glb = encode(&Baked {
        scene,
        surfaces: &surfaces,
        atlas: &atlas,
        lightmap: &lightmap,
        preview: preview.as_ref(),
        mesh: &mesh,
        facets: &solution.facets,
        authored: &authored,
        options,
    })?;
    let mut report = Report { options: options.clone(), ..Report::default() };
    report.elements.initial = initial;
    account::fill_report(&mut report, scene, &surfaces, &solution);
    account::fill_texels(&mut report, (&surfaces, &atlas), texels);
    report.lightmap.layouts = account::layouts(&authored, shared);
    let written = Written::in_document(&glb);
    (report.lightmap.bytes, report.lightmap.png_bytes) = (written.exr(), written.png());
    report.lightmap.pages = account::pages(&atlas, &written);
    recorder.finish(&mut report);
    drop(appearance);
    let Solution { facets, .. } = solution;
    Ok(BakeResult { glb, lightmap, surfaces, facets, mesh, atlas, report })
}

/// The layouts that are kept, and a warning for each reason why one is not.
fn authored(scene: &Scene, options: &BakeOptions, recorder: &mut Recorder) -> Result<Authored, Error> {
    if options.keep_uv1 == Toggle::Off {
        return Ok(Authored::default());
    }
    let authored = Authored::of(scene)?;
    authored.warnings().iter().for_each(|warning| recorder.warn(warning));
    Ok(authored)
}

fn enter(recorder: &mut Recorder, stage: Stage) -> Result<(), Error> {
    if recorder.is_cancelled() {
        return Err(Error::Cancelled);
    }
    recorder.begin(stage);
    Ok(())
}

fn tracer(scene: &Scene) -> Tracer {
    let triangles: Vec<[DVec3; 3]> =
        scene.triangles.iter().map(|t| t.vertices.map(|v| scene.vertices[v as usize])).collect();
    let double_sided = scene
        .triangles
        .iter()
        .map(|t| scene.materials[scene.placements[t.placement as usize].material].double_sided)
        .collect();
    Tracer::new(triangles).with_double_sided(double_sided).with_screens(screens::of_triangles(scene))
}
