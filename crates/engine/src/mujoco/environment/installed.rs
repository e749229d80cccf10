//! Whether an environment still is what was installed.
//!
//! Every installed package has a `RECORD` of its files with their sizes and SHA-256 (PyPA, "Recording
//! installed projects"). All of them are hashed once, with the harness's own files and the interpreter beside
//! them; what was found is kept with each file's size and times, so that later starts only look at those. A
//! file that anybody writes to, cuts off or replaces has other ones, and is hashed again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use sha2::{Digest, Sha256};

use super::install::venv_python;

/// What was found when the files were hashed last: a line for each, `STATE SHA-256 PATH`.
const CACHE: &str = "verified";

/// Checks an environment in `folder` that has packages and our own files; says what is wrong with it.
///
/// `packages` are names and versions, as they are pinned, one for each Python; `sources` are the files of the harness's package.
pub(super) fn check(
    folder: &Path,
    packages: &[(String, String)],
    sources: &[(&str, &str)],
) -> Result<(), String> {
    let venv = folder.join("venv");
    let python = venv_python(&venv);
    // A link to an interpreter that has gone is none.
    let interpreter = fs::metadata(&python).map_err(|error| missing(&python, &error))?;
    if !interpreter.is_file() {
        return Err(format!("{} is no file", python.display()));
    }
    let known = Cache::read(&folder.join(CACHE));
    if known.is_current(folder) {
        return Ok(());
    }
    let found = hashed(folder, &venv, packages, sources, &known)?;
    // Without it the next start hashes again.
    let _ = fs::write(folder.join(CACHE), found.text());
    Ok(())
}

fn missing(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

/// Hashes everything.
fn hashed(
    folder: &Path,
    venv: &Path,
    packages: &[(String, String)],
    sources: &[(&str, &str)],
    known: &Cache,
) -> Result<Cache, String> {
    let site = site_packages(venv)?;
    let mut found = Cache::default();
    let mut check = |path: &Path, expected: Option<&str>| -> Result<Vec<u8>, String> {
        let name = relative(path, folder);
        let before = fs::metadata(path).map_err(|error| missing(path, &error))?;
        let bytes = fs::read(path).map_err(|error| missing(path, &error))?;
        let digest: [u8; 32] = Sha256::digest(&bytes).into();
        let hash = base64url(&digest);
        let recorded = expected.or_else(|| known.hash(&name));
        if recorded.is_some_and(|recorded| recorded != hash) {
            return Err(format!("{} is not what was installed", path.display()));
        }
        found.0.insert(name, (state(&before), hash));
        Ok(bytes)
    };
    check(&venv.join("pyvenv.cfg"), None)?;
    for (name, text) in sources {
        let digest: [u8; 32] = Sha256::digest(text.as_bytes()).into();
        let path = site.join("needlebench_harness").join(name);
        check(&path, Some(&base64url(&digest)))?;
    }
    let info = |(name, version): &(String, String)| {
        site.join(format!("{}-{version}.dist-info", name.replace('-', "_")))
    };
    for package in packages {
        // Of several versions of a package one is for this Python.
        let versions = || packages.iter().filter(|(name, _)| *name == package.0);
        if !versions().any(|each| info(each).is_dir()) {
            return Err(format!("{}: it is not there", info(package).display()));
        }
        if !info(package).is_dir() {
            continue;
        }
        let record = info(package).join("RECORD");
        let text = check(&record, None)?;
        let text = String::from_utf8(text)
            .map_err(|_| format!("{} is not what was installed", record.display()))?;
        let mut files = 0;
        for line in text.lines() {
            let Some((file, hash)) = entry(line) else {
                return Err(format!("{} cannot be read: {line:?}", record.display()));
            };
            // Caches of bytecode and the record itself have no hash.
            if let Some(hash) = hash {
                check(&site.join(file), Some(hash))?;
                files += 1;
            }
        }
        if files == 0 {
            return Err(format!("{} names no files", record.display()));
        }
    }
    // What was there before and is in no record any more has been taken out of one.
    let lost = known.0.keys().find(|name| !found.0.contains_key(*name));
    match lost {
        Some(name) => Err(format!("{name} is in no record any more")),
        None => Ok(found),
    }
}

/// File and hash of a line `FILE,sha256=HASH,SIZE`, the file in quotes where it has a comma.
fn entry(line: &str) -> Option<(String, Option<&str>)> {
    let (file, rest) = if let Some(quoted) = line.strip_prefix('"') {
        let end = quoted.rfind("\",")?;
        (quoted[..end].replace("\"\"", "\""), &quoted[end + 2..])
    } else {
        let (file, rest) = line.split_once(',')?;
        (file.to_owned(), rest)
    };
    let (hash, _) = rest.split_once(',')?;
    match hash {
        "" => Some((file, None)),
        hash => Some((file, Some(hash.strip_prefix("sha256=")?))),
    }
}

/// The folder of packages of an environment.
fn site_packages(venv: &Path) -> Result<PathBuf, String> {
    let windows = venv.join("Lib").join("site-packages");
    if cfg!(windows) {
        return Ok(windows);
    }
    let lib = venv.join("lib");
    let entries = fs::read_dir(&lib).map_err(|error| missing(&lib, &error))?;
    let mut folders: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path().join("site-packages"))
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    folders
        .into_iter()
        .next()
        .ok_or_else(|| format!("{} has no site-packages", lib.display()))
}

fn relative(path: &Path, folder: &Path) -> String {
    let inside = path.strip_prefix(folder).unwrap_or(path);
    inside.display().to_string()
}

/// Size and times of a file: whoever writes to it changes one of them.
fn state(metadata: &Metadata) -> String {
    let modified = metadata.modified().ok();
    let modified = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let modified = modified.map_or(0, |time| time.as_nanos());
    format!("{}:{modified}:{}", metadata.len(), changed(metadata))
}

/// When the file's entry was changed last, which nobody can set back.
#[cfg(unix)]
fn changed(metadata: &Metadata) -> String {
    use std::os::unix::fs::MetadataExt;
    format!("{}.{}", metadata.ctime(), metadata.ctime_nsec())
}

#[cfg(not(unix))]
fn changed(_: &Metadata) -> String {
    String::new()
}

/// State and hash of each file, by its path in the environment.
#[derive(Debug, Default, PartialEq, Eq)]
struct Cache(BTreeMap<String, (String, String)>);

impl Cache {
    /// None of what cannot be read.
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_default();
        let entry = |line: &str| {
            let mut words = line.splitn(3, ' ');
            let (state, hash, name) = (words.next()?, words.next()?, words.next()?);
            Some((name.to_owned(), (state.to_owned(), hash.to_owned())))
        };
        // Cut off or garbled, it is no evidence of anything.
        let entries: Option<BTreeMap<_, _>> = text.lines().map(entry).collect();
        let whole = text.ends_with('\n');
        Self(entries.filter(|_| whole).unwrap_or_default())
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (name, (state, hash)) in &self.0 {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{state} {hash} {name}");
        }
        text
    }

    fn hash(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(|(_, hash)| hash.as_str())
    }

    /// Whether there are files, and none has changed since they were hashed.
    fn is_current(&self, folder: &Path) -> bool {
        let same = |(name, (known, _)): (&String, &(String, String))| {
            fs::metadata(folder.join(name)).is_ok_and(|found| state(&found) == *known)
        };
        !self.0.is_empty() && self.0.iter().all(same)
    }
}

/// Base 64 with the alphabet for names of files, without padding (RFC 4648, section 5), as records have it.
fn base64url(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let mut bits = 0_u32;
        for at in 0..3 {
            bits = bits << 8 | u32::from(chunk.get(at).copied().unwrap_or(0));
        }
        for at in 0..=chunk.len() {
            let letter = bits >> (18 - 6 * at) & 63;
            text.push(char::from(LETTERS[letter as usize]));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10, without padding.
    #[test]
    fn base_64_is_that_of_the_standard() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg"),
            ("fo", "Zm8"),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg"),
        ] {
            assert_eq!(base64url(bytes.as_bytes()), text);
        }
        assert_eq!(base64url(&[0xfb, 0xff]), "-_8");
    }

    #[test]
    fn lines_of_records_are_read() {
        assert_eq!(
            entry("a/b.py,sha256=Zg,3"),
            Some(("a/b.py".to_owned(), Some("Zg")))
        );
        assert_eq!(entry("x/RECORD,,"), Some(("x/RECORD".to_owned(), None)));
        assert_eq!(
            entry("\"a,\"\"b\",sha256=Zg,3"),
            Some(("a,\"b".to_owned(), Some("Zg")))
        );
        assert_eq!(entry("a,md5=Zg,3"), None);
        assert_eq!(entry("half"), None);
    }

    const SOURCES: [(&str, &str); 1] = [("__init__.py", "here = True\n")];

    /// An environment with one package of two files; gives its folder and the package's.
    fn environment() -> (tempfile::TempDir, PathBuf, Vec<(String, String)>) {
        let cache = tempfile::tempdir().unwrap();
        let venv = cache.path().join("venv");
        let site = if cfg!(windows) {
            venv.join("Lib/site-packages")
        } else {
            venv.join("lib/python3.11/site-packages")
        };
        let info = site.join("tiny_one-1.0.dist-info");
        for folder in [&info, &site.join("needlebench_harness"), &site.join("tiny")] {
            fs::create_dir_all(folder).unwrap();
        }
        fs::create_dir_all(venv_python(&venv).parent().unwrap()).unwrap();
        fs::write(venv_python(&venv), "interpreter").unwrap();
        fs::write(venv.join("pyvenv.cfg"), "home = /usr/bin\n").unwrap();
        let [(name, text)] = SOURCES;
        fs::write(site.join("needlebench_harness").join(name), text).unwrap();
        let mut record = String::new();
        for (file, text) in [("tiny/a.py", "a = 1\n"), ("tiny/b.so", "\u{7f}ELF")] {
            fs::write(site.join(file), text).unwrap();
            let digest: [u8; 32] = Sha256::digest(text).into();
            let _ = writeln!(
                record,
                "{file},sha256={},{}",
                base64url(&digest),
                text.len()
            );
        }
        record += "tiny_one-1.0.dist-info/RECORD,,\n";
        fs::write(info.join("RECORD"), record).unwrap();
        (cache, site, vec![("tiny-one".to_owned(), "1.0".to_owned())])
    }

    #[test]
    fn every_file_that_is_not_what_was_installed_is_named() {
        let python = venv_python(Path::new("venv")).display().to_string();
        for cached in [false, true] {
            for file in [
                "tiny/a.py",
                "tiny/b.so",
                "needlebench_harness/__init__.py",
                &python,
            ] {
                for cut in [true, false] {
                    let (cache, site, packages) = environment();
                    let check = || check(cache.path(), &packages, &SOURCES);
                    if cached {
                        check().unwrap();
                        check().unwrap();
                    }
                    let path = if file == python {
                        cache.path().join(file)
                    } else {
                        site.join(file)
                    };
                    if cut && file != python {
                        let length = fs::metadata(&path).unwrap().len();
                        fs::File::options()
                            .write(true)
                            .open(&path)
                            .unwrap()
                            .set_len(length - 1)
                            .unwrap();
                    } else {
                        fs::remove_file(&path).unwrap();
                    }
                    let reason = check().unwrap_err();
                    assert!(reason.contains(&path.display().to_string()), "{reason}");
                }
            }
        }
    }

    #[test]
    fn a_record_that_was_shortened_is_no_record() {
        let (cache, site, packages) = environment();
        let check = || check(cache.path(), &packages, &SOURCES);
        check().unwrap();
        let record = site.join("tiny_one-1.0.dist-info/RECORD");
        let text = fs::read_to_string(&record).unwrap();
        let (first, _) = text.split_once('\n').unwrap();
        fs::write(&record, format!("{first}\n")).unwrap();
        fs::remove_file(site.join("tiny/b.so")).unwrap();
        assert!(
            check()
                .unwrap_err()
                .contains("RECORD is not what was installed")
        );
    }

    #[test]
    fn bytes_changed_in_place_are_found_although_the_size_is_the_same() {
        let (cache, site, packages) = environment();
        let check = || check(cache.path(), &packages, &SOURCES);
        check().unwrap();
        fs::write(site.join("tiny/a.py"), "a = 2\n").unwrap();
        assert!(
            check()
                .unwrap_err()
                .contains("a.py is not what was installed")
        );
    }
}
