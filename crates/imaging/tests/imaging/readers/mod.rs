//! Readers: what is read as meant, what is refused, and that nothing makes them panic.

mod archive;
mod dicom;
mod directory;
mod labels;
mod made;
mod metaimage;
mod mgh;
mod mutated;
mod nifti;
mod nrrd;
mod sent;
mod structure_set;
