//! Writing the finished file: it arrives whole or not at all.

use std::fs;

use cobake::export::{ExportError, WrittenFile, encode, write, write_all, write_whole};

use crate::fixture::{Results, document};

fn names(folder: &std::path::Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// A link stays a link; what it points to is replaced.
#[cfg(unix)]
#[test]
fn links_are_followed() {
    let folder = tempfile::tempdir().unwrap();
    let glb = encode(&Results::of(document()).baked()).unwrap();
    let (file, link) = (folder.path().join("file.glb"), folder.path().join("link.glb"));
    fs::write(&file, "old").unwrap();
    std::os::unix::fs::symlink("file.glb", &link).unwrap();
    write(&link, &glb).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&file).unwrap(), glb);
}

#[test]
fn files_are_replaced_whole() {
    let folder = tempfile::tempdir().unwrap();
    let glb = encode(&Results::of(document()).baked()).unwrap();
    let path = folder.path().join("out.glb");
    fs::write(&path, "old").unwrap();
    write(&path, &glb).unwrap();
    assert_eq!(fs::read(&path).unwrap(), glb);
    assert_eq!(names(folder.path()), ["out.glb"]);
}

/// A temporary file is private; what becomes of it is not.
#[cfg(unix)]
#[test]
fn files_are_as_readable_as_any_new_file() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let mode = |path: &std::path::Path| fs::metadata(path).unwrap().permissions().mode();
    let (whole, plain) = (folder.path().join("whole"), folder.path().join("plain"));
    write_whole(&whole, b"x").unwrap();
    fs::write(&plain, b"x").unwrap();
    assert_eq!(mode(&whole), mode(&plain));
}

/// A bad document changes nothing, a folder or a missing place is named, and nothing is left behind.
#[test]
fn failures_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let glb = encode(&Results::of(document()).baked()).unwrap();
    let path = folder.path().join("out.glb");
    fs::write(&path, "old").unwrap();
    assert!(write(&path, &glb[..glb.len() - 8]).is_err());
    assert!(write(&path, b"glTF").is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");

    let inside = folder.path().join("inside");
    fs::create_dir(&inside).unwrap();
    assert!(matches!(write(&inside, &glb), Err(ExportError::NotAFile { .. })));
    let missing = folder.path().join("none/out.glb");
    let message = write(&missing, &glb).unwrap_err().to_string();
    assert!(message.contains("none") && message.contains("create it"), "{message}");
    #[cfg(target_os = "linux")]
    {
        let device = write(std::path::Path::new("/dev/null"), &glb);
        assert!(matches!(device, Err(ExportError::NotAFile { .. })), "{device:?}");
        // A folder that not even the system's owner can create files in.
        let closed = write(std::path::Path::new("/proc/out.glb"), &glb);
        assert!(matches!(closed, Err(ExportError::Create { .. })), "{closed:?}");
    }
    let long = folder.path().join(format!("{}.glb", "x".repeat(300)));
    assert!(write(&long, &glb).is_err());
    assert_eq!(names(folder.path()), ["inside", "out.glb"]);
    assert!(names(&inside).is_empty());
}

/// glTF text carries its buffer inside and reads like the GLB.
#[test]
fn gltf_text_is_self_contained() {
    let folder = tempfile::tempdir().unwrap();
    let glb = encode(&Results::of(document()).baked()).unwrap();
    let path = folder.path().join("out.gltf");
    write(&path, &glb).unwrap();
    let (_, from_text, pictures) = gltf::import(&path).unwrap();
    let (_, from_glb, _) = gltf::import_slice(&glb).unwrap();
    assert_eq!(from_text[0].0, from_glb[0].0);
    assert_eq!(pictures.len(), 2);
    assert_eq!(names(folder.path()), ["out.gltf"]);
}

/// Where the last of several files cannot take its name, the others are as they were before.
#[test]
fn several_files_arrive_together_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| WrittenFile { path: folder.path().join(name), bytes: b"new".to_vec() };
    fs::write(folder.path().join("old"), "old").unwrap();
    let fails = [file("none/first"), file("old"), file("fresh")];
    assert!(write_all(&fails).is_err());
    assert_eq!(
        (names(folder.path()), fs::read(&fails[1].path).unwrap()),
        (vec!["old".into()], b"old".to_vec())
    );

    // A name that is too long shows only when the others have theirs.
    let long = WrittenFile { path: folder.path().join("x".repeat(300)), bytes: b"new".to_vec() };
    assert!(write_all(&[long, file("old"), file("fresh")]).is_err());
    assert_eq!(
        (names(folder.path()), fs::read(&fails[1].path).unwrap()),
        (vec!["old".into()], b"old".to_vec())
    );

    write_all(&[file("first"), file("old"), file("fresh")]).unwrap();
    assert_eq!(names(folder.path()), ["first", "fresh", "old"]);
    assert_eq!(fs::read(&fails[1].path).unwrap(), b"new");
}
