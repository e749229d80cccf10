//! Files for ROS's `xacro`, which the program of that name expands to a URDF.
//!
//! Nothing of ROS has to be installed but that program: packages of `--package-path`, and the package that the file is
//! in, are found by it though no ROS knows them. What it needs for that is in a temporary folder.

use std::env;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use needlebench_input::{Expanded, Finding, PackagePaths, sha256_hex};

/// Longest time that an expansion may take. ROS's description of a UR arm takes a third of a second.
const LONGEST: Duration = Duration::from_mins(1);
/// Largest text that is read of it, as of every URDF.
const MOST_BYTES: u64 = 16 << 20;
/// Lines of its complaint that are shown.
const COMPLAINT_LINES: usize = 12;

/// How `$(find NAME)` is answered: ROS 2's program asks this module of Python's, which no one but ROS installs. It knows
/// the packages of this call, and for others what the installed one knows: the index below `AMENT_PREFIX_PATH`.
const FINDER: &str = r#"import os

PACKAGES = @PACKAGES@


class PackageNotFoundError(KeyError):
    pass


def get_package_share_directory(package_name, print_warning=True):
    if package_name in PACKAGES:
        return PACKAGES[package_name]
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        index = os.path.join(prefix, "share", "ament_index", "resource_index", "packages", package_name)
        if prefix and os.path.isfile(index):
            return os.path.join(prefix, "share", package_name)
    raise PackageNotFoundError("the folder of package '%s' is not known" % package_name)
"#;

/// Whether a file is one for `xacro`, by its name.
pub(crate) fn is_xacro(file: &Path) -> bool {
    let extension = file.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("xacro"))
}

/// The text that `xacro` makes of a file, with arguments `NAME:=VALUE`.
///
/// # Errors
/// An argument that is none, no such program, or why it made no text.
pub(crate) fn expand(
    file: &Path,
    arguments: &[String],
    packages: &PackagePaths,
) -> Result<Expanded, Finding> {
    for argument in arguments {
        check_argument(argument)?;
    }
    let Some(program) = program() else {
        let line = line_to_type(file, arguments);
        return Err(finding(
            file,
            "this is a xacro file, and no program `xacro` is on the PATH to expand it",
        )
        .hint(format!(
            "install it (pip install xacro), or expand the file elsewhere: {line} > robot.urdf, then --robot robot.urdf"
        )));
    };
    let environment = |error: std::io::Error| {
        finding(file, format!("cannot prepare a folder for xacro: {error}"))
            .hint("it is made in the system's temporary folder, TMPDIR")
    };
    let folder = tempfile::tempdir().map_err(environment)?;
    let python = folder.path().join("python");
    write_finder(&python, packages).map_err(environment)?;
    let [output, complaint] = ["output", "complaint"].map(|name| folder.path().join(name));
    let mut command = Command::new(&program);
    command
        .arg(file)
        .args(arguments)
        .env("PYTHONPATH", before("PYTHONPATH", [python]))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        // Where ROS 1's program looks for packages.
        .env(
            "ROS_PACKAGE_PATH",
            before(
                "ROS_PACKAGE_PATH",
                packages.iter().map(|(_, path)| path.to_owned()),
            ),
        )
        .stdin(Stdio::null())
        .stdout(File::create(&output).map_err(environment)?)
        .stderr(File::create(&complaint).map_err(environment)?);
    let line = line_to_type(file, arguments);
    let failed = |why: String| {
        let told = told_by(&complaint);
        let message = format!("xacro made no URDF of it: {why}{told}");
        finding(file, message).hint(format!("the line that was run: {line}"))
    };
    let status = run(&mut command, &output, LONGEST).map_err(&failed)?;
    if !status.success() {
        return Err(failed(status.to_string()));
    }
    let text = fs::read(&output).map_err(|error| failed(error.to_string()))?;
    if text.iter().all(u8::is_ascii_whitespace) {
        return Err(failed("it wrote nothing".to_owned()));
    }
    let note = format!(
        "the URDF is what {} made of {} with {}: SHA-256 {}",
        program.display(),
        file.display(),
        match arguments {
            [] => "no arguments".to_owned(),
            some => some.join(" "),
        },
        sha256_hex(&text)
    );
    let path = file.to_owned();
    Ok(Expanded { path, text, note })
}

/// # Errors
/// What is no `NAME:=VALUE`: an option of the program, or a slip.
fn check_argument(argument: &str) -> Result<(), Finding> {
    let is_name = |name: &str| {
        let mut letters = name.chars();
        letters
            .next()
            .is_some_and(|first| first.is_alphabetic() || first == '_')
            && letters.all(|letter| letter.is_alphanumeric() || letter == '_')
    };
    if argument
        .split_once(":=")
        .is_some_and(|(name, _)| is_name(name))
    {
        return Ok(());
    }
    let message = format!("`{argument}` is not NAME:=VALUE");
    Err(Finding::new("--xacro", message).hint("for example --xacro ur_type:=ur10e"))
}

fn finding(file: &Path, message: impl Into<String>) -> Finding {
    Finding::new(file.display().to_string(), message)
}

fn line_to_type(file: &Path, arguments: &[String]) -> String {
    let words = std::iter::once(file.display().to_string()).chain(arguments.iter().cloned());
    words.fold("xacro".to_owned(), |line, word| line + " " + &word)
}

/// The program as the PATH has it.
fn program() -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    let names = if cfg!(windows) {
        ["xacro.exe", "xacro.bat"].as_slice()
    } else {
        ["xacro"].as_slice()
    };
    let mut files = env::split_paths(&path).flat_map(|folder| {
        let here = names.iter().map(|name| folder.join(name));
        here.collect::<Vec<PathBuf>>()
    });
    files.find(|file| is_executable(file))
}

#[cfg(unix)]
fn is_executable(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    let metadata = fs::metadata(file);
    metadata.is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_executable(file: &Path) -> bool {
    file.is_file()
}

/// A variable of paths, with others before those that it has.
fn before(variable: &str, first: impl IntoIterator<Item = PathBuf>) -> OsString {
    let old = env::var_os(variable).unwrap_or_default();
    let old = env::split_paths(&old).filter(|path| !path.as_os_str().is_empty());
    let paths: Vec<PathBuf> = first.into_iter().chain(old).collect();
    // A path with the separator in its name cannot be said.
    env::join_paths(&paths).unwrap_or_default()
}

/// Writes the module that answers `$(find NAME)`.
fn write_finder(python: &Path, packages: &PackagePaths) -> std::io::Result<()> {
    let mut table = serde_json::Map::new();
    for (name, folder) in packages.iter() {
        let folder = folder.canonicalize()?;
        table.insert(name.to_owned(), folder.display().to_string().into());
    }
    let module = python.join("ament_index_python");
    fs::create_dir_all(&module)?;
    fs::write(module.join("__init__.py"), "")?;
    // A JSON object of texts is one of Python's too.
    let table = serde_json::Value::Object(table).to_string();
    fs::write(
        module.join("packages.py"),
        FINDER.replace("@PACKAGES@", &table),
    )
}

/// Runs a command to its end, unless it takes too long or writes too much.
fn run(command: &mut Command, output: &Path, limit: Duration) -> Result<ExitStatus, String> {
    let mut child = command
        .spawn()
        .map_err(|error| format!("it cannot be started: {error}"))?;
    let started = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status),
            Ok(None) => {}
            Err(error) => return Err(error.to_string()),
        }
        if started.elapsed() > limit {
            stop(&mut child);
            return Err(format!(
                "it took longer than {} s and was stopped",
                limit.as_secs_f64()
            ));
        }
        if fs::metadata(output).is_ok_and(|metadata| metadata.len() > MOST_BYTES) {
            stop(&mut child);
            return Err(format!(
                "it wrote more than {} MiB and was stopped",
                MOST_BYTES >> 20
            ));
        }
        thread::sleep(Duration::from_millis(5));
    }
}

fn stop(child: &mut Child) {
    // It may have ended just now; either way it is gone afterwards.
    let _ = child.kill();
    let _ = child.wait();
}

/// The last lines of a complaint, each on a line of its own.
fn told_by(complaint: &Path) -> String {
    let bytes = fs::read(complaint).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim_end)
        .filter(|line| !line.is_empty())
        .collect();
    let last = &lines[lines.len().saturating_sub(COMPLAINT_LINES)..];
    last.iter()
        .fold(String::new(), |all, line| all + "\n" + line)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_takes_too_long_is_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new("sleep");
        let started = Instant::now();
        let error = run(
            command.arg("30"),
            &folder.path().join("none"),
            Duration::from_millis(50),
        );
        assert!(error.unwrap_err().contains("longer than 0.05 s"));
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn what_writes_too_much_is_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("output");
        let mut command = Command::new("yes");
        command.stdout(File::create(&output).unwrap());
        let error = run(&mut command, &output, LONGEST).unwrap_err();
        assert!(error.contains("more than 16 MiB"), "{error}");
    }

    #[test]
    fn an_argument_has_a_name_and_a_value() {
        for good in ["ur_type:=ur10e", "name:=", "_x:=a b", "x:=:="] {
            check_argument(good).unwrap();
        }
        for bad in ["ur_type=ur10e", "-o:=x", "--output:=x", ":=x", "a b:=x", ""] {
            let finding = check_argument(bad).unwrap_err();
            assert_eq!(finding.file, "--xacro");
        }
    }

    #[test]
    fn the_last_lines_of_a_complaint_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("complaint");
        let lines: Vec<String> = (0..40).map(|k| format!("line {k}\n\n")).collect();
        fs::write(&file, lines.concat()).unwrap();
        let told = told_by(&file);
        assert!(
            told.starts_with("\nline 28\n") && told.ends_with("\nline 39"),
            "{told}"
        );
        assert_eq!(told_by(&folder.path().join("none")), "");
    }
}
