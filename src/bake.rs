//! The whole way: from a file to a lightmapped scene and its report.

use std::path::Path;

use crate::error::Error;
use crate::options::BakeOptions;
use crate::progress::{Progress, Stage};
use crate::raster::Lightmap;
use crate::report::{Recorder, Report};
use crate::retriangulate::RadiosityMesh;
use crate::unwrap::Atlas;

/// What a bake gives.
#[derive(Clone, Debug)]
pub struct BakeResult {
    /// The output as a binary glTF, ready to be written.
    pub glb: Vec<u8>,
    /// The page that `glb` holds, at full precision.
    pub lightmap: Lightmap,
    /// The radiosity solution, one entry per surface.
    pub mesh: RadiosityMesh,
    /// Where each surface lies in the page, in the same order.
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
    let mut recorder = Recorder::new(progress);
    let mut report = Report { options: options.clone(), ..Report::default() };

    recorder.begin(Stage::Import);
    recorder.warn("the stages are not joined yet: the scene is passed through unlit");
    let glb = std::fs::read(path).unwrap_or_default();
    if recorder.is_cancelled() {
        return Err(Error::Cancelled);
    }

    recorder.finish(&mut report);
    Ok(BakeResult {
        glb,
        lightmap: Lightmap { width: 1, height: 1, texels: vec![[0.0; 3]] },
        mesh: RadiosityMesh::default(),
        atlas: Atlas { width: 1, height: 1, texels_per_metre: 0.0, padding: 0, charts: Vec::new() },
        report,
    })
}
