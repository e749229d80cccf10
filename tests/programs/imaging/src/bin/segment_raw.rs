//! Segments a raw volume and writes what it found: for comparisons with other programs, and to look at.
//!
//! `segment_raw VOLUME.raw NX NY NZ DX DY DZ OUT [x,y,z]...`: little-endian 16-bit Hounsfield units, voxels in mm with
//! the first one at the origin, seeds of lesions in mm. Writes `labels.raw` (16 bit), `NAME.obj` for each surface,
//! `distance.raw` (single precision, mm, to the bone, all voxels) and `report.txt`.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use nalgebra::Point3;
use needlebench_imaging::{
    Components, Connectivity, DistanceField, DistanceOptions, FieldOfView, IndexBox, LesionSeed,
    Levels, Mask, ReconstructOptions, dilated, eroded, label_map, reconstruct, segment,
};
use needlebench_volume::{Lying, Volume, VoxelGrid};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, nx, ny, nz, dx, dy, dz, out, seeds @ ..] = &arguments[..] else {
        return Err("VOLUME.raw NX NY NZ DX DY DZ OUT [x,y,z]...".into());
    };
    let size = [nx.parse()?, ny.parse()?, nz.parse()?];
    let steps: [f64; 3] = [dx.parse()?, dy.parse()?, dz.parse()?];
    let grid = VoxelGrid::aligned(size, steps.map(|step| 1e-3 * step), Point3::origin())?;
    let bytes = std::fs::read(file)?;
    let hu = bytes
        .as_chunks::<2>()
        .0
        .iter()
        .map(|pair| i16::from_le_bytes(*pair));
    let volume = Volume {
        grid,
        hu: hu.collect(),
        slice_thickness_m: None,
    };
    let out = Path::new(out);
    std::fs::create_dir_all(out)?;
    let mut report = String::new();
    parts(&volume, out, &mut report)?;
    whole(&volume, seeds, out, &mut report)?;
    print!("{report}");
    std::fs::write(out.join("report.txt"), report)?;
    Ok(())
}

/// Processor time of this process, s, in steps of 10 ms; 0 where there is no `/proc`.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let ticks = [11, 12].map(|at| {
        fields
            .get(at)
            .and_then(|field| field.parse().ok())
            .unwrap_or(0.0)
    });
    0.01 * (ticks[0] + ticks[1])
}

/// The steps one by one, timed.
fn parts(volume: &Volume, out: &Path, report: &mut String) -> Result<(), Failure> {
    let cancel = AtomicBool::new(false);
    let size = volume.grid.size();
    let mut time = |what: &str, since: f64| {
        let _ = writeln!(report, "time {what} {:.2} s", cpu_s() - since);
    };
    let start = cpu_s();
    let tissue = Mask::of(size, &volume.hu, |hu| hu > -480);
    time("threshold", start);
    let start = cpu_s();
    let components = Components::of(&tissue, Connectivity::Faces);
    time("components", start);
    let count = components.parts().len();
    let largest = components
        .largest()
        .map_or(0, |part| components.parts()[part].voxels);
    let start = cpu_s();
    let shrunk = eroded(&tissue, 3e-3, volume.grid.spacing_m());
    let opened = dilated(&shrunk, 3e-3, volume.grid.spacing_m());
    time("opening", start);
    let start = cpu_s();
    let found = segment(
        volume,
        &FieldOfView::of(volume),
        Lying::Supine,
        &Levels::default(),
        &cancel,
    )?;
    time("segment", start);
    let start = cpu_s();
    let (labels, facts) = label_map(volume, &found, &[]);
    time("label_map", start);
    let dense = Mask::of(size, &volume.hu, |hu| hu > 190);
    let options = DistanceOptions {
        cap_m: 40e-3,
        threads: 1,
        cancel: &cancel,
    };
    let start = cpu_s();
    let _ = DistanceField::new(&volume.grid, &dense, found.body.bounds, &options)?;
    time("distance_in_box", start);
    let start = cpu_s();
    let field = DistanceField::new(&volume.grid, &dense, IndexBox::whole(size), &options)?;
    time("distance", start);
    let _ = writeln!(
        report,
        "components {count} largest {largest} opened {}",
        opened.count()
    );
    for fact in facts {
        let _ = writeln!(
            report,
            "label {} {} {:.6} l",
            fact.label,
            fact.name,
            1e3 * fact.volume_m3
        );
    }
    let mut file = BufWriter::new(File::create(out.join("distance.raw"))?);
    for metres in field.values_m() {
        #[expect(clippy::cast_possible_truncation, reason = "read as single precision")]
        file.write_all(&((1e3 * metres) as f32).to_le_bytes())?;
    }
    drop(field);
    let mut file = BufWriter::new(File::create(out.join("labels.raw"))?);
    for label in &labels.labels {
        file.write_all(&label.to_le_bytes())?;
    }
    Ok(())
}

/// All of it.
fn whole(
    volume: &Volume,
    seeds: &[String],
    out: &Path,
    report: &mut String,
) -> Result<(), Failure> {
    let mut options = ReconstructOptions::default();
    for (number, seed) in seeds.iter().enumerate() {
        let places: Vec<f64> = seed.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let [x, y, z] = places[..] else {
            return Err("a seed is x,y,z".into());
        };
        options.lesions.push(LesionSeed {
            name: format!("lesion_{number}"),
            point_m: Point3::new(x, y, z) * 1e-3,
        });
    }
    let cancel = AtomicBool::new(false);
    let start = cpu_s();
    let made = reconstruct(volume, &options, 1, &cancel, &|step, share| {
        eprintln!("{:.2} {step} {:.2} s", share, cpu_s() - start);
    })?;
    writeln!(report, "time reconstruct {:.2} s", cpu_s() - start)?;
    for surface in &made.surfaces {
        writeln!(
            report,
            "surface {} {:?} {} of {} triangles, {:.6} l, level {:?} HU, from the voxels {:.4} mm rms, {:.4} p99, {:.4} max",
            surface.name,
            surface.tissue,
            surface.mesh.triangles.len(),
            surface.triangles_before,
            1e3 * surface.volume_m3,
            surface.level_hu,
            1e3 * surface.error.rms_m,
            1e3 * surface.error.p99_m,
            1e3 * surface.error.max_m,
        )?;
        let mut text = String::new();
        for vertex in &surface.mesh.vertices_m {
            let [x, y, z] = [vertex.x, vertex.y, vertex.z].map(|metres| 1e3 * metres);
            writeln!(text, "v {x} {y} {z}")?;
        }
        for [a, b, c] in &surface.mesh.triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        std::fs::write(out.join(format!("{}.obj", surface.name)), text)?;
    }
    for each in &made.lesions {
        let lesion = &each.lesion;
        writeln!(
            report,
            "lesion {} {} HU, level {} HU, inscribed {:.2} mm, wall {} vessels {} leaked {} {:?}",
            lesion.name,
            lesion.median_hu,
            lesion.level_hu.unwrap_or_default(),
            1e3 * lesion.inscribed_radius_m,
            lesion.cut_at_wall,
            lesion.cut_at_vessels,
            lesion.leaked,
            each.size,
        )?;
    }
    for remark in &made.remarks {
        writeln!(report, "remark {:?} {}", remark.place, remark.message)?;
    }
    Ok(())
}
