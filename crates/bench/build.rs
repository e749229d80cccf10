//! Records what the program is made of, for the provenance of results: a hash of all that computes, the git revision,
//! the lock file.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

use sha2::{Digest, Sha256};

fn main() {
    let crate_folder = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let workspace = crate_folder.join("../..");
    // A published crate lies among others, perhaps inside a repository that is none of ours.
    let in_workspace = workspace.join("crates/bench/build.rs").is_file();
    let revision = if in_workspace {
        for watched in [".git/HEAD", ".git/index", "Cargo.lock"] {
            println!(
                "cargo:rerun-if-changed={}",
                workspace.join(watched).display()
            );
        }
        of_working_tree(&workspace)
    } else {
        println!("cargo:rerun-if-changed=build.rs");
        of_package(&crate_folder)
    };
    let revision = revision.unwrap_or_else(|| "unknown".to_owned());
    println!("cargo:rustc-env=NEEDLEBENCH_GIT_REVISION={revision}");
    // Outside the workspace the versions are those of whoever builds, and nobody tells which.
    let lock = if in_workspace {
        fs::read(workspace.join("Cargo.lock")).expect("the workspace has a lock file")
    } else {
        Vec::new()
    };
    let text = String::from_utf8_lossy(&lock);
    let libm = version_of("libm", &text).unwrap_or("0.2");
    println!("cargo:rustc-env=NEEDLEBENCH_LIBM={libm}");
    fs::write(out.join("Cargo.lock"), &lock).expect("the output folder can be written");
    let source = if in_workspace {
        of_workspace(&workspace)
    } else {
        of_published(&crate_folder)
    };
    let source = source.expect("the sources that are compiled can be read");
    println!("cargo:rustc-env=NEEDLEBENCH_SOURCE_SHA256={source}");
}

/// Version of a package in a lock file.
fn version_of<'a>(package: &str, lock: &'a str) -> Option<&'a str> {
    let (_, rest) = lock.split_once(&format!("name = \"{package}\"\nversion = \""))?;
    Some(rest.split_once('"')?.0)
}

/// Hash of everything in the workspace that results depend on: this crate and those of ours that it is made of, the
/// harness of MuJoCo, the versions and features of all others, and the compiler. Models are inputs, and hashed as such.
fn of_workspace(workspace: &Path) -> io::Result<String> {
    let mut crates = BTreeSet::new();
    let mut open = vec!["bench".to_owned()];
    while let Some(name) = open.pop() {
        if !crates.insert(name.clone()) {
            continue;
        }
        let manifest = fs::read_to_string(workspace.join("crates").join(&name).join("Cargo.toml"))?;
        let (_, dependencies) = manifest.split_once("[dependencies]").unwrap_or_default();
        let dependencies = dependencies.split("\n[").next().unwrap_or_default();
        for line in dependencies.lines() {
            if let Some(rest) = line.strip_prefix("needlebench-") {
                let end = rest.find(['.', ' ', '=']).unwrap_or(rest.len());
                open.push(rest[..end].to_owned());
            }
        }
    }
    let mut files = vec![PathBuf::from("Cargo.toml"), PathBuf::from("Cargo.lock")];
    for name in &crates {
        let folder = Path::new("crates").join(name);
        for part in ["Cargo.toml", "build.rs", "src", "harness"] {
            gather(workspace, &folder.join(part), &mut files)?;
        }
    }
    hash(workspace, files)
}

/// The same of a published crate: its own sources stand for those of its sisters, whose versions it names exactly.
fn of_published(crate_folder: &Path) -> io::Result<String> {
    let mut files = Vec::new();
    for part in ["Cargo.toml", "build.rs", "src"] {
        gather(crate_folder, Path::new(part), &mut files)?;
    }
    hash(crate_folder, files)
}

/// The files under a path, but for tests and what is no text of ours.
fn gather(top: &Path, path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    const LEFT_OUT: [&str; 3] = ["tests", "tests.rs", "__pycache__"];
    const KINDS: [&str; 5] = ["rs", "toml", "py", "txt", "lock"];
    let full = top.join(path);
    // Nor what tools leave behind.
    if path.file_name().is_some_and(|name| {
        LEFT_OUT.iter().any(|each| name == *each) || name.to_string_lossy().starts_with('.')
    }) {
        return Ok(());
    }
    if full.is_dir() {
        println!("cargo:rerun-if-changed={}", full.display());
        for entry in fs::read_dir(&full)? {
            gather(top, &path.join(entry?.file_name()), files)?;
        }
    } else if full.is_file() {
        let kind = path.extension().unwrap_or_default();
        if KINDS.iter().any(|known| kind == *known) {
            files.push(path.to_owned());
        }
    }
    Ok(())
}

fn hash(top: &Path, mut files: Vec<PathBuf>) -> io::Result<String> {
    files.sort();
    let mut all = Sha256::new();
    for file in files {
        let full = top.join(&file);
        println!("cargo:rerun-if-changed={}", full.display());
        let content = fs::read(full)?;
        all.update(format!(
            "{} {}\n",
            file.to_string_lossy().replace('\\', "/"),
            content.len()
        ));
        all.update(content);
    }
    let compiler = Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
        .arg("--version")
        .output()?;
    all.update(&compiler.stdout);
    let mut text = String::new();
    for byte in all.finalize() {
        write!(text, "{byte:02x}").expect("strings take all");
    }
    Ok(text)
}

/// The revision that is checked out, and whether anything was changed since.
fn of_working_tree(workspace: &Path) -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .arg("-C")
            .arg(workspace)
            .args(arguments)
            // Or looking at the index touches it, and every build is the first.
            .env("GIT_OPTIONAL_LOCKS", "0")
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let revision = git(&["rev-parse", "--short=12", "HEAD"])?;
    // What checks write down of a program is no change of it: two builds with records in between are of one revision.
    let paths = ["--", ".", ":!.ci/evidence.lock"];
    let status = [
        &["status", "--porcelain", "--untracked-files=no"][..],
        &paths,
    ]
    .concat();
    let clean = git(&status).is_some_and(|changes| changes.is_empty());
    Some(if clean {
        revision
    } else {
        format!("{revision}-dirty")
    })
}

/// The revision that cargo packaged the crate from, which it wrote down.
fn of_package(crate_folder: &Path) -> Option<String> {
    let info = fs::read_to_string(crate_folder.join(".cargo_vcs_info.json")).ok()?;
    let (_, rest) = info.split_once("\"sha1\": \"")?;
    let revision = rest.get(..12)?;
    let is_hash = revision.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hash.then(|| {
        let dirty = if info.contains("\"dirty\": true") {
            "-dirty"
        } else {
            ""
        };
        format!("{revision}{dirty}")
    })
}
