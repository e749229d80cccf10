//! Gathers the models that are built into the program: all of them, but for recorded runs, which are read from disk, and
//! the scripts that made them.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    // A link to the workspace's models; a published crate has the files themselves.
    println!("cargo:rerun-if-changed=models/");
    println!("cargo:rerun-if-changed=build.rs");
    let out = env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?;
    let gathered = PathBuf::from(out).join("models");
    if gathered.exists() {
        fs::remove_dir_all(&gathered)?;
    }
    gather(&linked(Path::new("models"))?, &gathered)
}

/// Where a link leads: one that a checkout without symbolic links has left as text is read.
fn linked(path: &Path) -> io::Result<PathBuf> {
    if path.is_file() {
        return Ok(PathBuf::from(fs::read_to_string(path)?.trim_end()));
    }
    Ok(path.to_owned())
}

fn gather(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let path = entry?.path();
        let Some(name) = path.file_name() else {
            continue;
        };
        if path.is_dir() {
            if name != "recorded" {
                gather(&path, &to.join(name))?;
            }
        } else if path.extension().is_none_or(|extension| extension != "py") {
            fs::copy(&path, to.join(name))?;
        }
    }
    Ok(())
}
