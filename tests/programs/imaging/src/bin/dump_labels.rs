//! Reads label maps of a volume, for a program in another language to compare: a line of JSON for each, the labels (16 bits,
//! little-endian, columns fastest) and a segmentation of 3D Slicer beside it.
//!
//! `dump_labels OUT VOLUME PATH...` writes `OUT/0.labels` and `OUT/0.seg.nrrd`, `OUT/1.labels`, ...

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use needlebench_programs_imaging::refused;
use needlebench_volume::VoxelGrid;
use needlebench_volume::read::{ReadOptions, read_labels, read_volume};
use needlebench_volume::write::write_seg_nrrd;
use serde_json::{Value, json};

fn main() {
    let mut words = std::env::args().skip(1).map(PathBuf::from);
    let folder = words.next().expect("a folder for the labels");
    let volume = words.next().expect("a volume");
    let never = AtomicBool::new(false);
    let read =
        read_volume(&volume, &ReadOptions::default(), 1, &never).expect("a volume that is read");
    let options = ReadOptions {
        scan: read.description.identity,
        ..ReadOptions::default()
    };
    for (at, path) in words.enumerate() {
        let out = folder.join(at.to_string());
        println!("{}", answer(&path, &out, &read.volume.grid, &options));
    }
}

fn answer(path: &Path, out: &Path, grid: &VoxelGrid, options: &ReadOptions) -> Value {
    let never = AtomicBool::new(false);
    let read = match read_labels(path, grid, options, &never) {
        Ok(read) => read,
        Err(error) => return refused(error),
    };
    let labels = &read.labels.labels;
    let bytes: Vec<u8> = labels
        .iter()
        .flat_map(|label| label.to_le_bytes())
        .collect();
    std::fs::write(out.with_extension("labels"), bytes).expect("the labels can be written");
    write_seg_nrrd(&out.with_extension("seg.nrrd"), &read.labels, &never).expect("a segmentation");
    let remarks: Vec<String> = read.remarks.into_iter().map(|it| it.message).collect();
    json!({
        "labels": out.with_extension("labels"),
        "segmentation": out.with_extension("seg.nrrd"),
        "size": grid.size(),
        "names": read.labels.names,
        "remarks": remarks,
    })
}
