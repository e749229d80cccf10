//! Shapes with exact distances.

use nalgebra::{Point3, Vector3};
use needlebench_probability::{Anatomy, Body, Case, HalfPlane, Law, Needle, Structure};

pub const DEPTH_M: f64 = 0.09;

/// 18 G.
pub const NEEDLE: Needle = Needle {
    depth_m: DEPTH_M,
    throw_m: 0.0,
    radius_m: 0.635e-3,
};

#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// Beyond a plane.
    HalfSpace { normal: Vector3<f64>, offset_m: f64 },
    Ball {
        centre_m: Point3<f64>,
        radius_m: f64,
    },
    /// A pipe about the x axis, from its radius outwards.
    Around { radius_m: f64 },
    /// Round, along a line without end.
    Rod {
        point_m: Point3<f64>,
        axis: Vector3<f64>,
        radius_m: f64,
    },
}

impl Shape {
    fn distance_m(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::HalfSpace { normal, offset_m } => offset_m - normal.dot(&point.coords),
            Self::Ball { centre_m, radius_m } => (point - centre_m).norm() - radius_m,
            Self::Around { radius_m } => radius_m - point.coords.yz().norm(),
            Self::Rod {
                point_m,
                axis,
                radius_m,
            } => {
                let off = point - point_m;
                (off - axis * axis.dot(&off)).norm() - radius_m
            }
        }
    }
}

pub struct Shapes(pub Vec<Shape>);

impl Anatomy for Shapes {
    fn distance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64 {
        self.0[structure].distance_m(point_m)
    }
}

pub fn structure(boundary_sd_m: f64, covers: Vec<Vec<HalfPlane>>) -> Structure {
    Structure {
        name: "vessel".to_owned(),
        body: Body::Lung,
        boundary_sd_m,
        covers,
    }
}

pub fn case<'a>(law: &'a Law, structures: &'a [Structure], shapes: &'a Shapes) -> Case<'a, Shapes> {
    Case::new(law, NEEDLE, structures, shapes).unwrap()
}
