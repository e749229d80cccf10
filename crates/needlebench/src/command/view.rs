//! `needlebench view`.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use clap::Args;
use needlebench_input::Finding;
use needlebench_parallel::Control;
use needlebench_patient::Stop;
use needlebench_patient::ct::{BuildFiles, VOLUME_FILE, imaged};
use needlebench_scenario::{Overrides, load_scenario};
use needlebench_show::layout;
use needlebench_viewer::{Case, Server, Stopper};
use tempfile::NamedTempFile;

use crate::arguments::RobotArguments;
use crate::command::results_folder::ResultsFolder;
use crate::command::{overrides, print_text};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::threads;
use crate::output::shown;
use crate::progress::TerminalProgress;

/// What `view --help` prints after the options.
pub(crate) const VIEW_HELP: &str = "\
Example: needlebench view out/patient

DIR is the output of `needlebench ct build SCAN --out DIR`. A SCENARIO with a section [ct] is scanned and built first, in
out/NAME/view. The printed address contains a secret: it alone gives access to the patient data on this machine. No
data leave the machine, and only this folder is written to: session.toml (decisions, restored at the next start),
session.lock (one program at a time), planned.toml (the plan, for `run`), runs/ (simulations started on the page) and,
while the server runs, open-*.html (redirects the browser).

Ctrl-C ends it. Not a medical device.";

#[derive(Debug, Args)]
pub(crate) struct ViewArguments {
    /// Folder written by `ct build`, or a scenario with a section [ct].
    #[arg(value_name = "DIR|SCENARIO")]
    path: PathBuf,
    /// Port on 127.0.0.1; 0 for any free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Print the address without opening it in a browser.
    #[arg(long)]
    no_open: bool,
    #[command(flatten)]
    robot: RobotArguments,
}

/// Serves the planning page until it is interrupted.
pub(crate) fn view(arguments: &ViewArguments) -> Result<ExitStatus, Failure> {
    let overrides = overrides(&arguments.robot)?;
    let cancel = Arc::new(AtomicBool::new(false));
    let stopper: Arc<std::sync::OnceLock<Stopper>> = Arc::default();
    let (requested, stops) = (Arc::clone(&cancel), Arc::clone(&stopper));
    ctrlc::set_handler(move || {
        requested.store(true, Ordering::Relaxed);
        if let Some(stopper) = stops.get() {
            stopper.stop();
        }
    })
    .context("cannot install the interrupt handler")?;
    let folder = folder(&arguments.path, &overrides, &cancel)?;
    let case = Case::open(&folder, &overrides, &cancel).map_err(stopped)?;
    let program = std::env::current_exe().context("cannot determine the path of this program")?;
    let server = Server::new(case, arguments.port, program).map_err(|error| {
        let hint = error.hint();
        let hint = hint.map_or_else(String::new, |hint| format!("\nhint: {hint}"));
        Failure::Ended {
            status: ExitStatus::EnvironmentFailed,
            message: format!("error: {error}{hint}"),
        }
    })?;
    let _ = stopper.set(server.stopper());
    // Interrupted while the folder was read: there was no server to stop.
    if cancel.load(Ordering::Relaxed) {
        return Ok(ExitStatus::Interrupted);
    }
    let url = server.url();
    print_text(&format!(
        "{url}\nplanning page of {}; Ctrl-C ends it",
        shown(&folder)
    ))?;
    let page = (!arguments.no_open).then(|| redirect(&folder, &url));
    // Without one the printed address is enough.
    let page = page.and_then(Result::ok);
    if let Some(page) = &page {
        open(page.path());
    }
    server.run();
    Ok(ExitStatus::Success)
}

fn stopped(stop: Stop) -> Failure {
    Failure::of_stop(stop, "interrupted while the scan was computed")
}

/// The folder of a patient, built if necessary.
fn folder(path: &Path, overrides: &Overrides, cancel: &AtomicBool) -> Result<PathBuf, Failure> {
    if path.is_dir() {
        return Ok(path.to_owned());
    }
    let beside = path.parent().unwrap_or(Path::new(""));
    if path.is_file() && beside.join(VOLUME_FILE).is_file() {
        return Ok(beside.to_owned());
    }
    let resolved = load_scenario(path, overrides)?;
    let name = path.display().to_string();
    if resolved.scenario.ct.is_none() {
        let finding = Finding::new(&name, "the scenario has a patient but no scan").hint(format!(
            "add a section [ct], or synthesise a scan: `needlebench ct synth {name} --markers ct-sphere --out out/ct`, then \
             `needlebench ct build out/ct/ct.nii.gz --room {name} --markers out/ct/marker_list.toml --lesion NAME=X,Y,Z \
             --out out/patient`, then `needlebench view out/patient`"
        ));
        return Err(finding.into());
    }
    let folder = Path::new("out").join(&resolved.scenario.name).join("view");
    let _taken = ResultsFolder::take_private(&folder)?;
    let progress = TerminalProgress::new(false);
    let control = Control {
        threads: threads(None),
        cancel,
        progress: &progress,
    };
    let files = BuildFiles {
        labels: true,
        volume: true,
        ..BuildFiles::default()
    };
    let made = imaged(&resolved, &folder, overrides, &files, None, &control);
    progress.finish();
    let made = made.map_err(stopped)?;
    if let Some(set_aside) = &made.set_aside {
        print_text(&layout::wrapped(&format!(
            "note: {}",
            set_aside.remark().message
        )))?;
    }
    Ok(folder)
}

/// A page in the folder that redirects to an address, readable by its owner only: a command line would show the secret
/// to other users. It is removed when the server ends.
fn redirect(folder: &Path, url: &str) -> std::io::Result<NamedTempFile> {
    let mut page = tempfile::Builder::new()
        .prefix("open-")
        .suffix(".html")
        .tempfile_in(folder)?;
    writeln!(
        page,
        "<!doctype html><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">\n\
         <meta http-equiv=\"refresh\" content=\"0; url={url}\">\n\
         <title>needlebench</title><a href=\"{url}\">planning page</a>"
    )?;
    page.flush()?;
    Ok(page)
}

/// Opens a page in the browser.
fn open(page: &Path) {
    let (program, before): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let _ = Command::new(program)
        .args(before)
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
}
