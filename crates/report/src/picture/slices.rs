//! Slices of a scan with the outlines of what was built from it.
//!
//! In the radiological convention: a slice is seen from the feet, so that the patient's right is on the left, and the front is
//! up; views from the front and from the side have the head up. Letters at the edges say so.

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_patient::ct::ScanBuild;
use needlebench_render::{Image, PictureError, TextSize};
use needlebench_volume::{SurfaceTissue, Volume};

/// A picture and the name of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlicePicture {
    /// Name of its file.
    pub name: String,
    /// Its bytes.
    pub png: Vec<u8>,
}

/// Length of the longer side of what is shown of the scan, px.
const LONG_PX: f64 = 900.0;

/// Around it: for letters, title and legend.
const EDGE_PX: usize = 34;
const TITLE_PX: usize = 30;

/// Lowest and highest density that are told apart, HU: for lung.
const LUNG_WINDOW_HU: [f64; 2] = [-1350.0, 150.0];
/// For soft tissue and bone.
const SOFT_WINDOW_HU: [f64; 2] = [-160.0, 240.0];

pub(super) const PAPER: [u8; 3] = [246, 246, 244];
pub(super) const MARKER_COLOR: [u8; 3] = [255, 122, 200];
const CENTRE_COLOR: [u8; 3] = [255, 255, 255];

pub(super) fn color(tissue: SurfaceTissue) -> [u8; 3] {
    match tissue {
        SurfaceTissue::Skin => [245, 166, 60],
        SurfaceTissue::Bone => [250, 235, 130],
        SurfaceTissue::Vessel => [235, 70, 70],
        SurfaceTissue::Organ => [170, 130, 240],
        SurfaceTissue::Lung => [90, 190, 250],
        SurfaceTissue::Lesion => [90, 240, 110],
        SurfaceTissue::Beside => [150, 160, 175],
    }
}

/// A way to look at the scan: which axes of `ct` run to the right and down, and which one is cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) name: &'static str,
    axes: [usize; 2],
    /// Whether the second axis runs up.
    up: bool,
    pub(super) cut: usize,
    /// Left, right, top, bottom.
    pub(super) letters: [char; 4],
}

pub(super) const AXIAL: View = View {
    name: "axial",
    axes: [0, 1],
    up: false,
    cut: 2,
    letters: ['R', 'L', 'A', 'P'],
};
pub(super) const CORONAL: View = View {
    name: "coronal",
    axes: [0, 2],
    up: true,
    cut: 1,
    letters: ['R', 'L', 'S', 'I'],
};
pub(super) const SAGITTAL: View = View {
    name: "sagittal",
    axes: [1, 2],
    up: true,
    cut: 0,
    letters: ['A', 'P', 'S', 'I'],
};

/// One picture to be made.
struct Slice {
    name: String,
    title: String,
    view: View,
    /// Place of the cut along its axis, m.
    at_m: f64,
    window_hu: [f64; 2],
}

/// Slices through every lesion in three directions, one through each marker that the registration rests on, and three
/// through the body.
///
/// # Errors
/// A picture that cannot be encoded.
pub(super) fn slice_pictures(build: &ScanBuild) -> Result<Vec<SlicePicture>, PictureError> {
    let mut wanted = Vec::new();
    if let Some(skin) = build.seen.made.skin() {
        let [low, high] = needlebench_geometry::mesh::extent_m(&skin.mesh);
        for (number, share) in [0.25, 0.5, 0.75].into_iter().enumerate() {
            wanted.push(Slice {
                name: format!("body_{}.png", number + 1),
                title: "body".to_owned(),
                view: AXIAL,
                at_m: low.z + share * (high.z - low.z),
                window_hu: LUNG_WINDOW_HU,
            });
        }
    }
    for measured in &build.seen.made.lesions {
        let Some(size) = &measured.size else { continue };
        for view in [AXIAL, CORONAL, SAGITTAL] {
            wanted.push(Slice {
                name: format!("lesion_{}_{}.png", measured.lesion.name, view.name),
                title: format!("lesion {}", measured.lesion.name),
                view,
                at_m: size.centroid_m[view.cut],
                window_hu: if measured.lesion.in_lung {
                    LUNG_WINDOW_HU
                } else {
                    SOFT_WINDOW_HU
                },
            });
        }
    }
    if let Some(registered) = &build.registered {
        for (marker, place) in registered
            .registration
            .markers
            .iter()
            .zip(&registered.places_m)
        {
            wanted.push(Slice {
                name: format!("marker_{}.png", marker.name),
                title: format!("marker {}", marker.name),
                view: AXIAL,
                at_m: place.z,
                window_hu: LUNG_WINDOW_HU,
            });
        }
    }
    wanted.iter().map(|slice| drawn(build, slice)).collect()
}

/// From places of the scan to pixels of the picture.
pub(super) struct Frame {
    view: View,
    px_per_m: f64,
    /// Place at the left and top edge of what is shown of the scan, along the view's axes, m.
    first_m: [f64; 2],
    /// Left and top edge of it in the picture.
    pub(super) at_px: [usize; 2],
    /// Of what is shown of the scan.
    pub(super) size_px: [usize; 2],
}

impl Frame {
    fn new(volume: &Volume, view: View) -> Self {
        let (low, high) = extent_m(volume);
        let [across, along] = view.axes;
        let longest_m = f64::max(high[across] - low[across], high[along] - low[along]);
        let mut frame = Self::of_box([low, high], view, LONG_PX / longest_m);
        frame.at_px = [EDGE_PX, TITLE_PX + EDGE_PX];
        frame
    }

    /// Of a box in `ct`.
    pub(super) fn of_box([low, high]: [Point3<f64>; 2], view: View, px_per_m: f64) -> Self {
        let [across, along] = view.axes;
        let lengths_m = [high[across] - low[across], high[along] - low[along]];
        Self {
            view,
            px_per_m,
            first_m: [low[across], if view.up { high[along] } else { low[along] }],
            at_px: [0; 2],
            size_px: lengths_m.map(|length_m| whole(length_m * px_per_m).max(1)),
        }
    }

    pub(super) fn px(&self, place: &Point3<f64>) -> [f64; 2] {
        let [across, along] = self.view.axes;
        let down = if self.view.up { -1.0 } else { 1.0 };
        [
            self.at_px[0] as f64 + (place[across] - self.first_m[0]) * self.px_per_m,
            self.at_px[1] as f64 + down * (place[along] - self.first_m[1]) * self.px_per_m,
        ]
    }

    /// Place of the middle of a pixel of the scan.
    fn place(&self, at_m: f64, [x, y]: [usize; 2]) -> Point3<f64> {
        let [across, along] = self.view.axes;
        let down = if self.view.up { -1.0 } else { 1.0 };
        let mut place = Point3::origin();
        place[self.view.cut] = at_m;
        place[across] = self.first_m[0] + (x as f64 + 0.5) / self.px_per_m;
        place[along] = self.first_m[1] + down * (y as f64 + 0.5) / self.px_per_m;
        place
    }
}

/// Lowest and highest place of a volume, its outermost voxels included.
pub(super) fn extent_m(volume: &Volume) -> (Point3<f64>, Point3<f64>) {
    let half = Vector3::from(volume.grid.spacing_m()) * 0.5;
    let first = volume.grid.first_m();
    let last = Vector3::from(volume.grid.size().map(|count| count as f64 - 1.0));
    let last = first + last.component_mul(&Vector3::from(volume.grid.spacing_m()));
    (first - half, last + half)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative, and of a picture"
)]
pub(super) fn whole(value: f64) -> usize {
    value.round().max(0.0) as usize
}

fn drawn(build: &ScanBuild, slice: &Slice) -> Result<SlicePicture, PictureError> {
    let frame = Frame::new(&build.seen.volume, slice.view);
    let [width, height] = frame.size_px;
    let legend_px = TextSize::SMALL.line_px() + 8;
    let mut image = Image::filled(
        width + 2 * EDGE_PX,
        height + 2 * EDGE_PX + TITLE_PX + legend_px,
        PAPER,
    );
    shade(&mut image, build, slice.at_m, slice.window_hu, &frame);
    let mut shown: Vec<(&str, [u8; 3])> = Vec::new();
    for surface in &build.seen.made.surfaces {
        let color = color(surface.tissue);
        let segments = cut(&surface.mesh, slice.view.cut, slice.at_m);
        if !segments.is_empty() {
            shown.push((&surface.name, color));
        }
        for [a, b] in segments {
            line(&mut image, frame.px(&a), frame.px(&b), color);
        }
    }
    if marks(&mut image, build, slice, &frame) {
        shown.push(("marker", MARKER_COLOR));
    }
    write(&mut image, slice, &frame, &shown);
    Ok(SlicePicture {
        name: slice.name.clone(),
        png: image.to_png()?,
    })
}

/// Densities as greys.
pub(super) fn shade(
    image: &mut Image,
    build: &ScanBuild,
    at_m: f64,
    [low_hu, high_hu]: [f64; 2],
    frame: &Frame,
) {
    let [left, top] = frame.at_px;
    let [width, height] = frame.size_px;
    for y in 0..height {
        for x in 0..width {
            let hu = interpolated(
                &build.seen.volume,
                &frame.place(at_m, [x, y]),
                frame.view.cut,
            );
            let share = ((hu - low_hu) / (high_hu - low_hu)).clamp(0.0, 1.0);
            let grey = u8::try_from(whole(255.0 * share)).unwrap_or(u8::MAX);
            image.fill([left + x, top + y], [1, 1], [grey; 3]);
        }
    }
}

/// Between the voxels of the nearest slice.
fn interpolated(volume: &Volume, place: &Point3<f64>, cut: usize) -> f64 {
    let size = volume.grid.size();
    let index = volume.grid.index_from_ct(place);
    let mut low = [0; 3];
    let mut share = [0.0; 3];
    for axis in 0..3 {
        let at = index[axis].clamp(0.0, size[axis] as f64 - 1.0);
        let at = if axis == cut { at.round() } else { at };
        low[axis] = whole(at.floor()).min(size[axis] - 1);
        share[axis] = at - low[axis] as f64;
    }
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let mut weight = 1.0;
        let mut voxel = low;
        for axis in 0..3 {
            if corner >> axis & 1 == 1 {
                weight *= share[axis];
                voxel[axis] = (voxel[axis] + 1).min(size[axis] - 1);
            } else {
                weight *= 1.0 - share[axis];
            }
        }
        if weight > 0.0 {
            sum += weight * f64::from(volume.hu[volume.grid.offset(voxel)]);
        }
    }
    sum
}

/// Where a plane across an axis cuts a surface.
pub(super) fn cut(mesh: &TriangleMesh, axis: usize, at_m: f64) -> Vec<[Point3<f64>; 2]> {
    let mut segments = Vec::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|at| mesh.vertices_m[at as usize]);
        let above = corners.map(|corner| corner[axis] > at_m);
        if above[0] == above[1] && above[1] == above[2] {
            continue;
        }
        let mut ends = Vec::with_capacity(2);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if above[k] != above[(k + 1) % 3] {
                ends.push(a + (b - a) * ((at_m - a[axis]) / (b[axis] - a[axis])));
            }
        }
        if let [a, b] = ends[..] {
            segments.push([a, b]);
        }
    }
    segments
}

/// A line of one and a half pixels.
pub(super) fn line(image: &mut Image, a: [f64; 2], b: [f64; 2], color: [u8; 3]) {
    const HALF_PX: f64 = 0.75;
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let squared = dx * dx + dy * dy;
    let range = |k: usize| {
        let reach = HALF_PX + 1.0;
        [a[k].min(b[k]) - reach, a[k].max(b[k]) + reach].map(|at| whole(at.max(0.0)))
    };
    let ([left, right], [top, bottom]) = (range(0), range(1));
    for y in top..=bottom {
        for x in left..=right {
            let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
            let along = if squared > 0.0 {
                (((px - a[0]) * dx + (py - a[1]) * dy) / squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let away = libm::hypot(px - a[0] - along * dx, py - a[1] - along * dy);
            let cover = (HALF_PX + 0.5 - away).clamp(0.0, 1.0);
            if let (Ok(x), Ok(y), Ok(opacity)) = (
                i64::try_from(x),
                i64::try_from(y),
                u8::try_from(whole(255.0 * cover)),
            ) {
                image.blend(x, y, color, opacity);
            }
        }
    }
}

pub(super) fn cross(image: &mut Image, [x, y]: [f64; 2], reach: f64, color: [u8; 3]) {
    line(image, [x - reach, y], [x + reach, y], color);
    line(image, [x, y - reach], [x, y + reach], color);
}

/// Markers near the slice and centres of lesions in it; whether there is a marker.
fn marks(image: &mut Image, build: &ScanBuild, slice: &Slice, frame: &Frame) -> bool {
    const NEAR_M: f64 = 4e-3;
    let near =
        |place: &Point3<f64>, reach_m: f64| (place[slice.view.cut] - slice.at_m).abs() <= reach_m;
    let mut has_marker = false;
    for place in build
        .registered
        .iter()
        .flat_map(|registered| &registered.places_m)
    {
        if near(place, NEAR_M) {
            cross(image, frame.px(place), 9.0, MARKER_COLOR);
            has_marker = true;
        }
    }
    for size in build
        .seen
        .made
        .lesions
        .iter()
        .filter_map(|measured| measured.size.as_ref())
    {
        if near(&size.centroid_m, 1e-6) {
            cross(image, frame.px(&size.centroid_m), 4.0, CENTRE_COLOR);
        }
    }
    has_marker
}

fn write(image: &mut Image, slice: &Slice, frame: &Frame, shown: &[(&str, [u8; 3])]) {
    let signed = |px: usize| i64::try_from(px).unwrap_or(i64::MAX);
    let [width, height] = frame.size_px;
    let [low_hu, high_hu] = slice.window_hu;
    let axis = ["x", "y", "z"][slice.view.cut];
    let title = format!(
        "{}: {} at {axis} = {:.1} mm, {low_hu} to {high_hu} HU; bar 50 mm",
        slice.title,
        slice.view.name,
        1e3 * slice.at_m
    );
    TextSize::SMALL.write(image, [signed(EDGE_PX), 8], &title);
    let [left, right, top, bottom] = slice.view.letters.map(|letter| letter.to_string());
    let [letter_px, line_px] = TextSize::LARGE.extent_px("R");
    let middle_x = EDGE_PX + (width - letter_px.min(width)) / 2;
    let middle_y = TITLE_PX + EDGE_PX + (height - line_px.min(height)) / 2;
    TextSize::LARGE.write(image, [8, signed(middle_y)], &left);
    TextSize::LARGE.write(
        image,
        [signed(width + EDGE_PX + 8), signed(middle_y)],
        &right,
    );
    TextSize::LARGE.write(image, [signed(middle_x), signed(TITLE_PX + 6)], &top);
    TextSize::LARGE.write(
        image,
        [signed(middle_x), signed(TITLE_PX + EDGE_PX + height + 4)],
        &bottom,
    );
    let bar_px = whole(0.05 * frame.px_per_m);
    image.fill(
        [EDGE_PX + 12, TITLE_PX + EDGE_PX + height - 14],
        [bar_px, 4],
        [255, 255, 255],
    );
    let mut x = EDGE_PX;
    let y = TITLE_PX + 2 * EDGE_PX + height;
    for (name, color) in shown {
        let [text_px, _] = TextSize::SMALL.extent_px(name);
        if x + 18 + text_px > width + 2 * EDGE_PX {
            break;
        }
        image.fill([x, y + 2], [12, 12], *color);
        TextSize::SMALL.write(image, [signed(x + 18), signed(y)], name);
        x += 18 + text_px + 18;
    }
}
