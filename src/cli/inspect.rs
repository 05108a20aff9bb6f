//! `cobake inspect`: what a baked file holds.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use cobake::compare::BakedScene;
use cobake::inspect::{Inspection, Range, inspect};
use cobake::options::Quantity;
use glam::DVec3;
use serde_json::{Value, json};

use super::failure::WrongUse;
use super::{table, terminal};

/// The words after `inspect`.
#[derive(Args, Debug)]
pub(crate) struct InspectArgs {
    /// A file that `cobake bake` wrote
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,

    /// Only tell the irradiance at this place: its position, metres, and the surface's normal there
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_delimiter = ',', allow_negative_numbers = true)]
    at: Option<Vec<f64>>,

    /// Which of the file's scenes to look into [default: its default scene]
    #[arg(long, value_name = "INDEX")]
    scene: Option<usize>,
}

/// Runs the command.
pub(crate) fn run(args: &InspectArgs) -> anyhow::Result<()> {
    let text = match &args.at {
        Some(at) => at_place(args, at)?,
        None => {
            let found = inspect(&args.file, args.scene)?;
            let bytes = std::fs::metadata(&args.file).map_or(0, |file| file.len());
            if args.json { as_json(&found, bytes)? } else { as_text(&args.file, &found, bytes) }
        }
    };
    terminal::answer(&text).context("cannot write to stdout")
}

fn at_place(args: &InspectArgs, at: &[f64]) -> anyhow::Result<String> {
    let &[x, y, z, nx, ny, nz] = at else {
        return Err(WrongUse(format!("--at takes 6 numbers, X,Y,Z,NX,NY,NZ, not {}", at.len())).into());
    };
    let baked = BakedScene::load(&args.file, args.scene)?;
    let place = baked.locate(DVec3::new(x, y, z), DVec3::new(nx, ny, nz).normalize_or_zero());
    let light = place.and_then(|place| baked.irradiance_at(&place)).with_context(|| {
        format!(
            "no surface of {} that has a lightmap lies at {x},{y},{z} and faces {nx},{ny},{nz}",
            args.file.display()
        )
    })?;
    let [r, g, b] = light.to_array();
    Ok(if args.json { format!("{}\n", json!({"irradiance": [r, g, b]})) } else { format!("{r} {g} {b}\n") })
}

fn as_json(found: &Inspection, bytes: u64) -> anyhow::Result<String> {
    let mut value = serde_json::to_value(found).context("cannot put the figures into JSON")?;
    if let Some(object) = value.as_object_mut() {
        object.insert("bytes".into(), bytes.into());
    }
    Ok(format!("{value}\n"))
}

fn as_text(file: &Path, found: &Inspection, bytes: u64) -> String {
    let mut text = format!("{}\n", file.display());
    let reach = |r: Range| format!("{} to {}, mean {}", figure(r.least), figure(r.greatest), figure(r.mean));
    let mut rows = vec![
        row("file", format!("{bytes} bytes")),
        row("triangles", format!("{}, {} of them lit", found.triangles, found.lit_triangles)),
        row("vertices", found.vertices.to_string()),
    ];
    for (index, page) in found.pages.iter().enumerate() {
        let unit = if page.quantity == Quantity::Radiance { "nits" } else { "lux" };
        rows.push(row(
            "page",
            format!("{index}: {} × {} texels, {} bytes", page.width, page.height, page.bytes),
        ));
        rows.push(row(page.quantity.name(), format!("luminance {}, {unit}", reach(page.luminance))));
        rows.push(row("charts", format!("{}, on {:.1} % of the page", page.charts, 100.0 * page.coverage)));
        rows.push(row("density", format!("{}, texels a metre", reach(page.density))));
    }
    for (key, value) in found.baked.as_object().into_iter().flatten() {
        rows.push(row(key, words(value)));
    }
    if found.baked == Value::Null {
        rows.push(row("baked", "the file does not say how".to_owned()));
    }
    text += &table::aligned(&rows);
    text
}

/// Four decimals, or where these would say nothing, powers of ten.
fn figure(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:.3e}") } else { format!("{value:.4}") }
}

/// An option as a file tells it, without JSON's marks.
fn words(value: &Value) -> String {
    match value {
        Value::Null => "as the scene asks".to_owned(),
        Value::String(word) => word.clone(),
        Value::Object(parts) => {
            let parts: Vec<String> =
                parts.iter().map(|(name, value)| format!("{name} {}", words(value))).collect();
            parts.join(", ")
        }
        other => other.to_string(),
    }
}

fn row(name: &str, value: String) -> [String; 3] {
    [name.to_owned(), String::new(), value]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_figures_say_something() {
        assert_eq!([0.0, 2.5e-7, 0.25, 1234.5].map(figure), ["0.0000", "2.500e-7", "0.2500", "1234.5000"]);
    }

    #[test]
    fn options_are_words() {
        let told = json!({"cobHeight": {"of-element": 1.0}, "threshold": null, "refine": "cob", "mips": 0});
        let told: Vec<String> =
            ["cobHeight", "threshold", "refine", "mips"].iter().map(|key| words(&told[*key])).collect();
        assert_eq!(told, ["of-element 1.0", "as the scene asks", "cob", "0"]);
    }
}
