//! Volumes and label maps: what is read as meant, what is refused, and that nothing makes the readers panic.

mod archive;
mod dicom;
mod directory;
mod labels;
mod made;
mod metaimage;
mod mgh;
mod mutated;
mod names;
mod nifti;
mod nrrd;
mod sent;
mod structure_set;
