//! Bakes as a page to look at: one HTML file that holds the scene, its lightmaps and the program that draws them.
//!
//! The page needs no server and no network. It carries three.js ([its licence](LICENCE) too), our own modules beside
//! this file, and one or two bakes as GLB, base 64. The lightmaps' EXRs are decoded in the page, to all their
//! digits; a texel's quantity decides how it becomes irradiance.
//!
//! Modules reach each other through an import map of `data:` addresses, since a page that is opened as a file may
//! not import other files.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::compare::{BakedScene, CompareError};
use crate::export::{ExportError, base64, self_contained};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");

/// The licence of three.js, which the page carries.
pub const LICENCE: &str = include_str!("three.LICENSE.txt");

/// Name and text of each module; the last one starts the page.
const MODULES: [(&str, &str); 8] = [
    ("three", include_str!("three.bundle.min.js")),
    ("view/light", include_str!("light.js")),
    ("view/shader", include_str!("shader.js")),
    ("view/elements", include_str!("elements.js")),
    ("view/model", include_str!("model.js")),
    ("view/legend", include_str!("legend.js")),
    ("view/atlas", include_str!("atlas.js")),
    ("view/main", include_str!("main.js")),
];

/// Why no page could be made. The cause is reached through `source`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A file is no bake, or a damaged one.
    #[error(transparent)]
    Baked(#[from] CompareError),

    /// A file cannot be put into the page.
    #[error("cannot put {} into a page", path.display())]
    Document {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: ExportError,
    },
}

/// The page that shows the bake `a`, or `a` beside `b`, another bake of the same scene; `scene` names the scene in
/// the files, by default their own. The same files give the same bytes.
///
/// # Errors
/// Where a file is no scene, holds no lightmap of cobake's, or a damaged one.
pub fn page(a: &Path, b: Option<&Path>, scene: Option<usize>) -> Result<String, ViewError> {
    let (mut bakes, mut data) = (Vec::new(), String::new());
    for (index, path) in std::iter::once(a).chain(b).enumerate() {
        let baked = BakedScene::load(path, scene)?;
        let glb = self_contained(&baked.scene().source)
            .map_err(|source| ViewError::Document { path: path.to_owned(), source })?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        bakes.push(json!({"name": name, "scene": scene, "bytes": glb.len()}));
        data += &format!(
            "<script type=\"application/octet-stream\" id=\"glb-{index}\">{}</script>\n",
            base64(&glb)
        );
    }
    let modules = MODULES.iter().map(|(name, text)| {
        (String::from(*name), Value::from(format!("data:text/javascript;base64,{}", base64(text.as_bytes()))))
    });
    let imports = json!({"imports": modules.collect::<serde_json::Map<_, _>>()}).to_string();
    Ok(fill(&[
        ("style", STYLE),
        ("imports", &imports),
        ("bakes", &in_script(&Value::from(bakes).to_string())),
        ("licence", LICENCE),
        ("version", env!("CARGO_PKG_VERSION")),
        ("data", &data),
    ]))
}

/// Puts each text at the place in the template that its name marks, `{{name}}`; what is put in is not looked through.
fn fill(texts: &[(&str, &str)]) -> String {
    let mut page = String::new();
    let mut rest = TEMPLATE;
    while let Some((before, (name, after))) =
        rest.split_once("{{").and_then(|(before, after)| Some((before, after.split_once("}}")?)))
    {
        page += before;
        page += texts.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text);
        rest = after;
    }
    page + rest
}

/// JSON that may stand in a script element, whatever names it holds.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixture() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/compare/cornell-64.glb")
    }

    #[test]
    fn a_page_needs_nothing_but_itself() {
        let page = page(&fixture(), Some(&fixture()), None).expect("a page");
        assert!(!page.contains("{{"), "a mark was left");
        for absent in ["src=", "href=", "url(http", "@import"] {
            assert!(!page.contains(absent), "{absent}");
        }
        for present in ["id=\"glb-0\"", "id=\"glb-1\"", "cornell-64.glb", "three.js authors"] {
            assert!(page.contains(present), "{present}");
        }
    }

    #[test]
    fn names_cannot_leave_their_script() {
        let folder = tempfile::tempdir().expect("a folder");
        let odd = folder.path().join("<script>{{data}}.glb");
        std::fs::copy(fixture(), &odd).expect("copied");
        let page = page(&odd, None, None).expect("a page");
        assert!(page.contains("\\u003cscript>{{data}}.glb"));
        assert_eq!(page.matches("id=\"glb-0\"").count(), 1);
    }

    #[test]
    fn what_is_no_bake_is_refused() {
        let plain = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell/scene.glb");
        assert!(matches!(page(&plain, None, None), Err(ViewError::Baked(CompareError::NotBaked { .. }))));
    }
}
