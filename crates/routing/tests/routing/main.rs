//! Routes in voxels and among solids, against brute force.

mod solids;
mod voxels;
