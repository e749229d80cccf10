//! What was found in a scan, as one image: three slices with all outlines, and a legend.

use nalgebra::{Point3, Vector3};
use needlebench_imaging::Surface;
use needlebench_imaging::markers::DetectedMarker;
use needlebench_patient::ct::{OverviewRow, ScanBuild};
use needlebench_render::{Image, PictureError, TextSize, signed};
use needlebench_volume::SurfaceTissue;

use super::slices::{
    AXIAL, CORONAL, Frame, MARKER_COLOR, PAPER, SAGITTAL, SlicePicture, View, color, cross, cut,
    extent_m, line, shade, whole,
};
use crate::table::overview::{accuracy_mm, overview_rows, volume_ml};

/// Name of the image of all that was found.
pub const OVERVIEW: &str = "overview.png";

/// Length of the longest side of a slice, px.
const LONG_PX: f64 = 640.0;
/// Around each slice, for letters.
const EDGE_PX: usize = 30;
/// Above each slice, for its title.
const TITLE_PX: usize = 24;
/// Shown around the patient, m.
const MARGIN_M: f64 = 8e-3;
/// Densities that are told apart: lung, soft tissue and bone in one, HU.
const WINDOW_HU: [f64; 2] = [-1000.0, 500.0];
const BAR_M: f64 = 0.05;

const UNSEEN_COLOR: [u8; 3] = [255, 0, 255];
const INK: [u8; 3] = [30, 30, 34];
const QUIET: [u8; 3] = [120, 120, 126];
const WHITE: [u8; 3] = [255, 255, 255];

/// Markers are rings of this radius, px; lesions of twice it.
const RING_PX: f64 = 6.0;

/// Three slices through the largest lesion, or through the middle of the lungs, and what was found.
pub(super) fn overview_picture(build: &ScanBuild) -> Result<SlicePicture, PictureError> {
    let around = around(build);
    let at = focus(build);
    let lengths = around[1] - around[0];
    let px_per_m = LONG_PX / lengths.max();
    let frame = |view| Frame::of_box(around, view, px_per_m);
    let [mut coronal, mut sagittal, mut axial] = [CORONAL, SAGITTAL, AXIAL].map(frame);
    let left = EDGE_PX;
    let top = TITLE_PX + EDGE_PX;
    let right = left + coronal.size_px[0] + 3 * EDGE_PX;
    let below = top + coronal.size_px[1] + 2 * EDGE_PX + TITLE_PX;
    coronal.at_px = [left, top];
    sagittal.at_px = [right, top];
    axial.at_px = [left, below];
    let legend = legend(build);
    let [legend_width, legend_height] = legend.size_px();
    let width = right + sagittal.size_px[0].max(legend_width) + EDGE_PX;
    let height = below + axial.size_px[1].max(legend_height) + 2 * EDGE_PX;
    let mut image = Image::filled(width, height, PAPER);
    for (view, frame) in [(CORONAL, &coronal), (SAGITTAL, &sagittal), (AXIAL, &axial)] {
        draw(&mut image, build, view, frame, &at);
        let [left, bottom] = [frame.at_px[0], frame.at_px[1] + frame.size_px[1]];
        let bar = [whole(BAR_M * px_per_m), 4];
        image.fill([left + 12, bottom.saturating_sub(14)], bar, WHITE);
    }
    legend.draw(&mut image, [right, below - EDGE_PX - TITLE_PX / 2]);
    Ok(SlicePicture {
        name: OVERVIEW.to_owned(),
        png: image.to_png()?,
    })
}

/// A box around the patient, within the volume.
fn around(build: &ScanBuild) -> [Point3<f64>; 2] {
    let (low, high) = extent_m(&build.seen.volume);
    let margin = Vector3::repeat(MARGIN_M);
    let surfaces = build.seen.made.surfaces.iter();
    let boxes = surfaces.map(|it| needlebench_geometry::mesh::extent_m(&it.mesh));
    let all = boxes.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
    all.map_or([low, high], |[first, last]| {
        [(first - margin).sup(&low), (last + margin).inf(&high)]
    })
}

/// Where the slices meet: in the largest lesion, or in the middle of lungs or body.
fn focus(build: &ScanBuild) -> Point3<f64> {
    let made = &build.seen.made;
    let sizes = made.lesions.iter().filter_map(|it| it.size.as_ref());
    if let Some(size) = sizes.max_by(|a, b| a.volume_m3.total_cmp(&b.volume_m3)) {
        return size.centroid_m;
    }
    let middle = |wanted: SurfaceTissue| {
        let surfaces = made.surfaces.iter().filter(|it| it.tissue == wanted);
        let boxes = surfaces.map(|it| needlebench_geometry::mesh::extent_m(&it.mesh));
        let all = boxes.reduce(|a, b| [a[0].inf(&b[0]), a[1].sup(&b[1])]);
        all.map(|[low, high]| nalgebra::center(&low, &high))
    };
    let [low, high] = around(build);
    middle(SurfaceTissue::Lung)
        .or_else(|| middle(SurfaceTissue::Skin))
        .unwrap_or_else(|| nalgebra::center(&low, &high))
}

fn draw(image: &mut Image, build: &ScanBuild, view: View, frame: &Frame, at: &Point3<f64>) {
    let at_m = at[view.cut];
    shade(image, build, at_m, WINDOW_HU, frame);
    let made = &build.seen.made;
    for surface in &made.surfaces {
        for [a, b] in cut(&surface.mesh, view.cut, at_m) {
            line(image, frame.px(&a), frame.px(&b), color(surface.tissue));
        }
    }
    if let Some(skin) = made.skin() {
        draw_unseen(image, build, skin, view, frame, at_m);
    }
    for place in marker_places(build) {
        ring(image, frame.px(&place), RING_PX, MARKER_COLOR);
    }
    for measured in &made.lesions {
        let Some(size) = &measured.size else { continue };
        let [x, y] = frame.px(&size.centroid_m);
        let radius = f64::max(
            2.0 * RING_PX,
            0.6 * size.longest_m * LONG_PX / longest_m(build),
        );
        ring(image, [x, y], radius, color(SurfaceTissue::Lesion));
        cross(image, [x, y], 3.0, WHITE);
        let name = &measured.lesion.name;
        let place = [x + radius + 4.0, y - 8.0].map(|px| signed(whole(px)));
        write(image, place, name, color(SurfaceTissue::Lesion));
    }
    letters(image, view, frame, at_m);
}

fn longest_m(build: &ScanBuild) -> f64 {
    let [low, high] = around(build);
    (high - low).max()
}

/// Skin beyond the planes where the scan ends is the cut and no skin.
fn draw_unseen(
    image: &mut Image,
    build: &ScanBuild,
    skin: &Surface,
    view: View,
    frame: &Frame,
    at_m: f64,
) {
    let cuts = build.seen.field_of_view.cuts(&skin.mesh);
    for [a, b] in cut(&skin.mesh, view.cut, at_m) {
        let middle = nalgebra::center(&a, &b);
        let is_beyond =
            |cut: &needlebench_imaging::Cut| cut.normal.dot(&middle.coords) > cut.offset_m;
        if cuts.iter().any(is_beyond) {
            let (a, b) = (frame.px(&a), frame.px(&b));
            for off in [-1.0, 0.0, 1.0] {
                line(image, [a[0] + off, a[1]], [b[0] + off, b[1]], UNSEEN_COLOR);
                line(image, [a[0], a[1] + off], [b[0], b[1] + off], UNSEEN_COLOR);
            }
        }
    }
}

/// The markers of the registration, or those that were found.
fn marker_places(build: &ScanBuild) -> Vec<Point3<f64>> {
    if let Some(registered) = &build.registered {
        return registered.places_m.clone();
    }
    let found = build.seen.markers.iter().flat_map(|it| &it.markers);
    found
        .map(DetectedMarker::localised)
        .map(|it| it.at_m)
        .collect()
}

fn ring(image: &mut Image, [x, y]: [f64; 2], radius: f64, color: [u8; 3]) {
    const SIDES: usize = 24;
    let corner = |side: usize| {
        let angle = std::f64::consts::TAU * side as f64 / SIDES as f64;
        [x + radius * libm::cos(angle), y + radius * libm::sin(angle)]
    };
    for side in 0..SIDES {
        line(image, corner(side), corner(side + 1), color);
    }
}

fn write(image: &mut Image, [left, top]: [i64; 2], text: &str, color: [u8; 3]) {
    TextSize::SMALL.each_pixel(text, |x, y, opacity| {
        image.blend(left + x, top + y, color, opacity);
    });
}

/// Title above a slice, and the letters of the patient's sides around it.
fn letters(image: &mut Image, view: View, frame: &Frame, at_m: f64) {
    let [left, top] = frame.at_px;
    let [width, height] = frame.size_px;
    let axis = ["x", "y", "z"][view.cut];
    // Not -0, which reads as if it meant something.
    let at_mm = (1e4 * at_m).round() / 10.0 + 0.0;
    let title = format!("{}, {axis} = {at_mm:.1} mm", view.name);
    let title_top = top.saturating_sub(EDGE_PX + TITLE_PX / 2);
    write(image, [left, title_top].map(signed), &title, INK);
    let [letter_px, line_px] = TextSize::LARGE.extent_px("R");
    let [before, after, above, under] = view.letters.map(|letter| letter.to_string());
    let middle_x = left + (width - letter_px.min(width)) / 2;
    let middle_y = top + (height - line_px.min(height)) / 2;
    let places = [
        ([left - EDGE_PX + 8, middle_y], before),
        ([left + width + 8, middle_y], after),
        ([middle_x, top - EDGE_PX + 2], above),
        ([middle_x, top + height + 2], under),
    ];
    for (place, letter) in places {
        TextSize::LARGE.write(image, place.map(signed), &letter);
    }
}

/// One line of the legend.
struct Line {
    color: Option<[u8; 3]>,
    text: String,
    ink: [u8; 3],
}

struct Legend(Vec<Line>);

const LINE_PX: usize = 20;
const SWATCH_PX: usize = 12;
const INDENT_PX: usize = 20;

fn legend(build: &ScanBuild) -> Legend {
    let rows = overview_rows(&build.overview());
    let cells: Vec<[String; 5]> = rows.iter().map(cells).collect();
    let heading = ["structure", "ml", "from", "accuracy (mm)", "not known"].map(str::to_owned);
    let widths: [usize; 5] = std::array::from_fn(|column| {
        let all = cells.iter().chain([&heading]);
        let widths = all.map(|row| row[column].chars().count());
        widths.max().unwrap_or(0)
    });
    let text = |row: &[String; 5]| {
        let [name, volume, source, accuracy, unknown] = row;
        let [a, b, c, d, _] = widths;
        format!("{name:<a$}  {volume:>b$}  {source:<c$}  {accuracy:<d$}  {unknown}")
    };
    let line = |color, text, ink| Line { color, text, ink };
    let mut lines = vec![line(None, text(&heading), QUIET)];
    for (row, cells) in rows.iter().zip(&cells) {
        let ink = if row.volume_m3.is_some() || row.name == "markers" {
            INK
        } else {
            QUIET
        };
        lines.push(line(swatch(build, row), text(cells), ink));
    }
    lines.push(line(None, String::new(), INK));
    let unseen = "the scan ends here: no skin was seen".to_owned();
    lines.push(line(Some(UNSEEN_COLOR), unseen, INK));
    for note in [
        "rings: lesions and markers, projected onto each slice",
        "seen from the feet (axial), the front (coronal), the patient's left (sagittal)",
        "R right, L left, A anterior, P posterior, S superior, I inferior of the patient",
    ] {
        lines.push(line(None, note.to_owned(), QUIET));
    }
    let [low_hu, high_hu] = WINDOW_HU;
    let window = format!(
        "grey: {low_hu} to {high_hu} HU; white bar: {:.0} mm",
        1e3 * BAR_M
    );
    lines.push(line(None, window, QUIET));
    Legend(lines)
}

fn cells(row: &OverviewRow) -> [String; 5] {
    [
        row.in_words.clone(),
        volume_ml(row).unwrap_or_default(),
        row.source.in_words().to_owned(),
        row.accuracy.map(accuracy_mm).unwrap_or_default(),
        row.unknown.clone().unwrap_or_default(),
    ]
}

/// Colour of an outline that a row stands for.
fn swatch(build: &ScanBuild, row: &OverviewRow) -> Option<[u8; 3]> {
    if row.name == "markers" {
        return build.seen.markers.is_some().then_some(MARKER_COLOR);
    }
    let mut surfaces = build.seen.made.surfaces.iter();
    let surface = surfaces.find(|surface| surface.name == row.name)?;
    Some(color(surface.tissue))
}

impl Legend {
    fn size_px(&self) -> [usize; 2] {
        let widths = self.0.iter().map(|line| {
            let [width, _] = TextSize::SMALL.extent_px(&line.text);
            width + INDENT_PX
        });
        [widths.max().unwrap_or(0), LINE_PX * self.0.len()]
    }

    fn draw(&self, image: &mut Image, [left, top]: [usize; 2]) {
        let mut y = top;
        for line in &self.0 {
            if let Some(color) = line.color {
                image.fill([left, y + 3], [SWATCH_PX; 2], color);
            }
            write(
                image,
                [left + INDENT_PX, y].map(signed),
                &line.text,
                line.ink,
            );
            y += LINE_PX;
        }
    }
}
