//! The command line as scripts see it: exit codes, messages, what is written and what is not.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// Small enough that a bake takes no time worth counting.
const SMALL: [&str; 2] = ["--size", "32"];

/// Everything that `cobake bake` can be told.
const OPTIONS: [&str; 37] = [
    "--pages",
    "--separate",
    "--for",
    "--exr",
    "--hdr",
    "--ktx2",
    "--rgbm",
    "--preview",
    "--output",
    "--budget",
    "--size",
    "--texels-per-metre",
    "--dynamic",
    "--normals",
    "--keep-uv1",
    "--elements",
    "--threads",
    "--report",
    "--pictures",
    "--refine",
    "--direct",
    "--topology",
    "--quantity",
    "--cob-height",
    "--cob-height-fixed",
    "--subdivision-threshold",
    "--illumination-threshold",
    "--max-reflectance",
    "--no-shaft-test",
    "--no-umbra-test",
    "--unshot-fraction",
    "--gather-error",
    "--density",
    "--padding",
    "--mips",
    "--scene",
    "--quiet",
];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).join("scene.glb")
}

/// A folder that holds a scene and room for results.
struct Workplace {
    folder: TempDir,
}

impl Workplace {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::copy(fixture("cornell"), folder.path().join("in.glb")).expect("copied");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `cobake` with `words` in the folder.
    fn run(&self, words: &[&str]) -> Finished {
        self.run_program(env!("CARGO_BIN_EXE_cobake"), words)
    }

    fn run_program(&self, program: &str, words: &[&str]) -> Finished {
        let mut command = Command::new(program);
        command.args(words).current_dir(self.folder.path()).env_remove("COBAKE_LOG");
        Finished::from(command.output().expect("started"))
    }

    /// `cobake bake in.glb -o out.glb`, small, with `words` after it.
    fn bake(&self, words: &[&str]) -> Finished {
        self.run(&[&["bake", "in.glb", "-o", "out.glb"], &SMALL[..], words].concat())
    }

    /// The names of what lies in the folder, sorted.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("listed");
        let mut names: Vec<_> =
            entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn report(&self) -> serde_json::Value {
        let text = std::fs::read_to_string(self.path("report.json")).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    }
}

struct Finished {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl From<Output> for Finished {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).expect("UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    }
}

impl Finished {
    /// Failed with `code`, saying all of `words` in one chain, with nothing on stdout.
    #[track_caller]
    fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        assert_eq!(self.stdout, "");
        assert!(self.stderr.starts_with("error: "), "{}", self.stderr);
        for word in words {
            assert!(self.stderr.contains(word), "no {word:?} in: {}", self.stderr);
        }
    }

    #[track_caller]
    fn done(&self) {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        assert_eq!(self.stdout, "", "stdout stays clean");
    }
}

#[test]
fn help_and_version_go_to_stdout() {
    let work = Workplace::new();
    for words in [&["--help"][..], &["bake", "--help"], &["--version"]] {
        let finished = work.run(words);
        assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "{words:?}");
        assert!(!finished.stdout.is_empty(), "{words:?}");
    }
    let version = work.run(&["--version"]).stdout;
    assert_eq!(version.trim(), concat!("cobake ", env!("CARGO_PKG_VERSION")));
}

/// The names that build steps rely on, where people look for them.
#[test]
fn help_and_readme_name_every_option() {
    let help = Workplace::new().run(&["bake", "--help"]).stdout;
    let readme = include_str!("../README.md");
    for option in OPTIONS {
        assert!(help.contains(&format!("{option} ")) || help.contains(&format!("{option}\n")), "{option}");
        assert!(readme.contains(&format!("`{option}")), "{option}");
    }
    let known = |word: &str| OPTIONS.contains(&word) || word == "--help";
    let offered = help.split_whitespace().filter(|word| word.starts_with("--"));
    assert_eq!(offered.filter(|word| !known(word)).collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn readme_names_every_key_of_the_report() {
    let work = Workplace::new();
    work.bake(&["--report", "report.json"]).done();
    let readme = include_str!("../README.md");
    for key in work.report().as_object().expect("an object").keys() {
        assert!(readme.contains(&format!("`{key}`")), "{key}");
    }
}

#[test]
fn cargo_subcommand_is_the_same_program() {
    let work = Workplace::new();
    let cargo_cobake = env!("CARGO_BIN_EXE_cargo-cobake");
    // `cargo cobake bake …` arrives as `cargo-cobake cobake bake …`.
    let words = ["cobake", "bake", "in.glb", "-o", "out.glb", "--size", "32", "--quiet"];
    work.run_program(cargo_cobake, &words).done();
    assert!(work.path("out.glb").is_file());
    let help = work.run_program(cargo_cobake, &["cobake", "bake", "--help"]).stdout;
    assert!(help.contains("Usage: cargo cobake bake"), "{help}");
}

#[test]
fn nothing_typed_is_wrong_use() {
    let finished = Workplace::new().run(&[]);
    assert_eq!(finished.code, Some(2));
    assert_eq!(finished.stdout, "");
    assert!(finished.stderr.contains("Usage: cobake"), "{}", finished.stderr);
}

#[test]
fn words_that_make_no_sense_are_wrong_use() {
    let work = Workplace::new();
    work.run(&["bake", "in.glb"]).refused(2, &["--output"]);
    work.run(&["bake", "-o", "out.glb"]).refused(2, &["IN"]);
    work.run(&["toast", "in.glb"]).refused(2, &["toast"]);
    work.bake(&["--refine", "magic"]).refused(2, &["magic", "cob+gradient"]);
    work.bake(&["--threads", "many"]).refused(2, &["many", "--threads"]);
    work.bake(&["--texels-per-metre", "10"]).refused(2, &["--size", "--texels-per-metre"]);
    work.bake(&["--cob-height", "1", "--cob-height-fixed", "1"]).refused(2, &["--cob-height-fixed"]);
    assert_eq!(work.names(), ["in.glb"]);
}

#[test]
fn options_out_of_range_are_wrong_use() {
    let work = Workplace::new();
    for (option, value) in [
        ("illumination-threshold", "0"),
        ("illumination-threshold", "-1"),
        ("illumination-threshold", "nan"),
        ("max-reflectance", "1"),
        ("unshot-fraction", "1"),
        ("subdivision-threshold", "0"),
        ("cob-height", "inf"),
        ("cob-height-fixed", "-0.1"),
        ("padding", "17"),
        ("threads", "1025"),
    ] {
        work.bake(&[&format!("--{option}"), value]).refused(2, &[option, "must be"]);
    }
    work.run(&["bake", "in.glb", "-o", "out.glb", "--size", "15"]).refused(2, &["size", "16"]);
    assert_eq!(work.names(), ["in.glb"]);
}

#[test]
fn missing_input_is_named() {
    let work = Workplace::new();
    work.run(&["bake", "gone.glb", "-o", "out.glb"]).refused(1, &["gone.glb", "caused by: "]);
    work.run(&["bake", ".", "-o", "out.glb"]).refused(1, &["is a folder"]);
    assert_eq!(work.names(), ["in.glb"]);
}

#[test]
fn output_may_not_replace_the_input() {
    let work = Workplace::new();
    let before = std::fs::read(work.path("in.glb")).expect("read");
    work.run(&["bake", "in.glb", "-o", "in.glb"]).refused(2, &["replace the input"]);
    work.run(&["bake", "in.glb", "-o", "./in.glb"]).refused(2, &["replace the input"]);
    work.bake(&["--report", "in.glb"]).refused(2, &["replace the input"]);
    work.bake(&["--report", "out.glb"]).refused(2, &["replace the output"]);
    assert_eq!(std::fs::read(work.path("in.glb")).expect("read"), before);
    assert_eq!(work.names(), ["in.glb"]);
}

/// Found out before the bake, not after it.
#[test]
fn places_that_cannot_be_written_to_are_refused_first() {
    let work = Workplace::new();
    work.run(&["bake", "in.glb", "-o", "gone/out.glb"]).refused(1, &["gone/out.glb", "does not exist"]);
    work.run(&["bake", "in.glb", "-o", "in.glb/out.glb"]).refused(1, &["in.glb/out.glb"]);
    work.run(&["bake", "in.glb", "-o", "."]).refused(1, &["not a file"]);
    work.bake(&["--report", "gone/report.json"]).refused(1, &["gone/report.json", "does not exist"]);
    work.bake(&["--pictures", "in.glb"]).refused(1, &["in.glb"]);
    assert_eq!(work.names(), ["in.glb"]);
}

#[test]
fn files_that_are_no_scene_are_refused() {
    let work = Workplace::new();
    std::fs::write(work.path("empty.glb"), b"").expect("written");
    std::fs::write(work.path("letter.glb"), b"Dear baker, this is no scene.").expect("written");
    for name in ["empty.glb", "letter.glb"] {
        work.run(&["bake", name, "-o", "out.glb"]).refused(1, &["cannot bake", name, "caused by: "]);
    }
    assert!(!work.path("out.glb").exists());
}

#[test]
fn bake_writes_a_glb_and_nothing_else() {
    let work = Workplace::new();
    work.bake(&[]).done();
    assert_eq!(work.names(), ["in.glb", "out.glb"]);
    assert!(std::fs::read(work.path("out.glb")).expect("read").starts_with(b"glTF"));
}

/// The lightmap's own files hold what the output's EXR holds; none is written where one cannot be.
#[test]
fn sidecars_lie_beside_the_output() {
    let work = Workplace::new();
    work.bake(&["--exr", "a.exr", "--hdr", "a.hdr", "--ktx2", "a.ktx2", "--rgbm", "a.png"]).done();
    assert_eq!(work.names(), ["a.exr", "a.hdr", "a.ktx2", "a.png", "in.glb", "out.glb"]);
    let (exr, glb) = (std::fs::read(work.path("a.exr")).expect("read"), std::fs::read(work.path("out.glb")));
    assert!(glb.expect("read").windows(exr.len()).any(|window| window == exr), "the same bytes");

    let work = Workplace::new();
    work.bake(&["--exr", "in.glb"]).refused(2, &["--exr", "replace the input"]);
    work.bake(&["--hdr", "out.glb"]).refused(2, &["--hdr", "replace the output"]);
    work.bake(&["--hdr", "a", "--rgbm", "./a"]).refused(2, &["--rgbm", "--hdr"]);
    work.bake(&["--ktx2", "gone/a.ktx2"]).refused(1, &["gone/a.ktx2", "does not exist"]);
    assert_eq!(work.names(), ["in.glb"]);
}

#[test]
fn engines_get_their_files() {
    let work = Workplace::new();
    work.bake(&["--for", "bevy", "--report", "report.json"]).done();
    assert_eq!(work.names(), ["in.glb", "out.glb", "out.ktx2", "report.json"]);
    assert_eq!(work.report()["options"]["quantity"], "radiance");

    let work = Workplace::new();
    let finished = work.bake(&["--for", "unity", "--quantity", "irradiance", "--exr", "light.exr"]);
    finished.done();
    assert!(finished.stderr.contains("unity reads radiance"), "{}", finished.stderr);
    assert_eq!(work.names(), ["in.glb", "light.exr", "out.glb"]);

    let work = Workplace::new();
    work.bake(&["--for", "quake"]).refused(2, &["quake", "bevy"]);
    work.bake(&["--for", "bevy", "--preview", "unlit"]).refused(2, &["--preview"]);
    std::fs::create_dir(work.path("out.ktx2")).expect("made");
    work.bake(&["--for", "bevy"]).refused(1, &["out.ktx2", "not a file"]);
    assert!(!work.path("out.glb").exists());
}

/// Text, buffer and images are the GLB in several files; and no file that the input uses is written over.
#[test]
fn separate_files_are_the_same_scene() {
    let work = Workplace::new();
    work.bake(&[]).done();
    let bake = |input: &str, output: &str, words: &[&str]| {
        work.run(&[&["bake", input, "-o", output], &SMALL[..], words].concat())
    };
    bake("in.glb", "a b.gltf", &["--separate"]).done();
    let names = ["a b-lightmap0.png", "a b.bin", "a b.gltf", "in.glb", "out.glb"];
    assert_eq!(work.names(), names);
    let compared = work.run(&["compare", "out.glb", "a b.gltf", "--fail-above", "0.000001"]);
    assert_eq!(compared.code, Some(0), "{}", compared.stderr);
    let (text, _, pictures) = gltf::import(work.path("a b.gltf")).expect("read");
    let (glb, _, same) = gltf::import(work.path("out.glb")).expect("read");
    assert_eq!(pictures[0].pixels, same[0].pixels);
    assert_eq!(text.views().count() + 1, glb.views().count(), "the picture has left the buffer");

    bake("a b.gltf", "a b.glb", &["--exr", "a b.bin"]).refused(2, &["--exr", "input's file", "a b.bin"]);
    bake("a b.gltf", "a b.gltf", &["--separate"]).refused(2, &["replace the input"]);
    bake("in.glb", "x.glb", &["--separate"]).refused(2, &["--separate", ".gltf"]);
    bake("in.glb", "x.gltf", &["--separate", "--exr", "x.bin"]).refused(2, &["-o", "--exr"]);
    assert_eq!(work.names(), names);

    // Of another folder's file of the same name, or an older bake's, there is nothing to fear.
    bake("a b.gltf", "c.gltf", &["--separate"]).done();
    assert!(work.path("c.bin").is_file() && work.path("c-lightmap0.png").is_file());
}

#[test]
fn old_output_is_replaced() {
    let work = Workplace::new();
    std::fs::write(work.path("out.glb"), b"old").expect("written");
    work.bake(&[]).done();
    assert!(std::fs::read(work.path("out.glb")).expect("read").starts_with(b"glTF"));
}

/// Stderr holds warnings at most where nobody is watching, and nothing with `--quiet`.
#[test]
fn nothing_is_drawn_where_nobody_watches() {
    let work = Workplace::new();
    let finished = work.bake(&[]);
    assert!(finished.stderr.lines().all(|line| line.starts_with("warning: ")), "{}", finished.stderr);
    assert_eq!(work.bake(&["--quiet"]).stderr, "");
}

#[test]
fn every_warning_of_the_report_is_on_stderr() {
    let work = Workplace::new();
    let finished = work.bake(&["--report", "report.json"]);
    for warning in work.report()["warnings"].as_array().expect("a list") {
        let warning = warning.as_str().expect("text");
        assert!(finished.stderr.contains(warning), "{warning}");
    }
}

/// Charts, benches and build steps read these.
#[test]
fn report_has_its_keys_and_says_what_was_typed() {
    let work = Workplace::new();
    work.bake(&["--report", "report.json", "--refine", "cob", "--threads", "1"]).done();
    let report = work.report();
    for pointer in [
        "/peak_memory_bytes",
        "/elements/initial",
        "/elements/final",
        "/elements/splits/cob",
        "/cob/uninitialized",
        "/cob/empty",
        "/cob/not_empty",
        "/cob/bytes_per_empty",
        "/cob/bytes_total",
        "/cob/seconds",
        "/cob/splits",
        "/cob/splits_saved_by_shaft",
        "/shots",
        "/rays",
        "/texels/covered",
        "/texels/evaluated",
        "/texels/dilated",
    ] {
        assert!(report.pointer(pointer).is_some(), "{pointer}");
    }
    for channel in ["emitted", "absorbed", "escaped", "unshot"] {
        assert_eq!(report["energy"][channel].as_array().map(Vec::len), Some(3), "{channel}");
    }
    assert!(report["warnings"].is_array());
    assert_eq!(report["options"]["refine"], "cob");
    assert_eq!(report["options"]["threads"], 1);
    assert_eq!(report["options"]["resolution"]["size"], 32);
}

/// The stages' times are parts of the total: none is counted twice, none is negative.
#[test]
fn stage_times_fit_into_the_total() {
    let work = Workplace::new();
    work.bake(&["--report", "report.json"]).done();
    let time = work.report()["time"].as_object().expect("an object").clone();
    let total = time["total_wall_seconds"].as_f64().expect("a number");
    let stages: Vec<f64> = time.values().filter_map(|stage| stage.get("wall_seconds")?.as_f64()).collect();
    assert!(time.contains_key("import") && time.contains_key("export"), "{time:?}");
    assert!(stages.iter().all(|&seconds| seconds >= 0.0));
    // Sums of differences of clock readings are exact to far below a microsecond.
    assert!(stages.iter().sum::<f64>() <= total + 1e-6, "{time:?}");
}

#[test]
fn pictures_are_pngs_in_a_folder_made_for_them() {
    let work = Workplace::new();
    work.bake(&["--pictures", "made/for/pictures"]).done();
    let of_surface = ["elements", "cob", "triangles", "density"].map(|what| format!("surface-1-{what}.png"));
    let of_all = ["lightmap.png", "density.png", "scene.png"].map(str::to_owned);
    for name in of_all.iter().chain(&of_surface) {
        let picture = std::fs::read(work.path("made/for/pictures").join(name)).expect("a picture");
        assert!(picture.starts_with(b"\x89PNG\r\n\x1a\n"), "{name}");
    }
}

/// Both halves of the picture of the scene show the same things, and the whole of it.
#[test]
fn the_scene_is_shown_twice() {
    let work = Workplace::new();
    work.bake(&["--pictures", "pictures"]).done();
    let picture = image::open(work.path("pictures/scene.png")).expect("a picture").into_rgb8();
    let white = |x, y| picture.get_pixel(x, y).0 == [255; 3];
    let (half, bar) = (900, 84);
    let shown: Vec<(u32, u32)> = (0..picture.height() - bar)
        .flat_map(|y| (0..half).map(move |x| (x, y)))
        .filter(|&(x, y)| !white(x, y))
        .collect();
    let other = shown.iter().filter(|&&(x, y)| !white(x + picture.width() - half, y)).count();
    assert!(shown.len() > 300_000, "{}", shown.len());
    assert!(shown.len() - other < 2_000, "{} against {other}", shown.len());
}

/// The whole of a bake: every stage ran, light was shot, texels hold it.
#[test]
fn report_tells_of_a_bake_that_lit_something() {
    let work = Workplace::new();
    work.bake(&["--report", "report.json"]).done();
    let report = work.report();
    for stage in ["import", "surfaces", "solve", "retriangulate", "unwrap", "raster", "export"] {
        assert!(report["time"][stage]["wall_seconds"].is_number(), "{stage}");
    }
    for pointer in [
        "/shots",
        "/elements/final",
        "/texels/covered",
        "/lightmap/bytes",
        "/lightmap/utilisation",
        "/scene/emitters",
    ] {
        assert!(report.pointer(pointer).and_then(serde_json::Value::as_f64) > Some(0.0), "{pointer}");
    }
    assert_eq!(report["scene"]["triangles"], 38);
    assert_eq!(report["lightmap"]["width"], 32);
}

/// Emitted light is absorbed, escapes or waits: nothing else can happen to it.
#[test]
fn energy_ledger_closes() {
    // What leaves through the open front is the rest of each row of form factors, so only rounding is left.
    const CLOSES_WITHIN: f64 = 1e-3;
    let work = Workplace::new();
    work.bake(&["--report", "report.json"]).done();
    let energy = work.report()["energy"].clone();
    for channel in 0..3 {
        let power = |name: &str| energy[name][channel].as_f64().expect("a number");
        let rest = power("emitted") - power("absorbed") - power("escaped") - power("unshot");
        assert!(power("emitted") > 0.0);
        assert!(rest.abs() <= CLOSES_WITHIN * power("emitted"), "channel {channel}: {energy}");
    }
}

#[test]
#[cfg(unix)]
fn interrupt_ends_with_130_and_leaves_nothing() {
    use std::time::{Duration, Instant};

    let work = Workplace::new();
    std::fs::copy(fixture("desk"), work.path("desk.glb")).expect("copied");
    let mut child = Command::new(env!("CARGO_BIN_EXE_cobake"))
        .args(["bake", "desk.glb", "-o", "out.glb", "--size", "4096", "--refine", "uniform"])
        .args(["--subdivision-threshold", "0.001", "--quiet"])
        .current_dir(work.folder.path())
        .spawn()
        .expect("started");
    // Long enough for the program to be up, far too short for this bake.
    std::thread::sleep(Duration::from_secs(1));
    let kill = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().expect("signalled").success());
    let asked = Instant::now();
    let status = child.wait().expect("ended");
    // The bake gets a second to notice, then the program ends without it.
    assert!(asked.elapsed() < Duration::from_secs(10));
    assert_eq!(status.code(), Some(130));
    assert_eq!(work.names(), ["desk.glb", "in.glb"]);
}

/// A small bake that lies in the repository.
fn baked() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/compare/cornell-64.glb");
    path.to_string_lossy().into_owned()
}

#[test]
fn a_page_is_written_whole_or_not_at_all() {
    let place = Workplace::new();
    place.run(&["view", "in.glb", "--out", "page.html"]).refused(1, &["in.glb", "cobake bake"]);
    place.run(&["view", &baked(), "in.glb", "--out", "page.html"]).refused(1, &["in.glb", "cobake bake"]);
    place.run(&["view", &baked(), "--out", "none/page.html"]).refused(1, &["none", "does not exist"]);
    place.run(&["view", "in.glb", "--out", "in.glb"]).refused(2, &["replace", "in.glb"]);
    place.run(&["view", "absent.glb", "--out", "page.html"]).refused(1, &["absent.glb"]);
    assert_eq!(place.names(), ["in.glb"]);

    let done = place.run(&["view", &baked(), "--out", "page.html"]);
    assert_eq!((done.code, done.stdout.as_str(), done.stderr.as_str()), (Some(0), "", ""));
    let page = std::fs::read_to_string(place.path("page.html")).expect("a page");
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
}

#[test]
fn inspect_tells_what_a_file_holds() {
    let place = Workplace::new();
    let told = place.run(&["inspect", &baked()]);
    assert_eq!(told.code, Some(0), "{}", told.stderr);
    for words in ["64 × 64 texels", "irradiance", "charts", "texels a metre", "generator"] {
        assert!(told.stdout.contains(words), "no {words:?} in {}", told.stdout);
    }
    let told = place.run(&["inspect", &baked(), "--json"]);
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON");
    assert_eq!(json["pages"][0]["width"], 64);
    assert_eq!(json["pages"][0]["quantity"], "irradiance");
    place.run(&["inspect", "in.glb"]).refused(1, &["in.glb", "cobake bake"]);
}

#[test]
fn inspect_tells_the_light_at_a_place() {
    let place = Workplace::new();
    let told = place.run(&["inspect", &baked(), "--json", "--at", "0.45,0,0.13,0,1,0"]);
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON");
    assert!(json["irradiance"][0].as_f64().is_some_and(|red| (0.7..0.9).contains(&red)), "{}", told.stdout);
    place.run(&["inspect", &baked(), "--at", "0.1,0,0.1"]).refused(2, &["6 numbers"]);
    place.run(&["inspect", &baked(), "--at", "9,9,9,0,1,0"]).refused(1, &["9,9,9"]);
}
