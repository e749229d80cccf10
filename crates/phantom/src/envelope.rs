//! The two nested surfaces that everything is laid out by: the skin and the rib cage.

use nalgebra::{Point2, Point3, Vector3};
use needlebench_geometry::ConvexMesh;

use super::loft::{Level, loft, superellipse};
use super::{PhantomError, PhantomParameters};

/// Superellipse exponent of the skin's cross-sections: fuller than an ellipse, as the pectoral and
/// latissimus muscles make it (assumed).
const SKIN_EXPONENT: f64 = 2.4;
/// Superellipse exponent of the rib cage's cross-sections (assumed).
const CAGE_EXPONENT: f64 = 2.2;
/// Vertices of a skin cross-section, per quadrant. The polygon falls short of the smooth curve by
/// up to 1.3 mm between vertices.
const SKIN_VERTICES_PER_QUADRANT: usize = 6;
/// Heights of the skin's cross-sections as a fraction of the half length; dense where it curves.
const SKIN_LEVELS: [f64; 16] = [
    -1.0, -0.98, -0.91, -0.76, -0.58, -0.40, -0.22, WIDEST, 0.13, 0.31, 0.48, 0.64, 0.79, 0.91,
    0.98, 1.0,
];
/// Height of the widest level, as a fraction of the half length.
pub(super) const WIDEST: f64 = -0.05;
/// Sections shrink towards a point this far behind the middle, as a fraction of the half depth: the
/// back stays almost straight while chest and abdomen recede.
const TAPER_TOWARDS_BACK: f64 = 0.55;
/// Height of the second intercostal space at the mid-clavicular line, as a fraction of the half
/// length, and that line's distance from the middle as a fraction of the breadth (assumed; in the
/// middle of the layout's second and third rib, and above the middle of a lung).
const SECOND_SPACE: f64 = 0.42;
const MID_CLAVICULAR: f64 = 0.25;

/// Length of the phantom whose skeleton is tabulated (see [`Frame`]), m.
const REFERENCE_LENGTH_M: f64 = 0.408;
/// Cage of the tabulated layout at its widest level: half width, front y and back y, m. These are
/// what `male-p50` gives, rounded.
const REFERENCE_CAGE_M: [f64; 3] = [0.1145, -0.0931, 0.0915];

/// A superelliptic cross-section in a horizontal plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    pub half_width_m: f64,
    pub center_y_m: f64,
    pub half_depth_m: f64,
    pub exponent: f64,
}

impl Section {
    pub(crate) fn front_m(&self) -> f64 {
        self.center_y_m - self.half_depth_m
    }

    pub fn back_m(&self) -> f64 {
        self.center_y_m + self.half_depth_m
    }

    /// The section moved outwards by a distance, m.
    pub(crate) fn grown_by(&self, by_m: f64) -> Self {
        Self {
            half_width_m: self.half_width_m + by_m,
            half_depth_m: self.half_depth_m + by_m,
            ..*self
        }
    }

    /// Half depth at a distance from the middle; 0 beyond the half width.
    fn half_depth_at_m(&self, x_m: f64) -> f64 {
        let across = (x_m / self.half_width_m).abs().min(1.0);
        self.half_depth_m * libm::pow(1.0 - libm::pow(across, self.exponent), 1.0 / self.exponent)
    }

    pub(crate) fn front_at_m(&self, x_m: f64) -> f64 {
        self.center_y_m - self.half_depth_at_m(x_m)
    }

    /// Point at an angle from the back (0) over the left side (pi/2) to the front (pi).
    pub(crate) fn at_angle(&self, angle_rad: f64) -> Point2<f64> {
        let (sine, cosine) = libm::sincos(angle_rad);
        let power = 2.0 / self.exponent;
        Point2::new(
            self.half_width_m * libm::pow(sine.abs(), power).copysign(sine),
            self.center_y_m + self.half_depth_m * libm::pow(cosine.abs(), power).copysign(cosine),
        )
    }

    /// Angle, as in `Section::at_angle`, of the point at `x_m >= 0` of the front half.
    pub(crate) fn front_angle_rad(&self, x_m: f64) -> f64 {
        let sine = libm::pow(
            (x_m / self.half_width_m).clamp(0.0, 1.0),
            self.exponent / 2.0,
        );
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        libm::atan2(sine, -cosine)
    }
}

/// Skin and rib-cage surfaces of one set of parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the postfix is the unit")]
pub(super) struct Envelope {
    half_breadth_m: f64,
    half_depth_m: f64,
    pub half_length_m: f64,
    lateral_wall_m: f64,
    posterior_wall_m: f64,
    /// Skin to pleura in the middle of the chest, behind the sternum.
    pub sternal_wall_m: f64,
}

impl Envelope {
    /// Lays out the surfaces; fails when the walls leave no room for organs or bones.
    pub fn new(parameters: &PhantomParameters) -> Result<Self, PhantomError> {
        const MILLI: f64 = 1e-3;
        /// Narrowest half width and depth of the cage into which the organs can be scaled.
        const LEAST_HALF_WIDTH_MM: f64 = 45.0;
        const LEAST_DEPTH_MM: f64 = 80.0;
        /// Soft tissue that must remain over and under a bone in the wall.
        const TISSUE_AROUND_BONE_MM: f64 = 4.0;

        let mut envelope = Self {
            half_breadth_m: 0.5 * MILLI * parameters.breadth_mm,
            half_depth_m: 0.5 * MILLI * parameters.depth_mm,
            half_length_m: 0.5 * MILLI * parameters.length_mm,
            lateral_wall_m: MILLI * parameters.lateral_wall_mm,
            posterior_wall_m: MILLI * parameters.posterior_wall_mm,
            sternal_wall_m: 0.0,
        };
        let needs = |what, room_mm: f64, needed_mm: f64| {
            if room_mm >= needed_mm {
                Ok(())
            } else {
                Err(PhantomError::NoRoom {
                    what,
                    room_mm,
                    needed_mm,
                })
            }
        };

        // The chest wall is prescribed where it is measured: find the front of the cage such that
        // its superellipse passes the stated distance behind the skin there.
        let z_m = SECOND_SPACE * envelope.half_length_m;
        let x_m = MID_CLAVICULAR * MILLI * parameters.breadth_mm;
        let skin = envelope.skin_section(z_m);
        let cage = envelope.cage_section(z_m);
        needs(
            "half the cage's width",
            cage.half_width_m / MILLI,
            LEAST_HALF_WIDTH_MM,
        )?;
        let pleura_y_m = skin.front_at_m(x_m) + MILLI * parameters.chest_wall_mm;
        let unit = Section {
            half_depth_m: 1.0,
            center_y_m: 0.0,
            ..cage
        };
        let depth_share = 1.0 + unit.half_depth_at_m(x_m);
        let half_depth_m = (cage.back_m() - pleura_y_m) / depth_share;
        needs(
            "the cage's depth",
            2.0 * half_depth_m / MILLI,
            LEAST_DEPTH_MM,
        )?;
        envelope.sternal_wall_m = cage.back_m() - 2.0 * half_depth_m - skin.front_m();

        let rib_needs_mm = parameters.rib_thickness_mm + TISSUE_AROUND_BONE_MM;
        needs(
            "side wall for the ribs",
            parameters.lateral_wall_mm,
            rib_needs_mm,
        )?;
        needs(
            "back wall for the ribs",
            parameters.posterior_wall_mm,
            rib_needs_mm,
        )?;
        needs(
            "wall in front of the pleura for the sternum",
            envelope.sternal_wall_m / MILLI,
            parameters.sternum_thickness_mm + TISSUE_AROUND_BONE_MM,
        )?;
        Ok(envelope)
    }

    /// Scale of the skin's section at a height given as a fraction of the half length.
    ///
    /// Concave (the second derivative of every term is at most 0), which makes the skin convex;
    /// 1 at the widest level.
    fn skin_scale(height: f64) -> f64 {
        /// Share by which the section shrinks towards the shoulders and the waist (assumed), and
        /// the power of the height at which it does.
        const SHOULDERS: (f64, f64) = (0.34, 2.6);
        const WAIST: (f64, f64) = (0.16, 2.0);
        /// Rounding of the two ends: begins at this height and takes this share.
        const ROUNDED_FROM: f64 = 0.88;
        const ROUNDED_BY: f64 = 0.10;

        let above = height - WIDEST;
        let ((share, power), way) = if above > 0.0 {
            (SHOULDERS, above / (1.0 - WIDEST))
        } else {
            (WAIST, -above / (1.0 + WIDEST))
        };
        let into_end = ((height.abs() - ROUNDED_FROM) / (1.0 - ROUNDED_FROM)).max(0.0);
        1.0 - share * libm::pow(way, power) - ROUNDED_BY * into_end.powi(3)
    }

    /// The smooth skin at a height, m.
    pub(crate) fn skin_section(&self, z_m: f64) -> Section {
        let scale = Self::skin_scale(z_m / self.half_length_m);
        Section {
            half_width_m: scale * self.half_breadth_m,
            center_y_m: (1.0 - scale) * TAPER_TOWARDS_BACK * self.half_depth_m,
            half_depth_m: scale * self.half_depth_m,
            exponent: SKIN_EXPONENT,
        }
    }

    /// The inside of the rib cage (the parietal pleura) at a height, m.
    pub(crate) fn cage_section(&self, z_m: f64) -> Section {
        /// The cage narrows to a dome above this height and would close at the other (fractions of
        /// the half length; assumed).
        const DOME: (f64, f64) = (0.25, 1.10);

        let skin = self.skin_section(z_m);
        let into_dome = ((z_m / self.half_length_m - DOME.0) / (DOME.1 - DOME.0)).clamp(0.0, 0.99);
        let narrowing = (1.0 - into_dome * into_dome).sqrt();
        let front_m = skin.front_m() + self.sternal_wall_m;
        let back_m = skin.back_m() - self.posterior_wall_m;
        Section {
            half_width_m: narrowing * (skin.half_width_m - self.lateral_wall_m),
            center_y_m: 0.5 * (front_m + back_m),
            half_depth_m: 0.5 * (back_m - front_m),
            exponent: CAGE_EXPONENT,
        }
    }

    /// The cage at its widest level.
    pub(crate) fn widest_cage(&self) -> Section {
        self.cage_section(WIDEST * self.half_length_m)
    }

    /// The skin as a convex polyhedron in the phantom frame, inscribed in the smooth skin.
    pub(crate) fn skin_mesh(&self) -> ConvexMesh {
        // The loft scales about its own origin, which is the taper's fixed point; shift it back.
        let taper_y_m = TAPER_TOWARDS_BACK * self.half_depth_m;
        let polygon: Vec<Point2<f64>> = superellipse(
            [self.half_breadth_m, self.half_depth_m],
            SKIN_EXPONENT,
            SKIN_VERTICES_PER_QUADRANT,
        )
        .into_iter()
        .map(|p| Point2::new(p.x, p.y - taper_y_m))
        .collect();
        let levels = SKIN_LEVELS.map(|height| Level {
            z_m: height * self.half_length_m,
            scale: Self::skin_scale(height),
        });
        let mut mesh = loft(&polygon, &levels);
        for vertex in &mut mesh.0.vertices_m {
            vertex.y += taper_y_m;
        }
        mesh
    }

    /// The map from the tabulated layout into this thorax.
    pub fn frame(&self) -> Frame {
        let cage = self.widest_cage();
        let [half_width_m, front_m, back_m] = REFERENCE_CAGE_M;
        let scale = Vector3::new(
            cage.half_width_m / half_width_m,
            (cage.back_m() - cage.front_m()) / (back_m - front_m),
            2.0 * self.half_length_m / REFERENCE_LENGTH_M,
        );
        Frame {
            scale,
            shift_y_m: cage.front_m() - scale.y * front_m,
        }
    }
}

/// Affine map that fits the layout tabulated for the median man into another cage.
///
/// Tables are in millimetres of the phantom frame of a 289 x 253 x 408 mm chest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    scale: Vector3<f64>,
    shift_y_m: f64,
}

impl Frame {
    /// Place of a tabulated point, m.
    pub fn point(&self, reference_mm: [f64; 3]) -> Point3<f64> {
        let scaled_m = (1e-3 * Vector3::from(reference_mm)).component_mul(&self.scale);
        Point3::from(scaled_m + Vector3::new(0.0, self.shift_y_m, 0.0))
    }

    /// Place of a tabulated height, m.
    pub fn height_m(&self, reference_mm: f64) -> f64 {
        1e-3 * self.scale.z * reference_mm
    }

    /// Size of a tabulated radius or thickness, m: the smallest of the three scales, so that what
    /// is apart in the table stays apart.
    pub fn size_m(&self, reference_mm: f64) -> f64 {
        1e-3 * self.scale.min() * reference_mm
    }
}

#[cfg(test)]
mod tests {
    use super::super::loft::assert_convex_and_closed;
    use super::*;

    fn median() -> Envelope {
        Envelope::new(&PhantomParameters::default()).unwrap()
    }

    #[test]
    fn tabulated_layout_belongs_to_the_median_man() {
        /// The table's cage is rounded to 0.5 mm.
        const ROUNDED_M: f64 = 0.5e-3;
        let cage = median().widest_cage();
        assert!((cage.half_width_m - REFERENCE_CAGE_M[0]).abs() < ROUNDED_M);
        assert!((cage.front_m() - REFERENCE_CAGE_M[1]).abs() < ROUNDED_M);
        assert!((cage.back_m() - REFERENCE_CAGE_M[2]).abs() < ROUNDED_M);
    }

    #[test]
    fn skin_scale_is_strictly_concave_and_one_at_the_widest_level() {
        assert_eq!(Envelope::skin_scale(WIDEST), 1.0);
        for triple in SKIN_LEVELS.windows(3) {
            let [low, middle, high] = [triple[0], triple[1], triple[2]];
            let way = (middle - low) / (high - low);
            let chord = (1.0 - way) * Envelope::skin_scale(low) + way * Envelope::skin_scale(high);
            assert!(Envelope::skin_scale(middle) > chord + 1e-4, "at {middle}");
        }
    }

    #[test]
    fn skin_is_convex_closed_and_of_plausible_volume() {
        let mesh = median().skin_mesh();
        assert!((250..=450).contains(&mesh.0.vertices_m.len()));
        let volume = assert_convex_and_closed(&mesh);
        // Between the ellipsoid and the box of the same breadth, depth and length.
        let bounding = 0.289 * 0.253 * 0.408;
        assert!(volume > 0.6 * bounding && volume < 0.8 * bounding);
    }

    #[test]
    fn front_angle_finds_the_point_again() {
        let cage = median().widest_cage();
        for x_m in [0.0, 0.02, 0.07, 0.11] {
            let point = cage.at_angle(cage.front_angle_rad(x_m));
            assert!((point.x - x_m).abs() < 1e-12);
            assert!(point.y <= cage.center_y_m);
            assert!((point.y - cage.front_at_m(x_m)).abs() < 1e-12);
        }
    }
}
