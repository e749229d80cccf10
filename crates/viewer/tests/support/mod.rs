//! A patient of a few thousand voxels, a server for it, and a client that sends what no browser would.

use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::thread::JoinHandle;

use nalgebra::Point3;
use needlebench_imaging::LesionSeed;
use needlebench_parallel::{Control, Silent};
use needlebench_patient::ct::{BuildFiles, BuildOptions, Room, USUAL_ROOM, build, write_patient};
use needlebench_scenario::scenario::{GoalSection, Target};
use needlebench_scenario::{Overrides, resolve_open_scenario};
use needlebench_viewer::{Case, Server, Stopper};
use needlebench_volume::read::{Description, ReadVolume};
use needlebench_volume::{Volume, VoxelGrid};
use serde_json::Value;
use tempfile::TempDir;

pub const SIZE: [usize; 3] = [90, 64, 60];
pub const SPACING_M: [f64; 3] = [4e-3, 4e-3, 5e-3];
pub const FIRST_M: [f64; 3] = [-0.1783, -0.1272, -0.1486];
/// Half axes of the body, an elliptic cylinder along z, and of each lung.
pub const BODY_M: [f64; 2] = [0.15, 0.1];
pub const LUNG_M: [f64; 3] = [0.05, 0.07, 0.1];
pub const LUNG_AT_M: f64 = 0.07;
/// Middle of a ball in the left lung.
pub const NODULE_M: [f64; 3] = [0.075, 0.01, 0.02];
/// Name of the scenario: that of the folder.
pub const NAME: &str = "small_patient";

/// What the scan has at a voxel.
pub fn hu(index: [usize; 3]) -> i16 {
    let at: [f64; 3] =
        std::array::from_fn(|axis| FIRST_M[axis] + SPACING_M[axis] * index[axis] as f64);
    let [x, y, z] = at;
    let within = |half: &[f64], off: &[f64]| {
        off.iter()
            .zip(half)
            .map(|(off, half)| (off / half).powi(2))
            .sum::<f64>()
            <= 1.0
    };
    let nodule: f64 = at
        .iter()
        .zip(NODULE_M)
        .map(|(at, middle)| (at - middle).powi(2))
        .sum();
    if nodule.sqrt() < 0.014 {
        30
    } else if within(&LUNG_M, &[x.abs() - LUNG_AT_M, y, z]) {
        -850
    } else if within(&BODY_M, &[x, y]) {
        40
    } else {
        -1000
    }
}

/// A folder as `ct build` makes it, without markers.
pub fn patient() -> PathBuf {
    static MADE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        std::fs::create_dir(&path).unwrap();
        make(&path);
        (folder, path)
    });
    path.clone()
}

fn make(folder: &Path) {
    let grid = VoxelGrid::aligned(SIZE, SPACING_M, Point3::from(FIRST_M)).unwrap();
    let [columns, rows, slices] = SIZE;
    let hu = (0..slices)
        .flat_map(|k| (0..rows).flat_map(move |j| (0..columns).map(move |i| hu([i, j, k]))))
        .collect();
    let read = ReadVolume {
        volume: Volume {
            grid,
            hu,
            slice_thickness_m: Some(SPACING_M[2]),
        },
        remarks: Vec::new(),
        description: Description::default(),
    };
    let options = BuildOptions {
        lesions: vec![LesionSeed {
            name: "nodule".to_owned(),
            point_m: Point3::from(NODULE_M),
        }],
        max_bytes: u64::MAX,
        ..BuildOptions::default()
    };
    let control = Control {
        threads: 2,
        cancel: &AtomicBool::new(false),
        progress: &Silent,
    };
    let built = build(read, &options, &control).unwrap();
    let open = resolve_open_scenario(
        "room.toml",
        USUAL_ROOM,
        Path::new(""),
        &Overrides::default(),
    )
    .unwrap();
    let mut scenario = open.resolved.scenario.clone();
    NAME.clone_into(&mut scenario.name);
    let room = Room {
        scenario: &scenario,
        resolved: &open.resolved,
        folder: Path::new(""),
    };
    let goal = GoalSection {
        standoff_mm: 15.0,
        ..GoalSection::at(Target::Lesion("nodule".to_owned()))
    };
    let files = BuildFiles {
        labels: true,
        volume: true,
        ..BuildFiles::default()
    };
    write_patient(
        folder,
        &room,
        &built,
        vec![goal],
        &files,
        "Made by a test.",
        &control,
    )
    .unwrap();
}

/// A folder of one's own.
pub fn copy_of(folder: &Path) -> TempDir {
    let copy = tempfile::tempdir().unwrap();
    copy_into(folder, copy.path());
    copy
}

fn copy_into(from: &Path, to: &Path) {
    for entry in from.read_dir().unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            std::fs::create_dir(&target).unwrap();
            copy_into(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// A server in a thread of its own.
pub struct Running {
    pub token: String,
    pub port: u16,
    stopper: Stopper,
    thread: Option<JoinHandle<()>>,
    folder: Option<TempDir>,
}

impl Running {
    /// For a patient of its own.
    pub fn start() -> Self {
        Self::open(copy_of(&patient()))
    }

    pub fn open(folder: TempDir) -> Self {
        let case = match Case::open(
            folder.path(),
            &Overrides::default(),
            &AtomicBool::new(false),
        ) {
            Ok(case) => case,
            Err(findings) => panic!("{findings:?}"),
        };
        let server = Server::new(case, 0, PathBuf::from("false")).unwrap();
        let (_, token) = server
            .url()
            .split_once('#')
            .map(|(a, b)| (a.to_owned(), b.to_owned()))
            .unwrap();
        let (port, stopper) = (server.port(), server.stopper());
        Self {
            token,
            port,
            stopper,
            thread: Some(std::thread::spawn(move || server.run())),
            folder: Some(folder),
        }
    }

    pub fn folder(&self) -> &Path {
        self.folder.as_ref().unwrap().path()
    }

    /// Ends it; its folder stays.
    pub fn stop(mut self) -> TempDir {
        self.end();
        self.folder.take().unwrap()
    }

    fn end(&mut self) {
        self.stopper.stop();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }

    pub fn asked(&self, method: &str, path: &str) -> Asked {
        Asked {
            port: self.port,
            method: method.to_owned(),
            path: path.to_owned(),
            host: format!("127.0.0.1:{}", self.port),
            token: Some(self.token.clone()),
            headers: Vec::new(),
            body: String::new(),
        }
    }

    pub fn get(&self, path: &str) -> Answered {
        self.asked("GET", path).send()
    }

    pub fn post(&self, path: &str, body: &Value) -> Answered {
        self.asked("POST", path).body(&body.to_string()).send()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

/// A question, byte by byte.
pub struct Asked {
    port: u16,
    method: String,
    path: String,
    pub host: String,
    pub token: Option<String>,
    pub headers: Vec<(String, String)>,
    body: String,
}

impl Asked {
    pub fn header(mut self, name: &str, value: &str) -> Self {
        self.headers.push((name.to_owned(), value.to_owned()));
        self
    }

    pub fn body(mut self, body: &str) -> Self {
        body.clone_into(&mut self.body);
        self
    }

    pub fn send(&self) -> Answered {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let mut text = format!(
            "{} {} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n",
            self.method, self.path, self.host
        );
        if let Some(token) = &self.token {
            let _ = write!(text, "authorization: Bearer {token}\r\n");
        }
        for (name, value) in &self.headers {
            let _ = write!(text, "{name}: {value}\r\n");
        }
        let _ = write!(
            text,
            "content-length: {}\r\n\r\n{}",
            self.body.len(),
            self.body
        );
        // A server that has said no may hang up before it was sent all of it.
        let _ = stream.write_all(text.as_bytes());
        let mut raw = Vec::new();
        let _ = stream.read_to_end(&mut raw);
        Answered::of(&raw)
    }
}

/// An answer.
pub struct Answered {
    pub status: u16,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Answered {
    fn of(raw: &[u8]) -> Self {
        let end = raw
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .expect("an answer has a head");
        let head = String::from_utf8(raw[..end].to_vec()).unwrap();
        let mut lines = head.split("\r\n");
        let status = lines
            .next()
            .unwrap()
            .split(' ')
            .nth(1)
            .unwrap()
            .parse()
            .unwrap();
        let headers = lines.filter_map(|line| line.split_once(": "));
        Self {
            status,
            headers: headers
                .map(|(name, value)| (name.to_lowercase(), value.to_owned()))
                .collect(),
            body: raw[end + 4..].to_vec(),
        }
    }

    pub fn header(&self, name: &str) -> Option<String> {
        let found = self.headers.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.clone())
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|error| panic!("{error}: {}", self.text()))
    }
}
