#!/usr/bin/env python3
"""Synthetic scans of `needlebench ct synth`, read by nibabel, pydicom and SimpleITK.

Of each scan, straight and tilted, turned, flipped and thick, as NIfTI and as DICOM:

- both files hold the same Hounsfield units and the same places, read by three libraries, and the places are those of
  `truth.json`;
- what the readers see is where the truth says: centroids of lesions and marker spheres, weighed by what is above their
  surroundings, from noiseless scans;
- labels lie on the same grid, at the truth's places;
- a DICOM series has no attribute that pydicom's strict validation refuses, type-1 attributes have values, identifiers
  are unique and the same in a second run.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import nibabel
import numpy as np
import pydicom
import SimpleITK as sitk

# Floats of NIfTI's header; 16 characters of DICOM's decimals.
NIFTI_M = 1e-7
DICOM_M = 1e-9
# Centroid of a noiseless lesion or sphere: pixels of 0.7 mm that sample a blur of 0.55 mm.
CENTROID_M = 1e-5
# Along the slices' normal, thick ones sample a ball of a few slices.
ALONG_M = {1e-3: 2e-5, 2.5e-3: 2e-4}
PADDING_HU = -3024
LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])

CASES = {
    "straight": [],
    "tilted": ["--tilt", "18"],
    "turned_flipped": ["--turn", "9", "--axes", "RAI", "--shift-mm", "12.5,-148.25,-731.5",
                       # Of the scan's own frame.
                       "--range-mm=-711.5,-601.5"],
    "biopsy": ["--preset", "biopsy", "--kernel", "sharp"],
    "tilted_no_circle": ["--tilt", "-11.5", "--no-circle", "--preset", "biopsy"],
}
# Type 1 of the modules of CT Image Storage.
TYPE_1 = """SOPClassUID SOPInstanceUID StudyInstanceUID SeriesInstanceUID FrameOfReferenceUID Modality ImageType
SamplesPerPixel PhotometricInterpretation Rows Columns BitsAllocated BitsStored HighBit PixelRepresentation PixelSpacing
ImageOrientationPatient ImagePositionPatient RescaleIntercept RescaleSlope PixelData""".split()
TYPE_2 = """PatientName PatientID PatientBirthDate PatientSex StudyDate StudyTime ReferringPhysicianName StudyID AccessionNumber
SeriesNumber PositionReferenceIndicator Manufacturer InstanceNumber SliceThickness KVP AcquisitionNumber""".split()

failures = []


def expect(condition, text):
    if not condition:
        failures.append(text)
        print(f"  WRONG: {text}")


def scan(program, out, extra):
    command = [program, "ct", "synth", "male-p50-supine", "--out", out, "--format", "both", "--markers", "ct-sphere",
               "--noise", "0", "--json", *extra]
    if not any(word.startswith("--range-mm") for word in extra):
        command += ["--range-mm", "20,130"]
    result = subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True)
    return json.loads(result.stdout)


def places_of_dicom(datasets):
    """The affine in m from an index to LPS, from positions and orientation alone."""
    first = datasets[0]
    row_step, column_step = (float(value) for value in first.PixelSpacing)
    along_columns, along_rows = np.array(first.ImageOrientationPatient, dtype=float).reshape(2, 3)
    positions = np.array([dataset.ImagePositionPatient for dataset in datasets], dtype=float)
    step = (positions[-1] - positions[0]) / (len(positions) - 1)
    expect(np.abs(positions - positions[0] - np.arange(len(positions))[:, None] * step).max() < 1e-6, "slices are not even")
    affine = np.eye(4)
    affine[:3, 0] = along_columns * column_step
    affine[:3, 1] = along_rows * row_step
    affine[:3, 2] = step
    affine[:3, 3] = positions[0]
    affine[:3] *= 1e-3
    return affine


def check_dicom(folder, truth_affine, nifti_hu, no_circle):
    paths = sorted(folder.glob("*.dcm"))
    datasets = [pydicom.dcmread(path) for path in paths]
    pydicom.config.settings.reading_validation_mode = pydicom.config.RAISE
    for dataset in datasets:
        for element in dataset.iterall():
            _ = element.value
        missing = [name for name in TYPE_1 if dataset.get(name) in (None, "")]
        missing += [name for name in TYPE_2 if name not in dataset]
        expect(not missing, f"{missing} of a DICOM file")
    first = datasets[0]
    expect(str(first.PatientName) == "SYNTHETIC^PHANTOM", "the patient's name")
    expect(len({dataset.SOPInstanceUID for dataset in datasets}) == len(datasets), "identifiers are not unique")
    expect(len({dataset.SeriesInstanceUID for dataset in datasets}) == 1, "more than one series")
    expect(all(dataset.SOPInstanceUID.startswith("2.25.") for dataset in datasets), "identifiers are not of 2.25")
    affine = places_of_dicom(datasets)
    expect(np.abs(affine - truth_affine).max() < DICOM_M, f"pydicom: places off by {np.abs(affine - truth_affine).max()} m")

    stored = np.stack([dataset.pixel_array for dataset in datasets], axis=-1).transpose(1, 0, 2)
    padding = np.zeros(stored.shape, bool)
    if not no_circle:
        padding = stored == first.PixelPaddingValue
        share = padding.mean()
        expect(abs(share - (1 - np.pi / 4)) < 2e-3, f"padding is {share} of the image")
    hu = stored * float(first.RescaleSlope) + float(first.RescaleIntercept)
    expect(np.array_equal(np.where(padding, -1000, hu), nifti_hu), "pydicom and nibabel read different HU")

    reader = sitk.ImageSeriesReader()
    names = reader.GetGDCMSeriesFileNames(str(folder))
    expect(len(names) == len(paths), "SimpleITK sees another number of slices")
    reader.SetFileNames(names)
    image = reader.Execute()
    values = sitk.GetArrayFromImage(image).transpose(2, 1, 0)
    # SimpleITK sorts slices along their normal; ours may run against it.
    normal = np.cross(affine[:3, 0], affine[:3, 1])
    if normal @ affine[:3, 2] < 0:
        values = values[:, :, ::-1]
    expect(np.array_equal(np.where(padding, PADDING_HU, nifti_hu), values), "SimpleITK and nibabel read different HU from DICOM")
    return affine, [dataset.SOPInstanceUID for dataset in datasets]


def check_nifti(path, truth_affine, is_sheared):
    image = nibabel.load(path)
    image.header.get_best_affine()
    affine = LPS_FROM_RAS @ image.affine
    affine[:3] *= 1e-3
    expect(np.abs(affine - truth_affine).max() < NIFTI_M, f"nibabel: places off by {np.abs(affine - truth_affine).max()} m")
    _, sform_code = image.get_sform(coded=True)
    qform, qform_code = image.get_qform(coded=True)
    expect(sform_code == 1, "no sform")
    expect(qform_code == (0 if is_sheared else 1), "qform")
    if not is_sheared:
        expect(np.abs(qform - image.affine).max() < 1e3 * NIFTI_M, "sform and qform differ")
        read = sitk.ReadImage(str(path))
        direction = np.array(read.GetDirection()).reshape(3, 3) @ np.diag(read.GetSpacing())
        expect(np.abs(1e-3 * direction - truth_affine[:3, :3]).max() < NIFTI_M, "SimpleITK: steps")
        expect(np.abs(1e-3 * np.array(read.GetOrigin()) - truth_affine[:3, 3]).max() < NIFTI_M, "SimpleITK: origin")
        values = sitk.GetArrayViewFromImage(read).transpose(2, 1, 0)
        expect(np.array_equal(values, np.asarray(image.dataobj)), "SimpleITK and nibabel read different HU from NIfTI")
    return np.asarray(image.dataobj)


def centroid(hu, affine, centre_m, reach_m, base_hu):
    """Of what is above its surroundings within a ball, m."""
    index = np.linalg.solve(affine[:3, :3], centre_m - affine[:3, 3])
    half = np.ceil(reach_m / np.linalg.norm(affine[:3, :3], axis=0)).astype(int) + 2
    low = np.maximum(np.round(index).astype(int) - half, 0)
    high = np.minimum(np.round(index).astype(int) + half + 1, hu.shape)
    grid = np.stack(np.meshgrid(*[np.arange(a, b) for a, b in zip(low, high, strict=True)], indexing="ij"), axis=-1)
    places = grid @ affine[:3, :3].T + affine[:3, 3]
    weight = hu[low[0]:high[0], low[1]:high[1], low[2]:high[2]].astype(float) - base_hu
    weight[np.linalg.norm(places - centre_m, axis=-1) > reach_m] = 0.0
    return (places * weight[..., None]).sum(axis=(0, 1, 2)) / weight.sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, required=True, help="the needlebench that is checked")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, extra in CASES.items():
            print(name)
            out = pathlib.Path(folder) / name
            truth = scan(arguments.program, out, extra)["truth"]
            truth_affine = np.array(truth["ct_from_index"])
            is_sheared = truth["gantry_tilt_rad"] != 0
            hu = check_nifti(out / "ct.nii.gz", truth_affine, is_sheared)
            affine, identifiers = check_dicom(out / "dicom", truth_affine, hu, "--no-circle" in extra)

            labels = np.asarray(nibabel.load(out / "labels.nii.gz").dataobj)
            names = {entry["name"]: entry["label"] for entry in json.loads((out / "labels.json").read_text())["labels"]}
            expect(labels.shape == hu.shape, "labels on another grid")
            seen = 0
            worst = 0.0
            for lesion in truth["lesions"]:
                centre = np.array(lesion["center_m"])
                index = np.linalg.solve(affine[:3, :3], centre - affine[:3, 3])
                reach = 0.5 * lesion["diameter_m"] + 2.5e-3 + truth["scanner"]["slice_thickness_m"]
                # Wholly within the scan, with what is looked at around it.
                margin = np.ceil(reach / np.linalg.norm(affine[:3, :3], axis=0)) + 2
                if lesion["organ"] is None or np.any(index < margin) or np.any(index > np.array(hu.shape) - 1 - margin):
                    continue
                seen += 1
                expect(labels[tuple(np.round(index).astype(int))] == names["lesion_" + lesion["name"]],
                       f"label of {lesion['name']}")
                if lesion["name"] in ("pleural_based", "left_perihilar"):
                    continue  # other tissue is next to it
                off = centroid(hu, affine, centre, reach, truth["materials_hu"]["lung"]) - centre
                normal = np.cross(affine[:3, 0], affine[:3, 1])
                normal /= np.linalg.norm(normal)
                along = abs(off @ normal)
                across = np.linalg.norm(off - normal * (off @ normal))
                worst = max(worst, along, across)
                expect(across < CENTROID_M, f"{lesion['name']} is {1e6 * across:.1f} um off in the slice")
                expect(along < ALONG_M[truth["scanner"]["slice_thickness_m"]], f"{lesion['name']} is {1e6 * along:.1f} um off")
            expect(seen >= 2, "hardly any lesion was seen")
            for marker in truth["markers"]:
                place = np.array(marker["sphere_center_m"])
                index = np.round(np.linalg.solve(affine[:3, :3], place - affine[:3, 3])).astype(int)
                if np.all(index >= 0) and np.all(index < hu.shape):
                    # Of the middle of an 8 mm ball nothing is lost to blur, and little to slices of 2.5 mm.
                    expect(hu[tuple(index)] > 1100, f"{marker['name']} is {hu[tuple(index)]} HU")
            print(f"  {hu.shape}, {seen} lesions, centroids within {1e6 * worst:.1f} um")
            if name == "straight":
                again = pathlib.Path(folder) / "again"
                scan(arguments.program, again, [*extra, "--jobs", "1"])
                _, same = check_dicom(again / "dicom", truth_affine, hu, False)
                expect(same == identifiers, "identifiers differ from run to run")
                expect((again / "ct.nii.gz").read_bytes() == (out / "ct.nii.gz").read_bytes(), "bytes depend on the threads")
    print(f"{len(failures)} wrong" if failures else "all as meant")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
