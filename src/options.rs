//! What a bake can be told. The command line uses the same words.

use std::collections::BTreeMap;

use serde::Serialize;

/// Which elements are split when a shooter's light arrives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Refine {
    /// A priori: where an occluder stands close above the element (Telea and van Overveld 1997).
    Cob,
    /// A posteriori: where a new vertex differs from the interpolation of its parent's.
    Gradient,
    /// Both of the above.
    #[default]
    #[serde(rename = "cob+gradient")]
    CobGradient,
    /// Every element down to the threshold: the baseline to compare with.
    Uniform,
    /// No splits: the initial patches receive.
    None,
}

/// Where the direct light in a texel comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Direct {
    /// Interpolated from the mesh's vertices, as the indirect light is.
    Mesh,
    /// Evaluated anew in every texel: closed form times visibility.
    #[default]
    Texel,
}

/// What becomes of meshes that move: by animation, skin or morph targets. None gets a lightmap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Dynamic {
    /// They are left out of the bake.
    #[default]
    Ignore,
    /// They throw shadows, and light, from where they rest.
    Cast,
}

/// What surfaces that are drawn with interpolated normals are lit about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Normals {
    /// Their triangles' own normals: a coarse sphere has facets.
    #[default]
    Geometric,
    /// The interpolated normals, from where the curved surface is that these tell of (Hanika 2021): a coarse sphere is
    /// round, and its facets throw no shadows on themselves. What passes between surfaces still is what triangles
    /// send to triangles.
    Shading,
}

/// What the output's geometry is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Topology {
    /// The input's own triangles with a second set of texture coordinates.
    #[default]
    Source,
    /// The retriangulated elements, with radiosity as a vertex attribute too.
    Adaptive,
}

/// What a texel holds. `E` is irradiance, `L` emission, `ρ` reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Quantity {
    /// `E`: what three.js and `MOZ_lightmap` expect.
    #[default]
    Irradiance,
    /// `E / π`: what Bevy, Godot, PlayCanvas and Unity expect.
    Radiance,
    /// `B = π L + ρ E`: the light that leaves the surface.
    Radiosity,
}

impl Quantity {
    /// As it is typed and written.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Irradiance => "irradiance",
            Self::Radiance => "radiance",
            Self::Radiosity => "radiosity",
        }
    }
}

/// What viewers that know no lightmaps are shown in place of the scene's materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preview {
    /// `L + ρ E / π`, tone-mapped, as the colour of unlit materials: looks the same in every viewer.
    Unlit,
    /// `L + ρ E / π` as the emission of black materials, nits: brighter than white stays brighter, and the
    /// viewer's own exposure applies.
    Emissive,
}

/// How fine the lightmap is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Resolution {
    /// The page's side in texels, `[16, 16384]`; the density follows.
    Size(u32),
    /// Texels per metre of surface, above 0; the page's side follows.
    TexelsPerMetre(f64),
    /// As much as fits into this many bytes, `[1, 2³²)`: all lightmaps together as they are written, the EXR
    /// and the PNG. Never a byte more; density, and the page's shape and size follow.
    Bytes(u64),
}

impl Default for Resolution {
    fn default() -> Self {
        Self::Size(512)
    }
}

/// Where texels are dense.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum DensityPolicy {
    /// Where the light needs them: surfaces are cut into charts whose texels leave least error.
    #[default]
    Light,
    /// Everywhere alike, a chart a surface.
    Uniform,
}

/// The height of the prism above an element in which occluders count as close.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CobHeight {
    /// A fraction of the element's size, above 0.
    OfElement(f64),
    /// A fixed length in metres, above 0. The paper suggests 3 % of the environment's size.
    Metres(f64),
}

impl Default for CobHeight {
    fn default() -> Self {
        Self::OfElement(1.0)
    }
}

/// Everything that [`bake`](crate::bake()) can be told.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BakeOptions {
    /// How fine the lightmap is. Default: a page of 512 texels a side.
    pub resolution: Resolution,
    /// Where texels are dense. Default: [`DensityPolicy::Light`].
    pub density: DensityPolicy,
    /// By the index of a glTF node: how many times as many texels a metre as else lie on what the node's mesh shows,
    /// `[1/64, 64]`. Where the page's or the file's size is given others get less, or more. Default: none, all 1.
    pub node_density: BTreeMap<usize, f64>,
    /// Worker threads, `[0, 1024]`; `0` takes one per core. The result does not depend on it. Default: `0`.
    pub threads: usize,
    /// Which elements are split. Default: [`Refine::CobGradient`].
    pub refine: Refine,
    /// Where a texel's direct light comes from. Default: [`Direct::Texel`].
    pub direct: Direct,
    /// The output's geometry. Default: [`Topology::Source`].
    pub topology: Topology,
    /// What a texel holds. Default: [`Quantity::Irradiance`].
    pub quantity: Quantity,
    /// Whether lit materials become pictures of the light for viewers that know no lightmaps. The page then holds
    /// what the materials' textures show, so [`DensityPolicy::Uniform`] suits it. Default: none.
    pub preview: Option<Preview>,
    /// Height of the Close Objects Buffer's prism. Default: the element's size.
    pub cob_height: CobHeight,
    /// Elements no larger than this are not split, metres, above 0. Default: what the lightmap can show.
    pub subdivision_threshold: Option<f64>,
    /// A shot whose estimate `M` (eq. 1) is below this fraction of the receiver's present radiosity
    /// does not split it, `(0, 1]`. Default: 0.3.
    pub illumination_threshold: f64,
    /// Whether Close Objects Buffer entries outside the shaft to the shooter are ignored. Default: yes.
    pub shaft_test: Toggle,
    /// Whether elements wholly in one occluder's umbra are left whole. Default: yes.
    pub umbra_test: Toggle,
    /// The solver stops when the unshot power falls below this fraction of the emitted power, `(0, 1)`.
    /// Default: 0.0001.
    pub unshot_fraction: f64,
    /// The error that the rays of a place may leave in its reflected light, as a fraction of the light there,
    /// `[0.0001, 1]`; elements are split where interpolation would miss five times as much. Default: as little as
    /// 12 to 24 million rays leave, between 0.0015 and 0.008.
    pub gather_error: Option<f64>,
    /// Reflectances are clamped to this, `[0, 1)`: nothing may reflect all light for ever. Default: 0.95.
    pub max_reflectance: f64,
    /// Free texels around the texels that bilinear lookups inside a chart touch, `[1, 16]`; twice as
    /// many lie between two charts. Default: one between two charts, or none where they do not fit otherwise.
    pub padding: Option<u32>,
    /// Mip levels, `[0, 4]`, that show each chart without its neighbours' light: charts lie in cells of whole texels
    /// of the coarsest level, and gutters are as wide as one of these. Costs room, the more the smaller
    /// the charts are. Default: 0, for bilinear lookups in the lightmap itself.
    pub mips: u32,
    /// The most pages, `[1, 64]`. [`Resolution::Size`] is for each of them, and they are filled; otherwise there are
    /// several only where charts need more than one of 16384 texels a side. Default: 1.
    pub pages: u32,
    /// Which of the document's scenes to bake. Default: its default scene.
    pub scene: Option<usize>,
    /// Whether the output holds the elements and their Close Objects Buffers' states too, to look at. Default: no.
    pub elements: Toggle,
    /// What becomes of meshes that move. Default: [`Dynamic::Ignore`].
    pub dynamic: Dynamic,
    /// Whether a `TEXCOORD_1` that is a lightmap layout is kept and used; a warning says which are none, and why. With
    /// one that is, [`DensityPolicy::Uniform`] holds for all the rest; goes with no [`mips`](Self::mips). Default: no.
    pub keep_uv1: Toggle,
    /// What curved surfaces are lit about. Default: [`Normals::Geometric`].
    pub normals: Normals,
}

/// A choice between on and off that reads as a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Toggle {
    /// The behaviour is on.
    #[default]
    On,
    /// The behaviour is off.
    Off,
}

impl Default for BakeOptions {
    fn default() -> Self {
        Self {
            resolution: Resolution::default(),
            density: DensityPolicy::default(),
            node_density: BTreeMap::new(),
            threads: 0,
            refine: Refine::default(),
            direct: Direct::default(),
            topology: Topology::default(),
            quantity: Quantity::default(),
            preview: None,
            cob_height: CobHeight::default(),
            subdivision_threshold: None,
            illumination_threshold: 0.3,
            shaft_test: Toggle::On,
            umbra_test: Toggle::On,
            unshot_fraction: 1e-4,
            gather_error: None,
            max_reflectance: 0.95,
            padding: None,
            mips: 0,
            pages: 1,
            scene: None,
            elements: Toggle::Off,
            dynamic: Dynamic::default(),
            keep_uv1: Toggle::Off,
            normals: Normals::default(),
        }
    }
}

/// An option outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{option} is {value}; it must be {range}")]
pub struct OptionsError {
    /// The option's name as on the command line, without dashes; `node-density` is the library's alone.
    pub option: &'static str,
    /// The value given.
    pub value: f64,
    /// The range in words.
    pub range: &'static str,
}

impl BakeOptions {
    /// Checks every range.
    ///
    /// # Errors
    /// Names the first option that is out of its range (NaN is always out).
    pub fn validate(&self) -> Result<(), OptionsError> {
        let check = |holds: bool, option, value, range| {
            if holds { Ok(()) } else { Err(OptionsError { option, value, range }) }
        };
        match self.resolution {
            Resolution::Size(side) => {
                check((16..=16384).contains(&side), "size", f64::from(side), "between 16 and 16384 texels")?;
            }
            Resolution::TexelsPerMetre(t) => {
                check(t.is_finite() && t > 0.0, "texels-per-metre", t, "a number above 0")?;
            }
            Resolution::Bytes(b) => {
                let range = "at least 1 byte and less than 4 GiB, as a glTF's buffer is";
                check((1..1 << 32).contains(&b), "budget", b as f64, range)?;
            }
        }
        for &factor in self.node_density.values() {
            let range = "between 1/64 and 64 for every node";
            check((1.0 / 64.0..=64.0).contains(&factor), "node-density", factor, range)?;
        }
        check(self.threads <= 1024, "threads", self.threads as f64, "at most 1024 (0 takes one per core)")?;
        match self.cob_height {
            CobHeight::OfElement(h) => {
                check(h.is_finite() && h > 0.0, "cob-height", h, "a number above 0")?;
            }
            CobHeight::Metres(h) => {
                check(h.is_finite() && h > 0.0, "cob-height-fixed", h, "a number above 0")?;
            }
        }
        if let Some(t) = self.subdivision_threshold {
            check(t.is_finite() && t > 0.0, "subdivision-threshold", t, "a number above 0")?;
        }
        if let Some(p) = self.padding {
            check((1..=16).contains(&p), "padding", f64::from(p), "between 1 and 16 texels")?;
        }
        let most = crate::unwrap::MOST_MIPS;
        check(self.mips <= most, "mips", f64::from(self.mips), "between 0 and 4 levels")?;
        let range = "0 with --keep-uv1, since the input's layout keeps to no cells; leave one of them out";
        check(self.keep_uv1 == Toggle::Off || self.mips == 0, "mips", f64::from(self.mips), range)?;
        check((1..=64).contains(&self.pages), "pages", f64::from(self.pages), "between 1 and 64")?;
        let m = self.illumination_threshold;
        check(m > 0.0 && m <= 1.0, "illumination-threshold", m, "above 0 and at most 1")?;
        let u = self.unshot_fraction;
        check(u > 0.0 && u < 1.0, "unshot-fraction", u, "above 0 and below 1")?;
        if let Some(e) = self.gather_error {
            check((1e-4..=1.0).contains(&e), "gather-error", e, "between 0.0001 and 1")?;
        }
        let r = self.max_reflectance;
        check((0.0..1.0).contains(&r), "max-reflectance", r, "at least 0 and below 1")
    }
}
