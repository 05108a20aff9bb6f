//! Where results go, checked before the work that they take.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use cobake::export::referenced_files;
use tempfile::NamedTempFile;

use super::failure::WrongUse;

/// The files of one command.
#[derive(Debug)]
pub(crate) struct Files<'a> {
    /// What is read.
    pub(crate) input: &'a Path,
    /// The scene that is written.
    pub(crate) output: &'a Path,
    /// The report that is written.
    pub(crate) report: Option<&'a Path>,
    /// The folder into which pictures are written.
    pub(crate) pictures: Option<&'a Path>,
    /// The lightmap's own files: the option that asks for each, and its place.
    pub(crate) sidecars: &'a [(&'static str, PathBuf)],
}

impl Files<'_> {
    /// Finds out before the work what would fail after it.
    ///
    /// Wrong use: a result would replace the input or another result. Failures: the input cannot be
    /// read, a result's folder is missing or cannot be written to.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        self.check_distinct()?;
        check_input(self.input)?;
        check_target(self.output)?;
        self.sidecars.iter().try_for_each(|(_, path)| check_target(path))?;
        self.report.map_or(Ok(()), check_target)?;
        self.pictures.map_or(Ok(()), check_picture_folder)
    }

    /// Every result by the name and the option that the user knows it by.
    fn results(&self) -> Vec<(String, &'static str, &Path)> {
        let mut results = vec![("output".to_owned(), "-o", self.output)];
        results.extend(self.report.map(|path| ("report".to_owned(), "--report", path)));
        for (option, path) in self.sidecars {
            results.push((format!("file of {option}"), *option, path));
        }
        results
    }

    fn check_distinct(&self) -> anyhow::Result<()> {
        let mut known = vec![("input".to_owned(), identity(self.input))];
        let used = referenced_files(self.input);
        known.extend(used.iter().map(|file| (format!("input's file {}", file.display()), identity(file))));
        for (name, option, path) in self.results() {
            let identity = identity(path);
            if let Some((other, _)) = known.iter().find(|(_, known)| *known == identity) {
                let message = format!("the {name} would replace the {other}; give {option} another name");
                return Err(WrongUse(message).into());
            }
            known.push((name, identity));
        }
        Ok(())
    }
}

/// Finds out before the work whether its one result, called `name`, can be written without replacing an input.
pub(crate) fn check_result(name: &str, result: &Path, inputs: &[&Path]) -> anyhow::Result<()> {
    if let Some(input) = inputs.iter().find(|input| identity(input) == identity(result)) {
        let message = format!("{name} would replace {}; give it another name", input.display());
        return Err(WrongUse(message).into());
    }
    check_target(result)
}

/// What tells whether two paths lead to one file, existing or not: links resolved as far as the path exists.
fn identity(path: &Path) -> PathBuf {
    if let Ok(found) = fs::canonicalize(path) {
        return found;
    }
    let name = path.file_name().map_or_else(OsString::new, OsString::from);
    fs::canonicalize(folder_of(path)).unwrap_or_else(|_| folder_of(path).to_owned()).join(name)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn check_input(path: &Path) -> anyhow::Result<()> {
    let cannot = || format!("cannot read {}", path.display());
    if fs::metadata(path).with_context(cannot)?.is_dir() {
        bail!("{} is a folder; name a .gltf or .glb file", path.display());
    }
    fs::File::open(path).with_context(cannot)?;
    Ok(())
}

/// Whether a file can be put in `path`'s place.
fn check_target(path: &Path) -> anyhow::Result<()> {
    match fs::metadata(path) {
        Ok(found) if !found.is_file() => bail!("cannot write {}: it is not a file", path.display()),
        _ => {}
    }
    temporary_beside(path).map(drop).with_context(|| format!("cannot write {}", path.display()))
}

/// Whether `folder` can be made, or written to where it is already there. Makes nothing.
fn check_picture_folder(folder: &Path) -> anyhow::Result<()> {
    let nearest = folder.ancestors().find(|f| !f.as_os_str().is_empty() && f.exists());
    let nearest = nearest.unwrap_or_else(|| Path::new("."));
    temporary_in(nearest).map(drop).with_context(|| format!("cannot write into {}", folder.display()))
}

fn temporary_beside(path: &Path) -> anyhow::Result<NamedTempFile> {
    temporary_in(folder_of(path))
}

fn temporary_in(folder: &Path) -> anyhow::Result<NamedTempFile> {
    match fs::metadata(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            bail!("the folder {} does not exist; make it first", folder.display())
        }
        Ok(found) if !found.is_dir() => bail!("{} is not a folder", folder.display()),
        _ => {}
    }
    Ok(tempfile::Builder::new().prefix(".cobake-").tempfile_in(folder)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_wrong_use(files: &Files<'_>) -> bool {
        files.check().expect_err("refused").is::<WrongUse>()
    }

    #[test]
    fn results_may_not_replace_the_input_or_each_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let input = folder.path().join("in.glb");
        let output = folder.path().join("out.glb");
        let detour = folder.path().join("sub").join("..").join("in.glb");
        fs::write(&input, b"glTF").expect("written");
        fs::create_dir(folder.path().join("sub")).expect("made");

        let good = Files { input: &input, output: &output, report: None, pictures: None, sidecars: &[] };
        good.check().expect("nothing wrong");
        assert!(is_wrong_use(&Files { output: &input, ..good }));
        assert!(is_wrong_use(&Files { output: &detour, ..good }));
        assert!(is_wrong_use(&Files { report: Some(&input), ..good }));
        assert!(is_wrong_use(&Files { report: Some(&output), ..good }));
        let sidecar = |path: &Path| vec![("--exr", path.to_owned())];
        for taken in [&input, &detour, &output] {
            assert!(is_wrong_use(&Files { sidecars: &sidecar(taken), ..good }));
        }
        let twice = [sidecar(&folder.path().join("a")), sidecar(&folder.path().join("a"))].concat();
        assert!(is_wrong_use(&Files { sidecars: &twice, ..good }));
        assert_eq!(fs::read(&input).expect("still there"), b"glTF");
    }

    #[test]
    fn checking_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a folder");
        let input = folder.path().join("in.glb");
        fs::write(&input, b"glTF").expect("written");
        let (output, pictures) = (folder.path().join("out.glb"), folder.path().join("a").join("b"));
        let files =
            Files { input: &input, output: &output, report: None, pictures: Some(&pictures), sidecars: &[] };
        files.check().expect("nothing wrong");
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 1);
    }

    #[test]
    fn a_file_is_no_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let input = folder.path().join("in.glb");
        fs::write(&input, b"glTF").expect("written");
        let output = input.join("out.glb");
        let good = Files { input: &input, output: &output, report: None, pictures: None, sidecars: &[] };
        assert!(good.check().is_err());
        let inside = folder.path().join("out.glb");
        assert!(Files { output: &inside, pictures: Some(&input), ..good }.check().is_err());
        assert!(Files { output: folder.path(), ..good }.check().is_err());
    }
}
