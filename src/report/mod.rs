//! What a bake did and what it cost: the JSON report.
//!
//! The keys are part of the interface: charts, benches and build steps read them. Times are in
//! seconds, memory in bytes, energy is power in the scene's own units (lumens where the scene is in
//! nits, candela and lux), as linear RGB triples.

mod clock;
mod process;
mod recorder;

pub use clock::{Span, StageClock, TimeReport};
pub use process::{cpu_seconds, peak_memory_bytes};
pub use recorder::Recorder;

use glam::DVec3;
use serde::Serialize;

use crate::options::BakeOptions;
use crate::raster::{SeamReport, TexelWays};

/// Everything that a bake reports.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// Wall and CPU time, in all and per stage.
    pub time: TimeReport,
    /// The most memory that the process held at once; `null` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// What was baked.
    pub scene: SceneReport,
    /// Elements of the adaptive mesh.
    pub elements: ElementReport,
    /// The Close Objects Buffers.
    pub cob: CobReport,
    /// How many times a shooter sent out its unshot power.
    pub shots: u64,
    /// Rays cast, for visibility and all else.
    pub rays: u64,
    /// The lightmap's texels.
    pub texels: TexelReport,
    /// The page.
    pub lightmap: LightmapReport,
    /// Where the power went.
    pub energy: EnergyReport,
    /// What the user should know, one sentence each.
    pub warnings: Vec<String>,
    /// The options that the bake ran with, defaults filled in.
    pub options: BakeOptions,
}

/// What was baked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SceneReport {
    /// Triangles, each placement of a mesh counted.
    pub triangles: u64,
    /// Planar surfaces that they form.
    pub surfaces: u64,
    /// Punctual lights.
    pub lights: u64,
    /// Surfaces that emit.
    pub emitters: u64,
}

/// Elements of the adaptive mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ElementReport {
    /// Leaves before the first shot.
    pub initial: u64,
    /// Leaves when the solver stopped.
    #[serde(rename = "final")]
    pub at_end: u64,
    /// Elements split, by the policy that asked for it.
    pub splits: SplitReport,
}

/// Elements split, by the policy that asked for it; each split is counted once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SplitReport {
    /// An occluder stands close above.
    pub cob: u64,
    /// A new vertex differs from the interpolation of its parent's.
    pub gradient: u64,
    /// Everything is split.
    pub uniform: u64,
}

/// The Close Objects Buffers. The three states count elements when the solver stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CobReport {
    /// Elements whose buffer was never asked for.
    pub uninitialized: u64,
    /// Elements with nothing in their prism.
    pub empty: u64,
    /// Elements with something in their prism.
    pub not_empty: u64,
    /// What an empty buffer costs; the paper reports 5.
    pub bytes_per_empty: f64,
    /// What all buffers cost together.
    pub bytes_total: u64,
    /// CPU time spent in filling, handing down and asking.
    pub seconds: f64,
    /// Elements split because of their buffer.
    pub splits: u64,
    /// Splits not made because no entry lies in the shaft to the shooter.
    pub splits_saved_by_shaft: u64,
    /// Splits not made because one occluder shadows the element wholly.
    pub splits_saved_by_umbra: u64,
}

/// The lightmap's texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TexelReport {
    /// Texels that a surface touches.
    pub covered: u64,
    /// Texels whose direct light was evaluated anew instead of interpolated.
    pub evaluated: u64,
    /// Texels beside a chart that were filled from their neighbours.
    pub dilated: u64,
    /// Which way the evaluated ones took, once for each emitter.
    pub ways: TexelWays,
    /// Evaluations of emitters by cutting what hides them away, exactly.
    pub exact: u64,
    /// Evaluations of emitters by shadow rays.
    pub by_rays: u64,
}

/// The lightmap: all pages together.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LightmapReport {
    /// Of the widest page, texels.
    pub width: u32,
    /// Of the highest page, texels.
    pub height: u32,
    /// Density before charts were rounded to whole texels.
    pub texels_per_metre: f64,
    /// Charts in all pages.
    pub charts: u64,
    /// Covered texels over all texels, `[0, 1]`.
    pub utilisation: f64,
    /// Texels beside charts that were filled from their neighbours over all texels, `[0, 1]`.
    pub padding: f64,
    /// Free texels between two charts, at least.
    pub gutter: u32,
    /// How fine the charts are.
    pub density: DensityReport,
    /// Size of the EXRs.
    pub bytes: u64,
    /// Size of the PNGs that `MOZ_lightmap` names, 0 where there is none.
    pub png_bytes: u64,
    /// How well charts agree where they meet.
    pub seams: SeamReport,
    /// Layouts of the input.
    pub layouts: LayoutReport,
    /// Each page.
    pub pages: Vec<PageReport>,
}

/// One page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PageReport {
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// Charts in the page.
    pub charts: u64,
    /// Size of the EXR.
    pub bytes: u64,
    /// Size of the PNG, 0 where there is none.
    pub png_bytes: u64,
}

/// What became of the input's `TEXCOORD_1` where it was to be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LayoutReport {
    /// Lit nodes that keep theirs.
    pub kept: u64,
    /// Lit nodes that do not; `warnings` say why.
    pub not_kept: u64,
    /// Texels that lookups touch from two parts of kept layouts that do not go on in each other: light bleeds there.
    pub shared_texels: u64,
}

/// How fine charts are, texels a metre: the geometric mean of the density along either axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DensityReport {
    /// Of the coarsest chart.
    pub least: f64,
    /// Half of the surfaces' area is shown at most as finely as this.
    pub median: f64,
    /// Of the finest chart.
    pub greatest: f64,
}

/// The energy ledger: `emitted = absorbed + escaped + unshot`, per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnergyReport {
    /// Power sent out by emitters and punctual lights.
    pub emitted: DVec3,
    /// Power that surfaces took up.
    pub absorbed: DVec3,
    /// Power that left the scene.
    pub escaped: DVec3,
    /// Power still waiting to be shot when the solver stopped.
    pub unshot: DVec3,
}

impl EnergyReport {
    /// `emitted − absorbed − escaped − unshot`: zero where the ledger closes.
    #[must_use]
    pub fn imbalance(&self) -> DVec3 {
        self.emitted - self.absorbed - self.escaped - self.unshot
    }
}

impl Report {
    /// The report as indented JSON, ending with a line break.
    ///
    /// Numbers that JSON cannot hold (infinite, not a number) become `null`.
    ///
    /// # Errors
    /// None are known: every key is a string. The type is the serializer's.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        Ok(json)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{CobHeight, Resolution};
    use crate::progress::Stage;

    fn keys(value: &serde_json::Value) -> Vec<&str> {
        value.as_object().map(|o| o.keys().map(String::as_str).collect()).unwrap_or_default()
    }

    /// Charts and build steps read these names; a renamed field must not rename a key.
    #[test]
    fn keys_are_those_of_the_interface() {
        let json = serde_json::to_value(Report::default()).expect("serializable");
        let top = [
            "time",
            "peak_memory_bytes",
            "scene",
            "elements",
            "cob",
            "shots",
            "rays",
            "texels",
            "lightmap",
            "energy",
            "warnings",
            "options",
        ];
        assert_eq!(keys(&json), top);
        assert_eq!(keys(&json["scene"]), ["triangles", "surfaces", "lights", "emitters"]);
        assert_eq!(keys(&json["elements"]), ["initial", "final", "splits"]);
        assert_eq!(keys(&json["elements"]["splits"]), ["cob", "gradient", "uniform"]);
        let cob = [
            "uninitialized",
            "empty",
            "not_empty",
            "bytes_per_empty",
            "bytes_total",
            "seconds",
            "splits",
            "splits_saved_by_shaft",
            "splits_saved_by_umbra",
        ];
        assert_eq!(keys(&json["cob"]), cob);
        let texels = ["covered", "evaluated", "dilated", "ways", "exact", "by_rays"];
        assert_eq!(keys(&json["texels"]), texels);
        let ways = ["behind", "lit", "umbra", "smooth", "crossed", "edge"];
        assert_eq!(keys(&json["texels"]["ways"]), ways);
        let lightmap = [
            "width",
            "height",
            "texels_per_metre",
            "charts",
            "utilisation",
            "padding",
            "gutter",
            "density",
            "bytes",
            "png_bytes",
            "seams",
            "layouts",
            "pages",
        ];
        assert_eq!(keys(&json["lightmap"]["density"]), ["least", "median", "greatest"]);
        assert_eq!(keys(&json["lightmap"]), lightmap);
        assert_eq!(keys(&json["energy"]), ["emitted", "absorbed", "escaped", "unshot"]);
    }

    #[test]
    fn time_is_keyed_by_the_stage_names() {
        let mut clock = StageClock::start();
        clock.begin(Stage::Solve);
        clock.begin(Stage::Import);
        let report = Report { time: clock.finish(), ..Report::default() };
        let json = serde_json::to_value(report).expect("serializable");
        assert_eq!(keys(&json["time"]), ["total_wall_seconds", "total_cpu_seconds", "import", "solve"]);
        assert_eq!(keys(&json["time"]["solve"]), ["wall_seconds", "cpu_seconds"]);
    }

    #[test]
    fn options_and_energy_read_as_plain_values() {
        let mut report = Report::default();
        report.options.resolution = Resolution::TexelsPerMetre(40.0);
        report.options.cob_height = CobHeight::Metres(0.25);
        report.energy.emitted = DVec3::new(1.0, 2.0, 3.0);
        let json = serde_json::to_value(report).expect("serializable");
        assert_eq!(json["options"]["resolution"]["texels_per_metre"], 40.0);
        assert_eq!(json["options"]["cob_height"]["metres"], 0.25);
        assert_eq!(json["options"]["refine"], "cob+gradient");
        assert_eq!(json["energy"]["emitted"], serde_json::json!([1.0, 2.0, 3.0]));
    }

    #[test]
    fn imbalance_is_what_the_ledger_lost() {
        let energy = EnergyReport {
            emitted: DVec3::splat(8.0),
            absorbed: DVec3::splat(4.0),
            escaped: DVec3::splat(2.0),
            unshot: DVec3::splat(1.0),
        };
        assert_eq!(energy.imbalance(), DVec3::ONE);
    }
}
