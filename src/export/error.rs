//! Why a result could not be encoded or written.

use std::path::PathBuf;

/// Why a result could not be encoded or written. No variant leaves a file behind.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A texel is NaN or infinite.
    #[error(
        "texel ({x}, {y}) of the lightmap is not a finite number; this is a defect of the bake, please report the scene"
    )]
    NotFinite {
        /// Column, from the left.
        x: u32,
        /// Row, from the top.
        y: u32,
    },

    /// The lightmap's texels do not fill its page.
    #[error("the lightmap holds {texels} texels, but its page is {width} × {height}; give it one per place")]
    PageSize {
        /// Texels held.
        texels: usize,
        /// The page's width, texels.
        width: u32,
        /// The page's height, texels.
        height: u32,
    },

    /// The stages' results do not belong together.
    #[error("{what} do not belong to this scene; pass results of one and the same bake")]
    Mismatch {
        /// Which results.
        what: &'static str,
    },

    /// The EXR could not be made or read.
    #[error("cannot encode or decode the lightmap as EXR; please report the scene")]
    Exr {
        /// What the EXR library reported.
        source: exr::error::Error,
    },

    /// An EXR's page is larger than any that is written here.
    #[error("the EXR claims {width} × {height} texels; at most {limit} a side are read")]
    ExrSize {
        /// Claimed width.
        width: usize,
        /// Claimed height.
        height: usize,
        /// Longest side accepted.
        limit: usize,
    },

    /// The PNG could not be made.
    #[error("cannot encode the lightmap as PNG; please report the scene")]
    Png {
        /// What the PNG library reported.
        source: image::ImageError,
    },

    /// The Radiance file could not be made.
    #[error("cannot encode the lightmap as Radiance HDR; please report the scene")]
    Hdr {
        /// What the image library reported.
        source: image::ImageError,
    },

    /// The PNG with a multiplier could not be made.
    #[error("cannot encode the lightmap as RGBM; please report the scene")]
    Rgbm {
        /// What the PNG library reported.
        source: ::png::EncodingError,
    },

    /// Something in the source document is not as glTF demands.
    #[error("{list} {index} {problem}; export the scene anew or repair it with a glTF editor")]
    Malformed {
        /// The JSON list at fault, in the singular: `accessor`, `bufferView`, `mesh`.
        list: &'static str,
        /// Index into that list.
        index: usize,
        /// What is wrong, as a predicate.
        problem: &'static str,
    },

    /// Data that had to be read are compressed.
    #[error(
        "{list} {index} is compressed with {extension}; decompress the file first (gltf-transform copy IN OUT does)"
    )]
    Compressed {
        /// The JSON list at fault, in the singular.
        list: &'static str,
        /// Index into that list.
        index: usize,
        /// The extension's name.
        extension: &'static str,
    },

    /// The document could not be turned into text.
    #[error("cannot write the document's JSON; please report the scene")]
    Json {
        /// What the JSON library reported.
        source: serde_json::Error,
    },

    /// GLB counts its bytes in 32 bits.
    #[error(
        "the output would be {bytes} bytes long and GLB ends at 4 GiB; split the scene or ask for a smaller lightmap"
    )]
    TooLarge {
        /// Bytes needed.
        bytes: usize,
    },

    /// The folder to write into is not there.
    #[error("there is no folder {}; create it first", folder.display())]
    NoFolder {
        /// The missing folder.
        folder: PathBuf,
    },

    /// The output path names a folder or a device.
    #[error("{} is a folder or a device; give the name of a file, such as baked.glb", path.display())]
    NotAFile {
        /// The path given.
        path: PathBuf,
    },

    /// No file can be made in the folder.
    #[error("cannot create a file in {}; check that the folder may be written to and that the disk is not full", folder.display())]
    Create {
        /// The folder.
        folder: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },

    /// The bytes could not be written or read back.
    #[error("cannot write {}; check that the disk is not full", path.display())]
    Write {
        /// The output path.
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },

    /// The finished file could not take its name.
    #[error("cannot put the finished file at {}; check that the file there may be replaced", path.display())]
    Rename {
        /// The output path.
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },

    /// What came back from the disk is not what was written.
    #[error("{} was written but came back with other bytes; check the disk", path.display())]
    Corrupted {
        /// The output path.
        path: PathBuf,
    },

    /// The bytes are not a glTF file that a reader accepts.
    #[error("the output does not read back as glTF; please report the scene")]
    NotReadable {
        /// What the glTF reader reported.
        source: gltf::Error,
    },

    /// The bytes are not a baked glTF file.
    #[error("the output does not read back: {problem}; please report the scene")]
    NotBaked {
        /// What is missing or wrong.
        problem: &'static str,
    },
}
