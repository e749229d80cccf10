//! Routes in voxels and among solids, against brute force.

mod normals;
mod solids;
mod voxels;
