//! `cobake bake`: a scene in, a lightmapped scene out.

use std::path::PathBuf;

use anyhow::Context;
use cobake::BakeResult;
use cobake::error::Error;
use cobake::export::{
    SidecarForm, WrittenFile, buffer_beside, file_of, referenced_files, separate, write_all, write_whole,
};
use cobake::options::BakeOptions;
use cobake::picture;
use cobake::progress::Stage;
use cobake::report::{StageClock, peak_memory_bytes};

use super::args::BakeArgs;
use super::failure::WrongUse;
use super::files::Files;
use super::interrupt::Interrupt;
use super::terminal::{TerminalProgress, Voice};
use super::{sidecars, summary, terminal};

/// Runs the command. Nothing is written unless the bake went through.
pub(crate) fn run(args: &BakeArgs) -> anyhow::Result<()> {
    let options = BakeOptions::from(args);
    options.validate().map_err(Error::from)?;
    let wanted = args.sidecars.wanted(args.engine.and_then(|engine| engine.sidecar(&args.output)));
    // Every page may have a file of its own; how many there will be is not known yet.
    let pages = |(form, path): &(SidecarForm, PathBuf)| {
        let (option, path) = (sidecars::option(*form), path.clone());
        (0..args.pages as usize).map(move |page| (option, sidecars::path_of_page(&path, page)))
    };
    let mut sidecars: Vec<_> = wanted.iter().flat_map(pages).collect();
    if args.separate {
        if !args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf")) {
            let message = "--separate is for glTF text; let the name of -o end in .gltf, or leave it out";
            return Err(WrongUse(message.to_owned()).into());
        }
        sidecars.push(("-o", buffer_beside(&args.output)));
    }
    let files = Files {
        input: &args.input,
        output: &args.output,
        report: args.report.as_deref(),
        pictures: args.pictures.as_deref(),
        sidecars: &sidecars,
    };
    files.check()?;

    let voice = if args.quiet { Voice::Quiet } else { Voice::Normal };
    if let (Some(doubt), Voice::Normal) = (args.doubt(), voice) {
        terminal::say(&format!("warning: {doubt}"));
    }
    let interrupt = Interrupt::watch()?;
    let mut progress = TerminalProgress::new(voice, interrupt.clone());
    let mut result = cobake::bake(files.input, &options, &mut progress)
        .with_context(|| format!("cannot bake {}", files.input.display()))?;
    if !interrupt.begin_writing() {
        return Err(Error::Cancelled.into());
    }
    write(args, (&files, &wanted), &mut result)?;
    progress.finish();

    if voice == Voice::Normal && terminal::is_watched() {
        terminal::say(&summary::paragraph(files.output, &result.report));
    }
    Ok(())
}

/// Writes the scene and the lightmap's own files, all or none, then the pictures, then the report, which counts
/// what the first took.
fn write(
    args: &BakeArgs,
    (files, wanted): (&Files<'_>, &[(SidecarForm, PathBuf)]),
    result: &mut BakeResult,
) -> anyhow::Result<()> {
    let mut clock = StageClock::start();
    clock.begin(Stage::Export);
    let mut set = scene_files(args, files, &result.glb)?;
    set.extend(sidecars::encode(&result.lightmap, &result.atlas.pages, wanted)?);
    write_all(&set).map_err(Error::from)?;
    result.report.time.add(Stage::Export, clock.finish().total);
    result.report.peak_memory_bytes = peak_memory_bytes();

    if let Some(folder) = files.pictures {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let subject = picture::Subject {
            lightmap: &result.lightmap,
            surfaces: &result.surfaces,
            facets: &result.facets,
            mesh: &result.mesh,
            atlas: &result.atlas,
        };
        let pictures = picture::pictures(subject).context("cannot draw the pictures")?;
        for (name, png) in pictures {
            write_whole(&folder.join(name), &png).map_err(Error::from)?;
        }
    }
    if let Some(path) = files.report {
        let json = result.report.to_json().context("cannot put the report into JSON")?;
        write_whole(path, json.as_bytes()).map_err(Error::from)?;
    }
    Ok(())
}

/// The output, in one file or in several.
fn scene_files(args: &BakeArgs, files: &Files<'_>, glb: &[u8]) -> anyhow::Result<Vec<WrittenFile>> {
    if !args.separate {
        return Ok(vec![file_of(files.output, glb).map_err(Error::from)?]);
    }
    let mut taken = referenced_files(files.input);
    taken.push(files.input.into());
    taken.extend(files.report.map(PathBuf::from));
    taken.extend(files.sidecars.iter().map(|(_, path)| path.clone()));
    Ok(separate(files.output, glb, &taken).map_err(Error::from)?)
}
