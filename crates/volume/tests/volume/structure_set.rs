//! Contours of RT structure sets as labels of a CT.

use std::sync::atomic::AtomicBool;

use needlebench_volume::read::{ReadLabels, ReadOptions, ScanIdentity, read_labels};
use needlebench_volume::{SurfaceTissue, VolumeError, structure_of};

use super::made::{Slice, item, refusal, stack};

/// Of the CT and of the structures.
const FRAME: &str = "1.2.3.4";

/// Name, type and contours: kind and points, mm.
struct Structure<'a> {
    name: &'a str,
    kind: &'a str,
    contours: Vec<(&'a str, String)>,
}

/// A rectangle of the columns and rows from these on, up to those, at a height in mm: the CT's voxels are 0.5 x 0.75 x 2
/// mm, the first at (-10, 20, 0).
fn rectangle(from: [f64; 2], to: [f64; 2], height_mm: f64) -> String {
    let corners = [
        [from[0], from[1]],
        [to[0], from[1]],
        [to[0], to[1]],
        [from[0], to[1]],
    ];
    let corners = corners.map(|[i, j]| {
        let (x, y) = (-10.0 + 0.5 * (i - 0.5), 20.0 + 0.75 * (j - 0.5));
        format!("{x}\\{y}\\{height_mm}")
    });
    corners.join("\\")
}

fn structure_set(structures: &[Structure<'_>], frame: &str) -> Vec<u8> {
    let numbers: Vec<String> = (1..=structures.len()).map(|it| it.to_string()).collect();
    let numbers: Vec<&str> = numbers.iter().map(String::as_str).collect();
    structure_set_of(structures, &numbers, frame)
}

/// With these ROI Numbers.
fn structure_set_of(structures: &[Structure<'_>], numbers: &[&str], frame: &str) -> Vec<u8> {
    let text = |tag: u32, vr: &[u8; 2], text: &str| (tag, *vr, text.as_bytes().to_vec());
    let (mut rois, mut all, mut seen) = (Vec::new(), Vec::new(), Vec::new());
    for (&number, each) in numbers.iter().zip(structures) {
        rois.extend(item(&[
            text(0x3006_0022, b"IS", number),
            text(0x3006_0024, b"UI", frame),
            text(0x3006_0026, b"LO", each.name),
        ]));
        let contours: Vec<u8> = each
            .contours
            .iter()
            .flat_map(|(kind, points)| {
                let count = points.split('\\').count() / 3;
                item(&[
                    text(0x3006_0042, b"CS", kind),
                    text(0x3006_0046, b"IS", &count.to_string()),
                    text(0x3006_0050, b"DS", points),
                ])
            })
            .collect();
        all.extend(item(&[
            (0x3006_0040, *b"SQ", contours),
            text(0x3006_0084, b"IS", number),
        ]));
        seen.extend(item(&[
            text(0x3006_0084, b"IS", number),
            text(0x3006_00A4, b"CS", each.kind),
        ]));
    }
    let mut slice = Slice::at(0.0)
        .without(0x0028_0010)
        .without(0x0028_0011)
        .with(0x0008_0016, *b"UI", "1.2.840.10008.5.1.4.1.1.481.3")
        .with(0x0008_0060, *b"CS", "RTSTRUCT")
        .with(0x3006_0020, *b"SQ", rois)
        .with(0x3006_0039, *b"SQ", all)
        .with(0x3006_0080, *b"SQ", seen);
    slice.pixels = Vec::new();
    slice.bytes()
}

/// A small one.
pub fn made() -> Vec<u8> {
    let points = rectangle([1.0, 1.0], [2.0, 2.0], 2.0);
    structure_set(&one(points), FRAME)
}

fn labels_of(structures: &[Structure<'_>]) -> Result<ReadLabels, VolumeError> {
    labels_in(structures, FRAME)
}

fn labels_in(structures: &[Structure<'_>], frame: &str) -> Result<ReadLabels, VolumeError> {
    let slices = stack(3)
        .into_iter()
        .map(|slice| slice.with(0x0020_0052, *b"UI", FRAME));
    let slices: Vec<Slice> = slices.collect();
    let ct = super::made::read_slices(&slices, &ReadOptions::default()).unwrap();
    let wanted = ScanIdentity {
        frame_of_reference: Some(FRAME.to_owned()),
        series_uid: Some("1.2.4".to_owned()),
    };
    assert_eq!(ct.description.identity, wanted);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("RS.dcm");
    std::fs::write(&path, structure_set(structures, frame)).unwrap();
    let options = ReadOptions {
        scan: ct.description.identity,
        ..ReadOptions::default()
    };
    let read = |path| read_labels(path, &ct.volume.grid, &options, &AtomicBool::new(false));
    let of_file = read(&path);
    // Its folder is the same.
    assert_eq!(of_file, read(folder.path()));
    of_file
}

fn said(read: &ReadLabels) -> String {
    let all: Vec<&str> = read.remarks.iter().map(|it| &*it.message).collect();
    all.join("; ")
}

#[test]
fn contours_are_voxels_with_the_names_of_their_structures() {
    let closed = |points: String| ("CLOSED_PLANAR", points);
    let read = labels_of(&[
        Structure {
            name: "GTV_1",
            kind: "GTV",
            contours: vec![closed(rectangle([1.0, 1.0], [2.0, 2.0], 2.0))],
        },
        Structure {
            name: "outline",
            kind: "EXTERNAL",
            contours: [0.0, 4.0]
                .map(|mm| closed(rectangle([0.0, 0.0], [5.0, 4.0], mm)))
                .into(),
        },
        Structure {
            name: "Lung_L",
            kind: "ORGAN",
            contours: vec![
                closed(rectangle([0.0, 0.0], [4.0, 4.0], 2.0)),
                closed(rectangle([2.0, 2.0], [3.0, 3.0], 2.0)),
                ("POINT", "-9\\21\\2".to_owned()),
            ],
        },
        Structure {
            name: "PTV tumor",
            kind: "PTV",
            contours: vec![closed(rectangle([0.0, 0.0], [5.0, 4.0], 2.0))],
        },
    ])
    .unwrap();
    let [first, second, third] = [0, 1, 2].map(|k| &read.labels.labels[20 * k..][..20]);
    assert!(first.iter().chain(third).all(|&label| label == 2));
    let wanted = [
        3, 3, 3, 3, 2, //
        3, 1, 3, 3, 2, //
        3, 3, 2, 3, 2, //
        3, 3, 3, 3, 2,
    ];
    assert_eq!(second, wanted);
    let names = [(1, "Tumor GTV_1"), (2, "External"), (3, "Lung_L")];
    assert_eq!(
        read.labels.names,
        names.map(|(label, name)| (label, name.to_owned()))
    );
    let said = said(&read);
    for words in [
        "3 structures, 5 contours",
        "are no tissue and are ignored: `PTV tumor`",
        "15 voxels are in several",
        "points and open lines are no areas and are ignored: `Lung_L (1)`",
        "within half of that distance, have the nearest one: `outline (1)`",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(!said.contains("frame of reference"), "{said}");
}

fn one(points: String) -> [Structure<'static>; 1] {
    [Structure {
        name: "Rib 7",
        kind: "ORGAN",
        contours: vec![("CLOSED_PLANAR", points)],
    }]
}

#[test]
fn what_differs_from_the_scan_is_said() {
    let at = |mm| one(rectangle([1.0, 1.0], [2.0, 2.0], mm));
    let read = labels_of(&at(2.7)).unwrap();
    assert_eq!(read.labels.labels[20 + 6], 1);
    assert!(
        said(&read).contains("up to 0.70 mm from the nearest one"),
        "{}",
        said(&read)
    );
    let read = labels_in(&at(2.0), "1.2.3.5").unwrap();
    assert!(
        said(&read).contains("another frame of reference"),
        "{}",
        said(&read)
    );
    let refused = refusal(labels_of(&at(7.0)));
    assert!(refused.contains("no voxel has a label"), "{refused}");
}

#[test]
fn what_cannot_be_voxels_is_refused_by_the_name_of_its_structure() {
    for (points, words) in [
        (
            "-10\\20\\0\\-8\\20\\0\\-8\\22\\1.5",
            "oblique to the slices: one spans 0.8",
        ),
        (
            "-10\\20\\0\\-8\\20\\0\\-8\\22",
            "states 2 points and has 8 numbers",
        ),
        ("-10\\20\\0\\-8\\20\\0\\-8\\x\\0", "is not a number"),
    ] {
        let refused = refusal(labels_of(&one(points.to_owned())));
        assert!(
            refused.contains("Rib 7") && refused.contains(words),
            "{refused}"
        );
    }
    let refused = refusal(labels_of(&[]));
    assert!(refused.contains("no structures"), "{refused}");
}

#[test]
fn a_gross_tumour_is_a_lesion_whatever_place_its_name_has() {
    for name in ["GTV_Lung_L", "GTV liver", "Rib 7"] {
        let mut structures = one(rectangle([1.0, 1.0], [2.0, 2.0], 2.0));
        structures[0].name = name;
        structures[0].kind = "GTV";
        let read = labels_of(&structures).unwrap();
        assert_eq!(read.labels.names, [(1, format!("Tumor {name}"))]);
        let structure = structure_of(&read.labels.names[0].1).unwrap();
        assert_eq!(structure.tissue, SurfaceTissue::Lesion, "{name}");
    }
}

#[test]
fn names_by_number_are_not_of_structures_without_numbers() {
    let mut read = labels_of(&one(rectangle([1.0, 1.0], [2.0, 2.0], 2.0))).unwrap();
    let before = read.clone();
    let refused = refusal(read.rename(&[(1, "liver".to_owned())]));
    assert!(refused.contains("omit --label-names"), "{refused}");
    assert_eq!(read, before);
    read.rename(&[]).unwrap();
    assert_eq!(read, before);
    read.is_numbered_here = false;
    read.rename(&[(1, "liver".to_owned()), (2, "heart".to_owned())])
        .unwrap();
    assert_eq!(read.labels.names, [(1, "liver".to_owned())]);
}

#[test]
fn volumes_of_a_plan_are_ignored_by_name_too() {
    let mut structures: Vec<Structure<'_>> = ["Rib 7", "PTV Lung_L", "PRV05 Heart"]
        .into_iter()
        .flat_map(|name| {
            one(rectangle([1.0, 1.0], [2.0, 2.0], 2.0)).map(|it| Structure { name, ..it })
        })
        .collect();
    structures[1].kind = "";
    let read = labels_of(&structures).unwrap();
    assert_eq!(read.labels.names, [(1, "Rib 7".to_owned())]);
    let said = said(&read);
    assert!(
        said.contains("are ignored: `PTV Lung_L`, `PRV05 Heart`"),
        "{said}"
    );
}

#[test]
fn structures_are_told_apart_by_numbers_of_their_own() {
    let ct = super::made::read_slices(&stack(3), &ReadOptions::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("RS.dcm");
    let read = |numbers: &[&str]| {
        let points = rectangle([1.0, 1.0], [2.0, 2.0], 2.0);
        let structures: Vec<Structure<'_>> =
            numbers.iter().flat_map(|_| one(points.clone())).collect();
        std::fs::write(&path, structure_set_of(&structures, numbers, FRAME)).unwrap();
        let never = AtomicBool::new(false);
        read_labels(&path, &ct.volume.grid, &ReadOptions::default(), &never)
    };
    read(&["7", "3"]).unwrap();
    let said = refusal(read(&["7", "3", "7"]));
    assert!(
        said.contains("structures 1 and 3 have the same ROI Number 7"),
        "{said}"
    );
    let said = refusal(read(&["7", ""]));
    assert!(said.contains("structure 2 has no ROI Number"), "{said}");
    let many: Vec<String> = (0..4097).map(|it: i32| it.to_string()).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    let said = refusal(read(&many));
    assert!(said.contains("it has 4097 structures"), "{said}");
}
