//! Names of structures, as published programs write them.

use needlebench_volume::{SurfaceTissue, structure_of};

/// Names with the tissue that is meant, looked through by eye.
const NAMES: &str = include_str!("names.tsv");

#[test]
fn every_published_class_name_is_the_tissue_that_is_meant() {
    let mut count = 0;
    let mut wrong = Vec::new();
    for row in NAMES.lines().filter(|row| !row.starts_with('#')) {
        let (meant, name) = row.split_once('\t').unwrap();
        let found = structure_of(name).map_or("-", |structure| match structure.tissue {
            SurfaceTissue::Skin => "skin",
            SurfaceTissue::Bone => "bone",
            SurfaceTissue::Vessel => "vessel",
            SurfaceTissue::Organ => "organ",
            SurfaceTissue::Lung => "lung",
            SurfaceTissue::Lesion => "lesion",
            SurfaceTissue::Beside => "beside",
        });
        count += 1;
        if found != meant {
            wrong.push(format!("{name}: {found}, meant {meant}"));
        }
    }
    assert_eq!(count, 1968);
    assert_eq!(wrong, Vec::<String>::new());
}
