//! Routes in voxels and among solids, against brute force.

mod bent;
mod layers;
mod normals;
mod solids;
mod voxels;
