//! What an engine's lightmap slots take: a quantity, and the file that holds it.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use cobake::export::SidecarForm;
use cobake::options::Quantity;

/// Where the lightmap will be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Engine {
    /// Irradiance; the lightmap inside the output
    Three,
    /// Radiance; an EXR beside the output
    Babylon,
    /// Radiance; a KTX2 beside the output
    Bevy,
    /// Radiance; a Radiance HDR beside the output
    Playcanvas,
    /// Radiance; an EXR beside the output
    Godot,
    /// Radiance; an EXR beside the output
    Unity,
}

impl Engine {
    /// As it is typed.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Three => "three",
            Self::Babylon => "babylon",
            Self::Bevy => "bevy",
            Self::Playcanvas => "playcanvas",
            Self::Godot => "godot",
            Self::Unity => "unity",
        }
    }

    /// What a texel is to hold: three.js divides by π itself, the others do not.
    pub(crate) fn quantity(self) -> Quantity {
        if self == Self::Three { Quantity::Irradiance } else { Quantity::Radiance }
    }

    /// The file beside `output`, by its name but for the ending; none where the one inside is read.
    pub(crate) fn sidecar(self, output: &Path) -> Option<(SidecarForm, PathBuf)> {
        let (form, ending) = match self {
            Self::Three => return None,
            Self::Bevy => (SidecarForm::Ktx2, "ktx2"),
            Self::Playcanvas => (SidecarForm::Hdr, "hdr"),
            Self::Babylon | Self::Godot | Self::Unity => (SidecarForm::Exr, "exr"),
        };
        Some((form, output.with_extension(ending)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_those_of_the_command_line() {
        for engine in Engine::value_variants() {
            assert_eq!(Engine::from_str(engine.word(), false), Ok(*engine));
        }
    }

    #[test]
    fn files_are_named_after_the_output() {
        let beside = |engine: Engine| engine.sidecar(Path::new("a.b/level.lit.glb"));
        assert_eq!(beside(Engine::Bevy), Some((SidecarForm::Ktx2, "a.b/level.lit.ktx2".into())));
        assert_eq!(beside(Engine::Three), None);
    }
}
