//! The lightmap in files of its own, beside the output.

use std::path::{Path, PathBuf};

use clap::Args;
use cobake::error::Error;
use cobake::export::{SidecarForm, WrittenFile, encode_sidecar};
use cobake::raster::Lightmap;
use cobake::unwrap::PageArea;

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

/// Where a page goes: the first to `path`, others to names with their number, `light-1.exr` beside `light.exr`.
pub(crate) fn path_of_page(path: &Path, page: usize) -> PathBuf {
    if page == 0 {
        return path.to_owned();
    }
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{page}"));
    if let Some(ending) = path.extension() {
        name.push(".");
        name.push(ending);
    }
    path.with_file_name(name)
}

/// The finished files, one a form and page.
pub(crate) fn encode(
    lightmap: &Lightmap,
    pages: &[PageArea],
    wanted: &[(SidecarForm, PathBuf)],
) -> anyhow::Result<Vec<WrittenFile>> {
    let mut files = Vec::new();
    for (form, path) in wanted {
        for (page, area) in pages.iter().enumerate() {
            let bytes = encode_sidecar(&lightmap.page(*area), *form).map_err(Error::from)?;
            files.push(WrittenFile { path: path_of_page(path, page), bytes });
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_have_names_of_their_own() {
        let of = |path: &str, page| path_of_page(Path::new(path), page);
        assert_eq!(of("a/b.lit.exr", 0), Path::new("a/b.lit.exr"));
        assert_eq!(of("a/b.lit.exr", 2), Path::new("a/b.lit-2.exr"));
        assert_eq!(of("light", 1), Path::new("light-1"));
    }
}
