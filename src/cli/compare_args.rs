//! What was typed after `compare`.

use std::path::PathBuf;

use clap::Args;

/// The words after `compare`.
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// A file that `cobake bake` wrote
    #[arg(value_name = "BAKED")]
    pub(crate) baked: PathBuf,

    /// Another bake of the same scene, of any size and atlas; BAKED is what it should be like
    #[arg(value_name = "OTHER", required_unless_present = "reference", conflicts_with = "reference")]
    pub(crate) other: Option<PathBuf>,

    /// Compare with points whose irradiance is known: a NumPy archive of P, N, E, E_se, set, buried
    #[arg(long, value_name = "POINTS.npz")]
    pub(crate) reference: Option<PathBuf>,

    /// Draw the difference to OTHER at each texel of BAKED's lightmap
    #[arg(long, value_name = "FILE.png", conflicts_with = "reference")]
    pub(crate) heat_map: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,

    /// End with exit code 3 where relL2 (with --reference: any set's corrected RMS error) is above this, at least 0
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true)]
    pub(crate) fail_above: Option<f64>,

    /// Which of the files' scenes to compare [default: their default scene]
    #[arg(long, value_name = "INDEX")]
    pub(crate) scene: Option<usize>,
}
