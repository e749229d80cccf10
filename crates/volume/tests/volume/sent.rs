//! What scanners and workstations send that is no plain series of one volume: each is called what it is.

use needlebench_volume::read::ReadOptions;

use super::made::{Slice, folder, read, read_as, read_slices, refusal, remarks, stack};

const IMAGE_TYPE: u32 = 0x0008_0008;
const ACQUISITION_TIME: u32 = 0x0008_0032;
const MODALITY: u32 = 0x0008_0060;
const DESCRIPTION: u32 = 0x0008_103E;
const THICKNESS: u32 = 0x0018_0050;
const PIXEL_SPACING: u32 = 0x0028_0030;

/// Element, its VR, its values, and what they are called.
type Phase = (u32, [u8; 2], [Vec<u8>; 2], [&'static str; 2]);

fn default() -> ReadOptions {
    ReadOptions::default()
}

/// Slices with another element, and instances of their own.
fn changed(slices: Vec<Slice>, tag: u32, vr: [u8; 2], value: &str) -> Vec<Slice> {
    slices
        .into_iter()
        .map(|slice| {
            let instance = format!("{}.{}", slice.instance, value.len());
            Slice { instance, ..slice }.with(tag, vr, value)
        })
        .collect()
}

fn of_series(series: u32, slices: Vec<Slice>) -> Vec<Slice> {
    let renamed = |slice: Slice| Slice {
        instance: format!("{}.{series}", slice.instance),
        series,
        ..slice
    };
    slices.into_iter().map(renamed).collect()
}

#[test]
fn phases_are_called_phases_with_what_tells_them_apart() {
    let breathing = |percent: f64| percent.to_le_bytes().to_vec();
    let kinds: [Phase; 5] = [
        (
            DESCRIPTION,
            *b"LO",
            [
                b"Zyxwvut gated, 0%".to_vec(),
                b"Zyxwvut gated, 50.0 %".to_vec(),
            ],
            ["0 %", "50 %"],
        ),
        (
            0x0020_9128,
            *b"UL",
            [vec![1, 0, 0, 0], vec![2, 0, 0, 0]],
            ["temporal position 1", "temporal position 2"],
        ),
        (
            0x0018_1060,
            *b"DS",
            [b"0".to_vec(), b"130".to_vec()],
            ["trigger time 0 ms", "trigger time 130 ms"],
        ),
        (
            0x0020_9245,
            *b"FD",
            [breathing(10.0), breathing(90.0)],
            ["10 % of the breathing cycle", "90 % of the breathing cycle"],
        ),
        (
            ACQUISITION_TIME,
            *b"TM",
            [b"101500.0".to_vec(), b"101504.25".to_vec()],
            ["by time", "by time"],
        ),
    ];
    for (tag, vr, values, words) in kinds {
        let mut slices = Vec::new();
        for (at, value) in values.into_iter().enumerate() {
            slices.extend(stack(3).into_iter().map(|slice| {
                let instance = format!("{}.{at}", slice.instance);
                Slice { instance, ..slice }.with(tag, vr, value.clone())
            }));
        }
        let said = refusal(read_slices(&slices, &default()));
        assert!(said.contains("the series has 2 phases (4D)"), "{said}");
        for (at, word) in words.into_iter().enumerate() {
            let phase = format!(
                "3 slices of 5 x 4, axial, 2 mm thick, phase {} of 2 ({word})",
                at + 1
            );
            assert!(said.contains(&phase), "no '{phase}' in {said}");
        }
        assert!(
            !said.contains("Zyxwvut") && !said.contains("1015"),
            "{said}"
        );
        let options = ReadOptions {
            series: Some("4.2".to_owned()),
            ..default()
        };
        let read = read_slices(&slices, &options).unwrap();
        assert_eq!(read.volume.grid.size()[2], 3);
        assert!(remarks(&read).contains("phase 2 of 2"));
    }
}

#[test]
fn phases_that_are_series_of_their_own_have_their_percentage() {
    let mut slices = changed(stack(3), DESCRIPTION, *b"LO", "T=0%");
    slices.extend(of_series(
        5,
        changed(stack(3), DESCRIPTION, *b"LO", "T=90%"),
    ));
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("2 series") && said.contains("phase 0 %") && said.contains("phase 90 %"),
        "{said}"
    );
}

#[test]
fn a_percentage_of_something_else_is_no_phase() {
    let said_of = |description: &str| {
        let mut slices = changed(stack(3), DESCRIPTION, *b"LO", description);
        slices.extend(of_series(5, stack(3)));
        refusal(read_slices(&slices, &default()))
    };
    let said = said_of("Zyxwvut ASiR 40%");
    assert!(
        said.contains("2 series") && !said.contains("phase"),
        "{said}"
    );
    let said = said_of("Zyxwvut gated 40%");
    assert!(said.contains("phase 40 %"), "{said}");
}

#[test]
fn parts_at_other_places_are_not_called_phases() {
    let acquired = |number: &str, heights_mm: [f64; 3]| {
        let slices = heights_mm.map(|mm| {
            let slice = Slice::at(mm);
            let instance = format!("{}.{number}", slice.instance);
            Slice { instance, ..slice }.with(0x0020_0012, *b"IS", number)
        });
        Vec::from(slices)
    };
    let mut slices = acquired("1", [0.0, 2.0, 4.0]);
    slices.extend(acquired("2", [4.0, 6.0, 8.0]));
    let said = refusal(read_slices(&slices, &default()));
    assert!(
        said.contains("2 series are possible") && said.contains("part 1 of 2 (acquisition 1)"),
        "{said}"
    );
    assert!(!said.contains("phase"), "{said}");
}

#[test]
fn bolus_tracking_is_no_volume() {
    let tracking = |at: u32| Slice {
        instance: format!("1.7.{at}"),
        series: 3,
        ..Slice::at(2.0).with(ACQUISITION_TIME, *b"TM", format!("1000{at:02}"))
    };
    let tracking: Vec<Slice> = (0..12).map(tracking).collect();
    let said = refusal(read_slices(&tracking, &default()));
    assert!(
        said.contains("all 12 slices are at one place") && said.contains("bolus tracking"),
        "{said}"
    );
    let both = [stack(4), tracking].concat();
    let read = read_slices(&both, &default()).unwrap();
    assert_eq!(read.volume.grid.size()[2], 4);
    assert!(remarks(&read).contains("at one place (bolus tracking)"));
}

#[test]
fn projections_and_renderings_are_no_hounsfield_units() {
    for (kind, word) in [
        (
            "DERIVED\\SECONDARY\\AXIAL\\CT_SOM5 MIP",
            "maximum intensity",
        ),
        ("DERIVED\\PRIMARY\\VOLUME\\MAX_IP", "maximum intensity"),
        ("DERIVED\\SECONDARY\\MINIP", "minimum intensity"),
        ("DERIVED\\SECONDARY\\PROJECTION IMAGE", "projections"),
        ("DERIVED\\SECONDARY\\VRT", "rendering"),
        ("DERIVED\\SECONDARY\\CURVED_MPR", "curved"),
    ] {
        let made = of_series(7, changed(stack(5), IMAGE_TYPE, *b"CS", kind));
        let said = refusal(read_slices(&made, &default()));
        assert!(
            said.contains(word) && said.contains("thin slices"),
            "{kind}: {said}"
        );
        let read = read_slices(&[stack(4), made].concat(), &default()).unwrap();
        assert_eq!(read.volume.grid.size()[2], 4, "{kind}");
        assert!(remarks(&read).contains(word), "{}", remarks(&read));
    }
    for kind in [
        "ORIGINAL\\PRIMARY\\AXIAL",
        "DERIVED\\SECONDARY\\MPR",
        "DERIVED\\PRIMARY\\AXIAL\\CT_SOM5 SPI",
    ] {
        assert!(
            read_slices(&changed(stack(3), IMAGE_TYPE, *b"CS", kind), &default()).is_ok(),
            "{kind}"
        );
    }
}

#[test]
fn slabs_that_overlap_are_said() {
    let thick = |mm: &str| {
        let read = read_slices(&changed(stack(4), THICKNESS, *b"DS", mm), &default());
        remarks(&read.unwrap())
    };
    assert!(
        thick("10").contains("10 mm thick, but 2.000 mm apart"),
        "{}",
        thick("10")
    );
    assert!(!thick("4").contains("apart"), "{}", thick("4"));
}

#[test]
fn slices_without_a_byte_are_called_that() {
    let (folder, path) = folder(&stack(4));
    std::fs::write(folder.path().join("VERSION"), b"").unwrap();
    let found = read(&path, &default()).unwrap();
    assert!(
        remarks(&found).contains("1 files are empty (0 bytes)"),
        "{}",
        remarks(&found)
    );
    // Of another series, in a folder of its own.
    std::fs::remove_file(folder.path().join("VERSION")).unwrap();
    for (series, slices) in [("S1", stack(4)), ("S2", Vec::new())] {
        let inner = folder.path().join(series);
        std::fs::create_dir(&inner).unwrap();
        for (at, slice) in slices.iter().enumerate() {
            std::fs::write(inner.join(format!("IM{at}")), slice.bytes()).unwrap();
        }
        std::fs::write(inner.join("README"), b"").unwrap();
    }
    for file in folder.path().read_dir().unwrap() {
        let file = file.unwrap().path();
        if file.is_file() {
            std::fs::remove_file(file).unwrap();
        }
    }
    std::fs::write(folder.path().join("S2").join("IM0"), b"").unwrap();
    let found = read(&path, &default()).unwrap();
    assert!(
        remarks(&found).contains("3 files are empty (0 bytes): ignored"),
        "{}",
        remarks(&found)
    );
    std::fs::remove_dir_all(folder.path().join("S2")).unwrap();
    std::fs::write(folder.path().join("S1").join("IM9999"), b"").unwrap();
    let said = refusal(read(&path, &default()));
    assert!(
        said.contains("IM9999") && said.contains("0 bytes") && said.contains("slices are missing"),
        "{said}"
    );
    for file in folder.path().join("S1").read_dir().unwrap() {
        std::fs::write(file.unwrap().path(), b"").unwrap();
    }
    let said = refusal(read(&path, &default()));
    assert!(said.contains("all 6 files are empty (0 bytes)"), "{said}");
}

#[test]
fn cone_beam_ct_is_read_and_projections_of_it_are_not() {
    let volume = changed(stack(4), MODALITY, *b"CS", "XA");
    let found = read_slices(&volume, &default()).unwrap();
    assert_eq!(found.description.modality.as_deref(), Some("XA"));
    assert!(
        remarks(&found).contains("not calibrated"),
        "{}",
        remarks(&found)
    );
    let marked = changed(
        stack(4),
        IMAGE_TYPE,
        *b"CS",
        "ORIGINAL\\PRIMARY\\AXIAL\\CBCT",
    );
    assert!(remarks(&read_slices(&marked, &default()).unwrap()).contains("cone beam CT"));
    assert!(!remarks(&read_slices(&stack(4), &default()).unwrap()).contains("cone beam"));
    let mut run = Slice::at(0.0)
        .with(MODALITY, *b"CS", "XA")
        .with(0x0028_0008, *b"IS", "3")
        .without(0x0020_0032)
        .without(0x0020_0037);
    run.pixels = run.pixels.repeat(3);
    let said = refusal(read_as("run.dcm", &run.bytes()));
    assert!(
        said.contains("3 X-ray projections") && said.contains("3D reconstruction"),
        "{said}"
    );
    run.series = 9;
    let found = read_slices(&[volume, vec![run]].concat(), &default()).unwrap();
    assert!(
        remarks(&found).contains("X-ray projections"),
        "{}",
        remarks(&found)
    );
}

#[test]
fn spacings_that_differ_by_rounding_are_one_series() {
    let mut slices = stack(6);
    for slice in slices.iter_mut().skip(1).step_by(2) {
        *slice = slice
            .clone()
            .with(PIXEL_SPACING, *b"DS", "0.75002\\0.50002");
    }
    let found = read_slices(&slices, &default()).unwrap();
    assert_eq!(found.volume.grid.size()[2], 6);
    for slice in slices.iter_mut().skip(1).step_by(2) {
        *slice = slice.clone().with(PIXEL_SPACING, *b"DS", "0.8\\0.5");
    }
    assert!(refusal(read_slices(&slices, &default())).contains("2 series"));
}

#[test]
fn one_slice_is_no_volume() {
    let found = read_as("a.dcm", &Slice::at(0.0).bytes()).unwrap();
    assert!(remarks(&found).contains("one slice, which is no volume"));
}

#[test]
fn frames_without_positions_are_not_called_phases() {
    let mut slice = Slice::at(0.0).with(0x0028_0008, *b"IS", "3");
    slice.pixels = slice.pixels.repeat(3);
    let said = refusal(read_as("a.dcm", &slice.bytes()));
    assert!(
        said.contains("no frame has a position of its own"),
        "{said}"
    );
}
