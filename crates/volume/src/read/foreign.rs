//! Formats that are not read, told by their first bytes or their name: what they are, and how to make one of them that is
//! read.

use std::path::Path;

/// The formats that are read, for a hint.
pub(super) const READ: &str = "a CT is read from DICOM (a file, or a folder, also in a ZIP archive), NIfTI \
     (.nii, .nii.gz, .hdr with .img), NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), and MGH (.mgh, .mgz)";

const UNPACK: &str = "unpack it, and name the DICOM folder or the volume in it";
const PICTURE: &str = "pictures have neither Hounsfield units nor places: export the scan as DICOM, or a volume as NIfTI, \
     NRRD or MetaImage";
const CONVERT: &str = "convert it to NIfTI, NRRD or MetaImage, e.g. with 3D Slicer";
const SURFACE: &str = "surfaces are parts of a scenario, `[[phantom.parts]]`; a volume has voxels";
const NO_PLACE: &str =
    "it has no place of its voxels: write it with its affine, e.g. with nibabel or SimpleITK";
const MINC: &str = "convert it to NIfTI with mnc2nii";

/// First bytes, what has them, and what to do.
const BYTES: &[(&[u8], &str, &str)] = &[
    (b"PK\x03\x04", "a ZIP archive", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    (
        b"BZh",
        "compressed with bzip2",
        "decompress it with bunzip2",
    ),
    (
        b"\xfd7zXZ\0",
        "compressed with xz",
        "decompress it with unxz",
    ),
    (
        b"\x28\xb5\x2f\xfd",
        "compressed with Zstandard",
        "decompress it with unzstd",
    ),
    (b"# vtk DataFile", "a VTK file", CONVERT),
    (b"<VTKFile", "a VTK file", CONVERT),
    (b"MATLAB ", "a MATLAB file", NO_PLACE),
    (b"\x93NUMPY", "a NumPy array", NO_PLACE),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file, as MINC 2 is", MINC),
    (b"CDF\x01", "a NetCDF file, as MINC 1 is", MINC),
    (b"CDF\x02", "a NetCDF file, as MINC 1 is", MINC),
    (b"\x89PNG\r\n\x1a\n", "a PNG picture", PICTURE),
    (b"\xff\xd8\xff", "a JPEG picture", PICTURE),
    (b"\0\0\0\x0cjP  ", "a JPEG 2000 picture", PICTURE),
    (b"\xff\x4f\xff\x51", "a JPEG 2000 picture", PICTURE),
    (b"II*\0", "a TIFF picture", PICTURE),
    (b"MM\0*", "a TIFF picture", PICTURE),
    (b"GIF8", "a GIF picture", PICTURE),
    (b"%PDF-", "a PDF document", PICTURE),
    (b"solid ", "an STL surface", SURFACE),
    (b"ply\n", "a PLY surface", SURFACE),
    (b"ply\r\n", "a PLY surface", SURFACE),
    (
        b"# === DATA DESCRIPTION FILE",
        "a PAR file of Philips",
        "convert it to NIfTI with dcm2niix, or export DICOM",
    ),
    (b"!INTERFILE", "an Interfile header", CONVERT),
    (
        b"NRRD",
        "NRRD of a version that is not read",
        "save it again, e.g. with 3D Slicer",
    ),
];

/// Ends of names, what they are, and what to do.
const NAMES: &[(&str, &str, &str)] = &[
    (
        ".par",
        "a PAR file of Philips",
        "convert it to NIfTI with dcm2niix, or export DICOM",
    ),
    (
        ".rec",
        "a REC file of Philips",
        "convert it to NIfTI with dcm2niix, or export DICOM",
    ),
    (".raw", "voxels without a header", RAW),
    (".zraw", "voxels without a header", RAW),
    (".bin", "voxels without a header", RAW),
    (".dat", "voxels without a header", RAW),
    (".vol", "voxels without a header", RAW),
    (".stl", "an STL surface", SURFACE),
    (".obj", "an OBJ surface", SURFACE),
    (".mnc", "a MINC file", MINC),
    (".mat", "a MATLAB file", NO_PLACE),
    (".vtk", "a VTK file", CONVERT),
    (".vti", "a VTK file", CONVERT),
    (".bmp", "a BMP picture", PICTURE),
];

const RAW: &str = "name the header beside it (.nhdr, .mhd or .hdr), or write one with size, type, spacing and directions";

/// Where the mark of a tar archive is.
const TAR_AT: usize = 257;

/// What a file is that is not read, with what to do; none for one that nothing is known of.
pub(super) fn foreign(first: &[u8], path: &Path) -> Option<(&'static str, &'static str)> {
    let by_bytes = BYTES.iter().find(|(bytes, ..)| first.starts_with(bytes));
    if let Some((_, what, hint)) = by_bytes {
        return Some((what, hint));
    }
    if first
        .get(TAR_AT..)
        .is_some_and(|rest| rest.starts_with(b"ustar"))
    {
        return Some(("a tar archive", UNPACK));
    }
    if first.starts_with(b"<?xml") && first.windows(8).any(|each| each == b"<VTKFile") {
        return Some(("a VTK file", CONVERT));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    NAMES
        .iter()
        .find(|(end, ..)| name.ends_with(end))
        .map(|(_, what, hint)| (*what, *hint))
}
