//! `cobake compare`: its figures against those of an independent evaluator, its exit codes, its messages.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use cobake::compare::{BakedScene, ReferencePoints, with_bake, with_reference};
use cobake::options::{BakeOptions, Quantity, Resolution};
use cobake::progress::Silent;
use serde_json::Value;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Both evaluators work in double precision on the same file; NumPy keeps the reference's means in
/// single precision.
const SAME: f64 = 1e-4;

/// Everything that `cobake compare` can be told.
const OPTIONS: [&str; 5] = ["--reference", "--heat-map", "--json", "--fail-above", "--scene"];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

fn baked() -> PathBuf {
    fixture("compare/cornell-64.glb")
}

fn points() -> PathBuf {
    fixture("compare/cornell-points.npz")
}

/// Bakes cornell into a file.
fn bake(folder: &TempDir, name: &str, size: u32, quantity: Quantity) -> PathBuf {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(size);
    options.quantity = quantity;
    let result = cobake::bake(&fixture("cornell/scene.glb"), &options, &mut Silent).expect("baked");
    let path = folder.path().join(name);
    std::fs::write(&path, result.glb).expect("written");
    path
}

struct Finished {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Finished {
    /// Failed with `code`, saying all of `words` and nothing on stdout.
    #[track_caller]
    fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!((self.code, self.stdout.as_str()), (Some(code), ""), "{}", self.stderr);
        for word in words {
            assert!(self.stderr.contains(word), "no {word:?} in: {}", self.stderr);
        }
    }

    #[track_caller]
    fn json(&self) -> Value {
        assert_eq!(self.stderr, "");
        serde_json::from_str(&self.stdout).expect("JSON")
    }
}

fn compare<'a>(words: impl IntoIterator<Item = &'a dyn AsRef<Path>>) -> Finished {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cobake"));
    command.arg("compare").args(words.into_iter().map(AsRef::as_ref)).env_remove("COBAKE_LOG");
    let output = command.output().expect("started");
    Finished {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

/// A stored (not deflated) archive of big-endian doubles, which the committed one is not.
fn write_npz(path: &Path, arrays: &[(&str, &[usize], &[f64])]) {
    let mut zip = ZipWriter::new(std::fs::File::create(path).expect("made"));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, shape, values) in arrays {
        let shape: String = shape.iter().map(|length| format!("{length}, ")).collect();
        let header = format!("{{'descr': '>f8', 'fortran_order': False, 'shape': ({shape}), }}\n");
        zip.start_file(format!("{name}.npy"), stored).expect("started");
        zip.write_all(b"\x93NUMPY\x02\x00").expect("written");
        zip.write_all(&u32::try_from(header.len()).expect("short").to_le_bytes()).expect("written");
        zip.write_all(header.as_bytes()).expect("written");
        values.iter().for_each(|value| zip.write_all(&value.to_be_bytes()).expect("written"));
    }
    zip.finish().expect("finished");
}

/// The evaluator that `fixtures/compare/README.md` names gave these figures for the same two files.
#[test]
fn figures_are_those_of_an_independent_evaluator() {
    let expected = std::fs::read_to_string(fixture("compare/expected.json")).expect("read");
    let expected: Value = serde_json::from_str(&expected).expect("JSON");
    let found = compare([&baked() as &dyn AsRef<Path>, &"--reference", &points(), &"--json"]).json();
    assert_eq!(found["unmatched"], expected["unmatched"]);
    for set in ["uniform", "contact", "detail"] {
        let wanted = expected[set].as_object().expect("a set");
        assert_eq!(found[set].as_object().expect("a set").len(), wanted.len());
        for (name, value) in wanted {
            let (value, found) = (value.as_f64().expect("a number"), found[set][name].as_f64());
            let found = found.unwrap_or_else(|| panic!("{set} has no {name}"));
            assert!((found - value).abs() < SAME, "{set} {name}: {found}, not {value}");
        }
    }
}

/// From the same solution, all three quantities give the same irradiance, but for half precision.
#[test]
fn the_quantity_does_not_matter() {
    const HALF_PRECISION: f64 = 2e-3;
    let folder = tempfile::tempdir().expect("a folder");
    let reference = ReferencePoints::load(&points()).expect("points");
    let error = |name, quantity| {
        let path = bake(&folder, name, 32, quantity);
        let figures =
            with_reference(&BakedScene::load(&path, None).expect("a bake"), &reference).expect("figures");
        figures.contact.expect("points").rrmse
    };
    let irradiance = error("irradiance.glb", Quantity::Irradiance);
    assert!((error("radiance.glb", Quantity::Radiance) - irradiance).abs() < HALF_PRECISION);
    assert!((error("radiosity.glb", Quantity::Radiosity) - irradiance).abs() < HALF_PRECISION);

    let load = |name: &str| BakedScene::load(&folder.path().join(name), None).expect("a bake");
    let figures = with_bake(&load("irradiance.glb"), &load("radiance.glb")).expect("figures").figures;
    assert_eq!(figures.quantity, Quantity::Irradiance);
    assert!(figures.rel_l2 < HALF_PRECISION, "{figures:?}");
}

#[test]
fn a_bake_is_like_itself() {
    // A point that is lifted into the world and found again is off by rounding alone.
    const ROUNDING: f64 = 1e-9;
    let found = compare([&baked() as &dyn AsRef<Path>, &baked(), &"--json", &"--fail-above", &"1e-9"]);
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    let found = found.json();
    for name in ["rel_l2", "bias", "p50", "p95", "p99"] {
        assert!(found[name].as_f64().expect("a number").abs() < ROUNDING, "{name}: {found}");
    }
    assert_eq!((&found["unmatched"], &found["flip"]["unmatched"]), (&0.into(), &0.into()));
    // The floor under the two blocks is left out: 2 × 0.165² of some 2 square metres.
    let hidden = found["hidden"].as_u64().expect("a number");
    assert_eq!(found["points"].as_u64().expect("a number") + hidden, 65536);
    assert!((0.02..0.04).contains(&(hidden as f64 / 65536.0)), "{hidden}");
    assert_eq!(found["quantity"], "irradiance");
    assert!(found["flip"]["mean"].as_f64().expect("a number") < 1e-4);
    assert!(found["flip"]["texels"].as_u64().expect("a number") > 2000);
}

/// Another size gives other charts at other places, and much the same light.
#[test]
fn another_atlas_is_no_difference_and_another_size_a_small_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let small = bake(&folder, "small.glb", 32, Quantity::Irradiance);
    let heat_map = folder.path().join("heat.png");
    let words: [&dyn AsRef<Path>; 5] = [&baked(), &small, &"--json", &"--heat-map", &heat_map];
    let found = compare(words).json();
    let number = |pointer: &str| found.pointer(pointer).and_then(Value::as_f64).expect("a number");
    assert!((0.005..0.2).contains(&number("/rel_l2")), "{found}");
    assert!(number("/bias").abs() < 0.02, "{found}");
    assert!(number("/p50") < number("/p95") && number("/p95") < number("/p99"));
    assert!((1e-3..0.3).contains(&number("/flip/mean")), "{found}");
    assert_eq!(number("/unmatched"), 0.0);
    assert!(number("/heat_map/scale") > 0.0);

    let picture = image::open(&heat_map).expect("a picture").into_rgb8();
    assert_eq!(picture.dimensions(), (64, 64));
    let table = compare([&baked() as &dyn AsRef<Path>, &small, &"--heat-map", &heat_map]);
    assert_eq!((table.code, table.stderr.as_str()), (Some(0), ""));
    for word in ["relL2", "bias", "p99", "FLIP", "unmatched", "heat map"] {
        assert!(table.stdout.contains(word), "no {word} in {}", table.stdout);
    }
}

/// What is above the limit is told on stdout as ever; the exit code is 3 and stderr says why.
#[test]
fn a_limit_gates_a_pipeline() {
    let folder = tempfile::tempdir().expect("a folder");
    let small = bake(&folder, "small.glb", 32, Quantity::Irradiance);
    let with = |words: [&dyn AsRef<Path>; 3], limit: &str| {
        compare(words.into_iter().chain([&"--fail-above" as &dyn AsRef<Path>, &limit]))
    };
    for (words, name) in [
        ([&baked() as &dyn AsRef<Path>, &small, &"--json"], "relL2"),
        ([&baked() as &dyn AsRef<Path>, &"--reference", &points()], "contact"),
    ] {
        let words = if name == "contact" { [words[0], words[1], words[2]] } else { words };
        let above = with(words, "0.001");
        assert_eq!(above.code, Some(3), "{}", above.stderr);
        assert!(!above.stdout.is_empty() && above.stderr.contains(name), "{}", above.stderr);
        assert_eq!(with(words, "0.5").code, Some(0));
        with(words, "-1").refused(2, &["--fail-above", "at least 0"]);
        with(words, "nan").refused(2, &["--fail-above"]);
    }
}

#[test]
fn words_that_make_no_sense_are_wrong_use() {
    compare([&baked() as &dyn AsRef<Path>]).refused(2, &["OTHER"]);
    compare([&baked() as &dyn AsRef<Path>, &baked(), &"--reference", &points()]).refused(2, &["--reference"]);
    compare([&baked() as &dyn AsRef<Path>, &"--reference", &points(), &"--heat-map", &"a.png"])
        .refused(2, &["--heat-map"]);
    let before = std::fs::read(baked()).expect("read");
    compare([&baked() as &dyn AsRef<Path>, &baked(), &"--heat-map", &baked()]).refused(2, &["would replace"]);
    assert_eq!(std::fs::read(baked()).expect("read"), before);
}

#[test]
fn files_that_are_no_bake_are_named() {
    let scene = fixture("cornell/scene.glb");
    for words in [[&baked(), &scene], [&scene, &baked()]] {
        compare(words.map(|path| path as &dyn AsRef<Path>))
            .refused(1, &["scene.glb holds no lightmap", "`cobake bake`"]);
    }
    compare([&fixture("bad/not-gltf/scene.glb") as &dyn AsRef<Path>, &baked()])
        .refused(1, &["bad/not-gltf/scene.glb", "caused by: ", "export the scene as glTF"]);
    compare([&"gone.glb" as &dyn AsRef<Path>, &baked()]).refused(1, &["gone.glb"]);
}

/// The last bytes of the EXR lie at the end of the file.
#[test]
fn a_damaged_lightmap_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bytes = std::fs::read(baked()).expect("read");
    let start = bytes.windows(4).position(|four| four == b"\x76\x2f\x31\x01").expect("an EXR");
    bytes[start..start + 4].fill(0);
    let path = folder.path().join("damaged.glb");
    std::fs::write(&path, bytes).expect("written");
    compare([&path as &dyn AsRef<Path>, &baked()])
        .refused(1, &["lightmap 0 of", "damaged.glb", "bake the scene again"]);
}

#[test]
fn points_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("points.npz");
    let refused = |words: &[&str]| {
        let found = compare([&baked() as &dyn AsRef<Path>, &"--reference", &path, &"--json"]);
        found.refused(1, &[&["points.npz"], words].concat());
    };
    refused(&["cannot read"]);
    std::fs::write(&path, "no archive").expect("written");
    refused(&["not a NumPy .npz archive"]);
    write_npz(&path, &[]);
    refused(&["no array P", "it holds none"]);
    write_npz(&path, &[("P", &[1, 3], &[0.0; 3]), ("N", &[1, 3], &[0.0; 3])]);
    refused(&["no array E ", "it holds P, N", "E_se"]);
    write_npz(&path, &[("P", &[1, 3], &[0.0; 3]), ("N", &[3], &[0.0; 3])]);
    refused(&["array N", "[1, 3]"]);
    write_npz(&path, &[("P", &[1, 3], &[0.0, f64::NAN, 0.0])]);
    refused(&["array P", "row 0"]);
    write_npz(&path, &[("P", &[2, 3], &[0.0; 3])]);
    refused(&["array P", "should have 48 bytes"]);
}

/// One point on the floor, one that is buried, one beside the scene; the rest as it would be from NumPy.
#[test]
fn stored_archives_of_doubles_are_read_and_what_is_elsewhere_is_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("points.npz");
    let positions = [0.1, 0.0, 0.1, 0.3, 0.0, 0.3, 9.0, 9.0, 9.0];
    let write = |normal: f64| {
        let up = [0.0, normal, 0.0].repeat(3);
        write_npz(
            &path,
            &[
                ("P", &[3, 3], &positions),
                ("N", &[3, 3], &up),
                ("E", &[3, 3], &[1.0; 9]),
                ("E_se", &[3, 3], &[0.0; 9]),
                ("set", &[3], &[0.0; 3]),
                ("buried", &[3], &[0.0, 1.0, 0.0]),
            ],
        );
        compare([&baked() as &dyn AsRef<Path>, &"--reference", &path, &"--json"])
    };
    let found = write(1.0).json();
    assert_eq!((&found["unmatched"], &found["uniform"]["n"]), (&1.into(), &1.into()));
    assert!(found.get("contact").is_none());
    // From below, the floor is no surface.
    write(-1.0).refused(1, &["only 0 of the 2 points", "cornell-64.glb", "the same scene"]);
}

/// The names that build steps rely on, where people look for them.
#[test]
fn help_and_readme_name_every_option() {
    let help = compare([&"--help" as &dyn AsRef<Path>]).stdout;
    let readme = include_str!("../README.md");
    for option in OPTIONS {
        assert!(help.contains(&format!("{option} ")) || help.contains(&format!("{option}\n")), "{option}");
        assert!(readme.contains(&format!("`{option}")), "{option}");
    }
    let known = |word: &str| OPTIONS.contains(&word) || word == "--help";
    let offered = help.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
    let offered = offered.map(|word| word.trim_end_matches([':', ']', ')', ',']));
    assert_eq!(offered.filter(|word| !known(word)).collect::<Vec<_>>(), [""; 0]);
}
