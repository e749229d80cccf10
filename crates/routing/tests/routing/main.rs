//! Routes in voxels and among solids, against brute force.

mod layers;
mod normals;
mod solids;
mod voxels;
