//! What was typed, and its conversion to what it means.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use cobake::options::{
    BakeOptions, CobHeight, DensityPolicy, Direct, Dynamic, Normals, Preview, Quantity, Refine, Resolution,
    Toggle, Topology,
};

use super::bytes;
use super::compare_args::CompareArgs;
use super::engine::Engine;
use super::inspect::InspectArgs;
use super::sidecars::SidecarArgs;
use super::view::ViewArgs;

/// Bakes lightmaps into glTF scenes: radiosity on a mesh that refines itself near close occluders.
#[derive(Debug, Parser)]
#[command(name = "cobake", version, arg_required_else_help = true, after_help = AFTER_HELP)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const AFTER_HELP: &str = "\
Exit codes: 0 done, 1 failed, 2 wrong use, 3 a comparison above --fail-above, 130 cancelled by Ctrl-C.
COBAKE_LOG=error|warn|info|debug|trace writes the stages' log to stderr.";

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Bake a scene's lightmap into a new file
    Bake(Box<BakeArgs>),
    /// Tell how far a bake is from reference points, or from another bake
    Compare(CompareArgs),
    /// Tell what a baked file holds
    Inspect(InspectArgs),
    /// Look at a bake, or at two side by side, in a browser: a page that holds everything
    View(ViewArgs),
}

/// The words after `bake`. Each option is described in [`BakeOptions`] in the same words.
#[derive(Args, Debug)]
pub(crate) struct BakeArgs {
    /// Scene to light: a .gltf or .glb file
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,

    /// Where the lightmapped scene goes: a .glb file, or a .gltf one
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,

    /// Write buffer and images of a .gltf output into files beside it, named after it
    #[arg(long)]
    pub(crate) separate: bool,

    /// Write what was done and what it cost, as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,

    /// Write the lightmap, the density of its texels and the largest surfaces' meshes as PNGs into this folder, made
    /// if there is none
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,

    /// Write what this engine reads: sets what a texel holds, and adds a file named after the output
    #[arg(long = "for", value_enum, value_name = "ENGINE", conflicts_with = "preview")]
    pub(crate) engine: Option<Engine>,

    #[command(flatten)]
    pub(crate) sidecars: SidecarArgs,

    /// Keep stderr empty: no progress, no warnings, no summary; errors still show
    #[arg(short, long)]
    pub(crate) quiet: bool,

    /// Which of the document's scenes to bake [default: its default scene]
    #[arg(long, value_name = "INDEX")]
    scene: Option<usize>,

    /// What becomes of meshes that move by animation, skin or morph targets; none gets a lightmap
    #[arg(long, value_enum, default_value_t = DynamicWord::Ignore)]
    dynamic: DynamicWord,

    /// What surfaces that are drawn with interpolated normals are lit about: their triangles' normals or these
    #[arg(long, value_enum, default_value_t = NormalsWord::Geometric)]
    normals: NormalsWord,

    /// Worker threads, 0 to 1024; 0 takes one per core. The result does not depend on it
    #[arg(long, value_name = "N", default_value_t = BakeOptions::default().threads)]
    threads: usize,

    /// The lightmap's side in texels, 16 to 16384; the density follows
    #[arg(long, value_name = "TEXELS", default_value_t = 512, help_heading = LIGHTMAP)]
    size: u32,

    /// Texels per metre of surface, above 0; the lightmap's side follows
    #[arg(long, value_name = "DENSITY", conflicts_with = "size", allow_negative_numbers = true, help_heading = LIGHTMAP)]
    texels_per_metre: Option<f64>,

    /// The most that the lightmaps may take in the output, EXR and PNG together, such as 4MiB, 500KB or a number
    /// of bytes; density and the page's shape follow
    #[arg(long, value_name = "BYTES", value_parser = bytes::parse, conflicts_with_all = ["size", "texels_per_metre"], help_heading = LIGHTMAP)]
    budget: Option<u64>,

    /// The most pages, 1 to 64: with --size as many of that size are filled as charts want, else there are several
    /// only where one of 16384 texels a side does not do
    #[arg(long, value_name = "N", default_value_t = BakeOptions::default().pages, help_heading = LIGHTMAP)]
    pub(crate) pages: u32,

    /// Where texels are dense [default: light; with a preview uniform]
    #[arg(long, value_enum, help_heading = LIGHTMAP)]
    density: Option<DensityWord>,

    /// Free texels around what a lookup in a chart touches, 1 to 16; twice as many lie between two charts [default: one
    /// between two charts, or none where they do not fit otherwise]
    #[arg(long, value_name = "TEXELS", help_heading = LIGHTMAP)]
    padding: Option<u32>,

    /// Mip levels that show each chart without its neighbours' light, 0 to 4: charts are aligned, and gutters wider
    #[arg(long, value_name = "LEVELS", default_value_t = BakeOptions::default().mips, help_heading = LIGHTMAP)]
    mips: u32,

    /// Keep and use a TEXCOORD_1 that is a lightmap layout: in the range from 0 to 1, without overlaps; says which are
    /// none, and why
    #[arg(long = "keep-uv1", help_heading = LIGHTMAP)]
    keep_uv1: bool,

    /// What a texel holds [default: irradiance, or what --for takes]
    #[arg(long, value_enum, help_heading = LIGHTMAP)]
    quantity: Option<QuantityWord>,

    /// Show the light in viewers that know no lightmaps: lit materials become pictures of it
    #[arg(long, value_enum, help_heading = LIGHTMAP)]
    preview: Option<PreviewWord>,

    /// Where a texel's direct light comes from
    #[arg(long, value_enum, default_value_t = DirectWord::Texel, help_heading = LIGHTMAP)]
    direct: DirectWord,

    /// The output's geometry
    #[arg(long, value_enum, default_value_t = TopologyWord::Source, help_heading = LIGHTMAP)]
    topology: TopologyWord,

    /// Write the elements and their Close Objects Buffers' states into the output too, for `cobake view`
    #[arg(long, help_heading = REFINEMENT)]
    elements: bool,

    /// Which elements are split when a shooter's light arrives
    #[arg(long, value_enum, default_value_t = RefineWord::CobGradient, help_heading = REFINEMENT)]
    refine: RefineWord,

    /// Height of the Close Objects Buffer's prism, as a fraction of the element's size, above 0
    #[arg(long, value_name = "FRACTION", default_value_t = 1.0, allow_negative_numbers = true, help_heading = REFINEMENT)]
    cob_height: f64,

    /// Height of the Close Objects Buffer's prism, metres, above 0
    #[arg(long, value_name = "METRES", conflicts_with = "cob_height", allow_negative_numbers = true, help_heading = REFINEMENT)]
    cob_height_fixed: Option<f64>,

    /// Elements no larger than this are not split, metres, above 0 [default: what the lightmap can show]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, help_heading = REFINEMENT)]
    subdivision_threshold: Option<f64>,

    /// A shot whose estimate M is below this fraction of the receiver's present radiosity does not
    /// split it; above 0, at most 1
    #[arg(long, value_name = "FRACTION", default_value_t = BakeOptions::default().illumination_threshold, allow_negative_numbers = true, help_heading = REFINEMENT)]
    illumination_threshold: f64,

    /// Split for close objects outside the shaft to the shooter too
    #[arg(long, help_heading = REFINEMENT)]
    no_shaft_test: bool,

    /// Split elements that lie wholly in one occluder's umbra too
    #[arg(long, help_heading = REFINEMENT)]
    no_umbra_test: bool,

    /// Stop when the unshot power falls below this fraction of the emitted power; above 0, below 1
    #[arg(long, value_name = "FRACTION", default_value_t = BakeOptions::default().unshot_fraction, allow_negative_numbers = true, help_heading = SOLVER)]
    unshot_fraction: f64,

    /// The error that rays may leave in reflected light, as a fraction of the light; 0.0001 to 1 [default: 0.0015 to
    /// 0.008, as the scene affords]
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true, help_heading = SOLVER)]
    gather_error: Option<f64>,

    /// Clamp reflectances to this; at least 0, below 1
    #[arg(long, value_name = "REFLECTANCE", default_value_t = BakeOptions::default().max_reflectance, allow_negative_numbers = true, help_heading = SOLVER)]
    max_reflectance: f64,
}

const LIGHTMAP: &str = "Lightmap";
const REFINEMENT: &str = "Mesh refinement";
const SOLVER: &str = "Solver";

#[derive(Clone, Copy, Debug, ValueEnum)]
enum RefineWord {
    /// A priori: where an occluder stands close above the element
    Cob,
    /// A posteriori: where a new vertex differs from the interpolation of its parent's
    Gradient,
    /// Both of the above
    #[value(name = "cob+gradient")]
    CobGradient,
    /// Every element down to the threshold: the baseline to compare with
    Uniform,
    /// No splits: the initial patches receive
    None,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DensityWord {
    /// Where the light needs them: surfaces are cut into charts whose texels leave least error
    Light,
    /// Everywhere alike, a chart a surface: the baseline to compare with
    Uniform,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DirectWord {
    /// Interpolated from the mesh's vertices, as the indirect light is
    Mesh,
    /// Evaluated anew in every texel: closed form times visibility
    Texel,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DynamicWord {
    /// They are left out
    Ignore,
    /// They throw shadows from where they rest
    Cast,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum NormalsWord {
    /// The triangles' own: a coarse sphere has facets
    Geometric,
    /// The interpolated ones: it is round, and no facet shades itself
    Shading,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TopologyWord {
    /// The input's own triangles with a second set of texture coordinates
    Source,
    /// The retriangulated elements, with radiosity as a vertex attribute too
    Adaptive,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum QuantityWord {
    /// E: what three.js and MOZ_lightmap expect
    Irradiance,
    /// E / π: what Bevy, Godot, PlayCanvas and Unity expect
    Radiance,
    /// B = π L + ρ E: the light that leaves the surface
    Radiosity,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PreviewWord {
    /// Tone-mapped, as the colour of unlit materials
    Unlit,
    /// In nits, as the emission of black materials
    Emissive,
}

impl From<PreviewWord> for Preview {
    fn from(word: PreviewWord) -> Self {
        match word {
            PreviewWord::Unlit => Self::Unlit,
            PreviewWord::Emissive => Self::Emissive,
        }
    }
}

impl From<RefineWord> for Refine {
    fn from(word: RefineWord) -> Self {
        match word {
            RefineWord::Cob => Self::Cob,
            RefineWord::Gradient => Self::Gradient,
            RefineWord::CobGradient => Self::CobGradient,
            RefineWord::Uniform => Self::Uniform,
            RefineWord::None => Self::None,
        }
    }
}

impl From<DensityWord> for DensityPolicy {
    fn from(word: DensityWord) -> Self {
        match word {
            DensityWord::Light => Self::Light,
            DensityWord::Uniform => Self::Uniform,
        }
    }
}

impl From<DirectWord> for Direct {
    fn from(word: DirectWord) -> Self {
        match word {
            DirectWord::Mesh => Self::Mesh,
            DirectWord::Texel => Self::Texel,
        }
    }
}

impl From<DynamicWord> for Dynamic {
    fn from(word: DynamicWord) -> Self {
        match word {
            DynamicWord::Ignore => Self::Ignore,
            DynamicWord::Cast => Self::Cast,
        }
    }
}

impl From<NormalsWord> for Normals {
    fn from(word: NormalsWord) -> Self {
        match word {
            NormalsWord::Geometric => Self::Geometric,
            NormalsWord::Shading => Self::Shading,
        }
    }
}

impl From<TopologyWord> for Topology {
    fn from(word: TopologyWord) -> Self {
        match word {
            TopologyWord::Source => Self::Source,
            TopologyWord::Adaptive => Self::Adaptive,
        }
    }
}

impl From<QuantityWord> for Quantity {
    fn from(word: QuantityWord) -> Self {
        match word {
            QuantityWord::Irradiance => Self::Irradiance,
            QuantityWord::Radiance => Self::Radiance,
            QuantityWord::Radiosity => Self::Radiosity,
        }
    }
}

impl BakeArgs {
    /// What of the explicit options is not what the engine reads; the user has the last word.
    pub(crate) fn doubt(&self) -> Option<String> {
        let (engine, typed) = (self.engine?, Quantity::from(self.quantity?));
        (typed != engine.quantity()).then(|| {
            let (name, typed, takes) = (engine.word(), typed.name(), engine.quantity().name());
            format!("--quantity {typed} is written as told, but {name} reads {takes}; leave --quantity out")
        })
    }
}

impl From<&BakeArgs> for BakeOptions {
    /// Says what was typed in the library's words; ranges are checked by [`BakeOptions::validate`].
    fn from(args: &BakeArgs) -> Self {
        let on_unless = |switched_off| if switched_off { Toggle::Off } else { Toggle::On };
        let mut options = Self::default();
        options.resolution = match (args.texels_per_metre, args.budget) {
            (Some(density), _) => Resolution::TexelsPerMetre(density),
            (None, Some(bytes)) => Resolution::Bytes(bytes),
            (None, None) => Resolution::Size(args.size),
        };
        options.preview = args.preview.map(Preview::from);
        // A preview's texels show textures as well as light.
        let density = match args.preview {
            Some(_) => DensityPolicy::Uniform,
            None => DensityPolicy::default(),
        };
        options.density = args.density.map_or(density, DensityPolicy::from);
        options.threads = args.threads;
        options.refine = args.refine.into();
        options.direct = args.direct.into();
        options.topology = args.topology.into();
        let quantity = args.engine.map_or(Quantity::default(), Engine::quantity);
        options.quantity = args.quantity.map_or(quantity, Quantity::from);
        options.cob_height =
            args.cob_height_fixed.map_or(CobHeight::OfElement(args.cob_height), CobHeight::Metres);
        options.subdivision_threshold = args.subdivision_threshold;
        options.illumination_threshold = args.illumination_threshold;
        options.shaft_test = on_unless(args.no_shaft_test);
        options.umbra_test = on_unless(args.no_umbra_test);
        options.unshot_fraction = args.unshot_fraction;
        options.gather_error = args.gather_error;
        options.max_reflectance = args.max_reflectance;
        options.padding = args.padding;
        options.mips = args.mips;
        options.pages = args.pages;
        options.scene = args.scene;
        options.elements = if args.elements { Toggle::On } else { Toggle::Off };
        options.dynamic = args.dynamic.into();
        options.keep_uv1 = if args.keep_uv1 { Toggle::On } else { Toggle::Off };
        options.normals = args.normals.into();
        options
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// The options that `cobake bake in.glb -o out.glb` means with `words` after it.
    fn options(words: &str) -> BakeOptions {
        let line = format!("cobake bake in.glb -o out.glb {words}");
        let cli = Cli::try_parse_from(line.split_whitespace()).expect("valid");
        let Command::Bake(args) = cli.command else { panic!("a bake") };
        BakeOptions::from(&*args)
    }

    #[test]
    fn definition_is_sound() {
        Cli::command().debug_assert();
    }

    /// The help prints its defaults from the parser; the library must have the same.
    #[test]
    fn nothing_typed_means_the_librarys_defaults() {
        assert_eq!(options(""), BakeOptions::default());
    }

    #[test]
    fn every_word_reaches_its_option() {
        let typed = options(
            "--size 64 --threads 3 --refine uniform --direct mesh --topology adaptive --quantity radiosity \
             --cob-height 0.5 --subdivision-threshold 0.01 --illumination-threshold 0.2 --no-shaft-test \
             --no-umbra-test --unshot-fraction 0.01 --gather-error 0.02 --max-reflectance 0.9 --padding 2 --mips 3 --pages 5 --scene 1 --dynamic cast --normals shading --elements --keep-uv1",
        );
        let mut meant = BakeOptions::default();
        meant.resolution = Resolution::Size(64);
        meant.threads = 3;
        meant.refine = Refine::Uniform;
        meant.direct = Direct::Mesh;
        meant.topology = Topology::Adaptive;
        meant.quantity = Quantity::Radiosity;
        meant.cob_height = CobHeight::OfElement(0.5);
        meant.subdivision_threshold = Some(0.01);
        meant.illumination_threshold = 0.2;
        meant.shaft_test = Toggle::Off;
        meant.umbra_test = Toggle::Off;
        meant.unshot_fraction = 0.01;
        meant.gather_error = Some(0.02);
        meant.max_reflectance = 0.9;
        meant.padding = Some(2);
        meant.mips = 3;
        meant.pages = 5;
        meant.scene = Some(1);
        meant.dynamic = Dynamic::Cast;
        meant.normals = Normals::Shading;
        meant.elements = Toggle::On;
        meant.keep_uv1 = Toggle::On;
        assert_eq!(typed, meant);
    }

    #[test]
    fn the_second_way_of_saying_size_and_height_wins_over_the_default() {
        assert_eq!(options("--texels-per-metre 40").resolution, Resolution::TexelsPerMetre(40.0));
        assert_eq!(options("--budget 4MiB").resolution, Resolution::Bytes(4 << 20));
        assert_eq!(options("--cob-height-fixed 0.03").cob_height, CobHeight::Metres(0.03));
    }

    #[test]
    fn engines_set_the_quantity_and_explicit_options_win() {
        assert_eq!(options("--for bevy").quantity, Quantity::Radiance);
        assert_eq!(options("--for three").quantity, Quantity::Irradiance);
        assert_eq!(options("--for unity --quantity irradiance").quantity, Quantity::Irradiance);
    }

    #[test]
    fn previews_have_texels_of_one_size_unless_told_otherwise() {
        let unlit = options("--preview unlit");
        assert_eq!((unlit.preview, unlit.density), (Some(Preview::Unlit), DensityPolicy::Uniform));
        let light = options("--preview emissive --density light");
        assert_eq!((light.preview, light.density), (Some(Preview::Emissive), DensityPolicy::Light));
    }

    #[test]
    fn every_refinement_has_its_word() {
        for (word, meaning) in [
            ("cob", Refine::Cob),
            ("gradient", Refine::Gradient),
            ("cob+gradient", Refine::CobGradient),
            ("uniform", Refine::Uniform),
            ("none", Refine::None),
        ] {
            assert_eq!(options(&format!("--refine {word}")).refine, meaning, "{word}");
        }
    }
}
