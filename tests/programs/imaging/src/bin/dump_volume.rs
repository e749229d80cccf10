//! Reads volumes and writes what a program in another language needs to compare them: a line of JSON for each path,
//! and the voxels (16 bits, little-endian, columns fastest) beside it.
//!
//! `dump_volume OUT [--fill-gaps] [--series S] [--assume-orientation LPS] PATH...` writes `OUT/0.hu`, `OUT/1.hu`, ...

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use needlebench_programs_imaging::refused;
use needlebench_volume::read::{ReadOptions, read_volume};
use serde_json::{Value, json};

fn main() {
    let mut words = std::env::args().skip(1);
    let folder = PathBuf::from(words.next().expect("a folder for the voxels"));
    let mut options = ReadOptions::default();
    let mut paths = Vec::new();
    let mut threads = 1;
    while let Some(word) = words.next() {
        let mut value = || words.next().expect("a value");
        match word.as_str() {
            "--fill-gaps" => options.fill_gaps = true,
            "--series" => options.series = Some(value()),
            "--assume-orientation" => {
                options.assume_orientation = Some(value().parse().expect("an orientation"));
            }
            "--threads" => threads = value().parse().expect("a number"),
            _ => paths.push(PathBuf::from(word)),
        }
    }
    for (at, path) in paths.iter().enumerate() {
        let out = folder.join(format!("{at}.hu"));
        println!("{}", answer(path, &out, &options, threads));
    }
}

/// Time that this thread has had of a core, where the system tells it.
fn thread_cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text
        .split(' ')
        .next()
        .and_then(|word| word.parse::<f64>().ok());
    nanoseconds.unwrap_or(f64::NAN) * 1e-9
}

fn answer(path: &Path, out: &Path, options: &ReadOptions, threads: usize) -> Value {
    let (start, cpu_s) = (Instant::now(), thread_cpu_s());
    let outcome = read_volume(path, options, threads, &AtomicBool::new(false));
    let (seconds, cpu_s) = (start.elapsed().as_secs_f64(), thread_cpu_s() - cpu_s);
    let read = match outcome {
        Ok(read) => read,
        Err(error) => return refused(error),
    };
    let grid = &read.volume.grid;
    let steps: Vec<f64> = grid.steps_m().iter().copied().collect();
    let bytes: Vec<u8> = read
        .volume
        .hu
        .iter()
        .flat_map(|hu| hu.to_le_bytes())
        .collect();
    std::fs::write(out, bytes).expect("the voxels can be written");
    let remarks: Vec<String> = read
        .remarks
        .iter()
        .map(|remark| match &remark.place {
            Some(place) => format!("{place}: {}", remark.message),
            None => remark.message.clone(),
        })
        .collect();
    json!({
        "size": grid.size(),
        "steps_m": steps,
        "first_m": [grid.first_m().x, grid.first_m().y, grid.first_m().z],
        "remarks": remarks,
        "description": read.description,
        "slice_thickness_m": read.volume.slice_thickness_m,
        "read_s": seconds,
        "read_cpu_s": cpu_s,
        "voxels": out,
    })
}
