//! `cobake compare`: how far a bake is from reference points or from another bake.

use std::path::Path;

use anyhow::Context;
use cobake::compare::{BakedScene, ReferencePoints, with_bake, with_reference};
use cobake::error::Error;
use cobake::export::write_whole;
use serde_json::json;

use super::compare_args::CompareArgs;
use super::failure::{TooFar, WrongUse};
use super::{files, table, terminal};

/// Runs the command: the figures go to stdout, whether they are above the limit or not.
pub(crate) fn run(args: &CompareArgs) -> anyhow::Result<()> {
    if let Some(limit) = args.fail_above.filter(|limit| !(limit.is_finite() && *limit >= 0.0)) {
        return Err(
            WrongUse(format!("--fail-above must be a finite number of at least 0, not {limit}")).into()
        );
    }
    match (&args.reference, &args.other) {
        (Some(reference), _) => compare_with_reference(args, reference),
        (None, Some(other)) => compare_with_bake(args, other),
        // Clap asks for one of them.
        (None, None) => Err(WrongUse("name another bake, or --reference POINTS.npz".to_owned()).into()),
    }
}

fn compare_with_reference(args: &CompareArgs, reference: &Path) -> anyhow::Result<()> {
    let points = ReferencePoints::load(reference)?;
    let baked = BakedScene::load(&args.baked, args.scene)?;
    let figures = with_reference(&baked, &points)?;
    let text = if args.json {
        serde_json::to_string(&figures).context("cannot put the figures into JSON")? + "\n"
    } else {
        table::reference(&args.baked, reference, &figures)
    };
    terminal::answer(&text).context("cannot write to stdout")?;
    match figures.worst() {
        Some((set, error)) => {
            check(args.fail_above, &format!("the corrected RMS error of {set} points"), error)
        }
        None => Ok(()),
    }
}

fn compare_with_bake(args: &CompareArgs, other: &Path) -> anyhow::Result<()> {
    if let Some(path) = &args.heat_map {
        files::check_result("the heat map", path, &[&args.baked, other])?;
    }
    let (a, b) = (BakedScene::load(&args.baked, args.scene)?, BakedScene::load(other, args.scene)?);
    let comparison = with_bake(&a, &b)?;
    let figures = &comparison.figures;
    let mut scale = None;
    if let Some(path) = &args.heat_map {
        let heat_map = comparison.heat_map()?;
        write_whole(path, &heat_map.png).map_err(Error::from)?;
        scale = Some(heat_map.scale);
    }
    let text = if args.json {
        let mut value = serde_json::to_value(figures).context("cannot put the figures into JSON")?;
        if let (Some(scale), Some(object)) = (scale, value.as_object_mut()) {
            object.insert("heat_map".into(), json!({"scale": scale}));
        }
        format!("{value}\n")
    } else {
        table::pair(&args.baked, other, figures, scale)
    };
    terminal::answer(&text).context("cannot write to stdout")?;
    check(args.fail_above, "relL2", figures.rel_l2)
}

/// Fails where `value` is above the limit, or is no number.
fn check(limit: Option<f64>, name: &str, value: f64) -> anyhow::Result<()> {
    match limit {
        Some(limit) if value.is_nan() || value > limit => {
            Err(TooFar(format!("{name} is {value:.6}, above the {limit} of --fail-above")).into())
        }
        _ => Ok(()),
    }
}
