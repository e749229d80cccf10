use super::*;

#[test]
fn quotes_keep_blanks_in_a_word() {
    assert_eq!(
        split_words(r#" "C:\my python\python.exe"  -c "" x"#),
        [r"C:\my python\python.exe", "-c", "", "x"]
    );
    assert!(split_words("  ").is_empty());
}

#[test]
fn every_source_of_the_harness_is_carried() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("harness/needlebench_harness");
    let mut on_disk: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "py"))
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    on_disk.sort();
    assert_eq!(on_disk, SOURCES.map(|(name, _)| name));
}

#[test]
fn lock_pins_the_version_that_is_verified() {
    assert!(REQUIREMENTS.contains(&format!("mujoco-core=={MUJOCO_VERSION} ")));
}

#[test]
fn lock_names_no_host() {
    assert!(!REQUIREMENTS.contains("://"));
}

#[test]
fn key_depends_on_the_python() {
    let python = |version: &str| Python {
        executable: PathBuf::from("/p"),
        version: version.to_owned(),
        wheels: version.parse().unwrap(),
    };
    assert_eq!(key(&python("3.11.7")), key(&python("3.11.7")));
    assert_ne!(key(&python("3.11.7")), key(&python("3.11.8")));
}

/// Writes a wheel of an empty package, and returns its path and hash.
fn tiny_wheel(folder: &Path, python: &Python) -> (PathBuf, String) {
    const WRITE: &str = "
import sys, zipfile
info = 'tiny-1.0.dist-info/'
with zipfile.ZipFile(sys.argv[1], 'w') as wheel:
    wheel.writestr('tiny.py', 'here = True\\n')
    wheel.writestr(info + 'METADATA', 'Metadata-Version: 2.1\\nName: tiny\\nVersion: 1.0\\n')
    wheel.writestr(info + 'WHEEL', 'Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n')
    wheel.writestr(info + 'RECORD', 'tiny.py,,\\n')
";
    let wheel = folder.join("tiny-1.0-py3-none-any.whl");
    let mut command = Command::new(&python.executable);
    command.args(["-I", "-c", WRITE]).arg(&wheel);
    command::run(&mut command, VERIFY_LIMIT).unwrap();
    let sha256 = hex(&Sha256::digest(fs::read(&wheel).unwrap()));
    (wheel, sha256)
}

#[test]
fn package_with_another_hash_than_the_lock_says_is_refused() {
    let python = python::find(&EnvironmentOptions::from_process()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let venv = folder.path().join("venv");
    install::make_venv(&python, &venv).unwrap();
    let venv_python = install::venv_python(&venv);
    let pip = install::write_pip(folder.path(), install::PIP_WHEEL).unwrap();
    let (wheel, sha256) = tiny_wheel(folder.path(), &python);
    let requirements = folder.path().join("requirements.lock");
    let install = |hash: &str| {
        let line = format!("{} --hash=sha256:{hash}\n", wheel.display());
        fs::write(&requirements, line).unwrap();
        install::install_with_pip(&pip, &venv_python, &requirements, None)
    };
    let import = || {
        let mut command = Command::new(&venv_python);
        command::run(command.args(["-I", "-c", "import tiny"]), VERIFY_LIMIT)
    };

    let Err(CommandFailure::Exit { stderr_tail, .. }) = install(&"0".repeat(64)) else {
        panic!("a wrong hash was accepted");
    };
    assert!(stderr_tail.contains("HASHES"), "{stderr_tail}");
    assert!(import().is_err());

    install(&sha256).unwrap();
    import().unwrap();
}
