//! Hounsfield units and labels on a grid.

use crate::VoxelGrid;

/// Of air, and of what a scanner did not see: padding outside its circle.
pub const AIR_HU: i16 = -1000;

/// A CT volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Where the voxels are.
    pub grid: VoxelGrid,
    /// One value per voxel, in the order of [`VoxelGrid::offset`]. Padding is air.
    pub hu: Vec<i16>,
    /// Slice thickness in m, over which one slice integrates, where it is known; the slice spacing may be less
    /// (overlap) or more (gap).
    pub slice_thickness_m: Option<f64>,
}

/// What each voxel belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelMap {
    /// Where the voxels are.
    pub grid: VoxelGrid,
    /// One label per voxel, in the order of [`VoxelGrid::offset`]; 0 is nothing.
    pub labels: Vec<u16>,
    /// Labels and what they are called, in the order of the labels.
    pub names: Vec<(u16, String)>,
}
