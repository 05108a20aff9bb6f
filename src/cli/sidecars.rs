//! The lightmap in files of its own, beside the output.

use std::path::PathBuf;

use clap::Args;
use cobake::error::Error;
use cobake::export::{SidecarForm, WrittenFile, encode_sidecar};
use cobake::raster::Lightmap;

/// The options that ask for them.
#[derive(Args, Debug, Default)]
pub(crate) struct SidecarArgs {
    /// Write the lightmap as OpenEXR too, into a file of its own
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub(crate) exr: Option<PathBuf>,

    /// Write the lightmap as Radiance RGBE, into a file of its own
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub(crate) hdr: Option<PathBuf>,

    /// Write the lightmap as KTX 2.0 (E5B9G9R9 under Zstandard), into a file of its own
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub(crate) ktx2: Option<PathBuf>,

    /// Write the lightmap as PNG with a multiplier in alpha, into a file of its own
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub(crate) rgbm: Option<PathBuf>,
}

const FILES: &str = "Files beside the output";

/// The option that asks for a form.
pub(crate) fn option(form: SidecarForm) -> &'static str {
    match form {
        SidecarForm::Hdr => "--hdr",
        SidecarForm::Ktx2 => "--ktx2",
        SidecarForm::Rgbm => "--rgbm",
        _ => "--exr",
    }
}

impl SidecarArgs {
    /// What was asked for, and where it goes; an engine's file goes where its form was asked for, if it was.
    pub(crate) fn wanted(&self, engine: Option<(SidecarForm, PathBuf)>) -> Vec<(SidecarForm, PathBuf)> {
        let all = [
            (SidecarForm::Exr, &self.exr),
            (SidecarForm::Hdr, &self.hdr),
            (SidecarForm::Ktx2, &self.ktx2),
            (SidecarForm::Rgbm, &self.rgbm),
        ];
        let typed = all.into_iter().filter_map(|(form, path)| Some((form, path.clone()?)));
        let mut wanted: Vec<_> = typed.collect();
        wanted.extend(engine.filter(|(form, _)| wanted.iter().all(|(typed, _)| typed != form)));
        wanted
    }
}

/// The finished files.
pub(crate) fn encode(
    lightmap: &Lightmap,
    wanted: &[(SidecarForm, PathBuf)],
) -> anyhow::Result<Vec<WrittenFile>> {
    let file = |(form, path): &(SidecarForm, PathBuf)| {
        let bytes = encode_sidecar(lightmap, *form).map_err(Error::from)?;
        Ok(WrittenFile { path: path.clone(), bytes })
    };
    wanted.iter().map(file).collect()
}
