//! Why two things could not be compared.

use std::io;
use std::path::PathBuf;

use super::npy::NpyFault;
use crate::export::ExportError;
use crate::picture::PictureError;
use crate::scene::ImportError;

/// Why two things could not be compared. The cause is reached through `source`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A bake cannot be read as a scene.
    #[error("cannot read the bake {}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: ImportError,
    },

    /// A scene without a lightmap of ours.
    #[error("{} holds no lightmap of cobake's; name a file that `cobake bake` wrote", path.display())]
    NotBaked {
        /// The file.
        path: PathBuf,
    },

    /// A lightmap that is named but cannot be used.
    #[error("lightmap {index} of {} {problem}; bake the scene again", path.display())]
    Lightmap {
        /// The file.
        path: PathBuf,
        /// Index into its lightmaps.
        index: usize,
        /// What is wrong, read after the lightmap's name.
        problem: String,
    },

    /// A lightmap's EXR does not decode.
    #[error("lightmap {index} of {} is damaged; bake the scene again", path.display())]
    Exr {
        /// The file.
        path: PathBuf,
        /// Index into its lightmaps.
        index: usize,
        /// What the decoder says.
        source: ExportError,
    },

    /// The lightmap of a bake lights no triangle that is seen from its front.
    #[error("no surface of {} that is seen from its front has a lightmap; check its faces' winding and bake it again", path.display())]
    Unlit {
        /// The file.
        path: PathBuf,
    },

    /// The points' file could not be read.
    #[error("cannot read the reference points {}", path.display())]
    ReadPoints {
        /// The file.
        path: PathBuf,
        /// What the operating system reported.
        source: io::Error,
    },

    /// The points' file is no archive.
    #[error(
        "{} is not a NumPy .npz archive; write one with numpy.savez_compressed, or name another file",
        path.display()
    )]
    NotNpz {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: zip::result::ZipError,
    },

    /// An array that is needed is not in the archive.
    #[error(
        "{} has no array {name} ({}); reference points need P, N, E, E_se, set and buried",
        path.display(),
        arrays_there_are(found)
    )]
    NoArray {
        /// The archive.
        path: PathBuf,
        /// The array that was looked for.
        name: &'static str,
        /// The arrays there are.
        found: Vec<String>,
    },

    /// An array cannot be read.
    #[error("array {name} of {} {fault}", path.display())]
    Array {
        /// The archive.
        path: PathBuf,
        /// The array.
        name: &'static str,
        /// Why.
        fault: NpyFault,
    },

    /// Most of one thing was not found in the other.
    #[error(
        "only {matched} of the {points} points looked up lie on surfaces of {}; compare files of the same scene",
        path.display()
    )]
    FewMatched {
        /// The bake that the points were looked up in.
        path: PathBuf,
        /// How many lie on its surfaces.
        matched: usize,
        /// How many were looked up.
        points: usize,
    },

    /// The heat map could not be drawn.
    #[error("cannot draw the heat map")]
    Picture(#[from] PictureError),
}

fn arrays_there_are(found: &[String]) -> String {
    match found {
        [] => "it holds none".to_owned(),
        _ => format!("it holds {}", found.join(", ")),
    }
}
