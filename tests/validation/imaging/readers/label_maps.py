"""Label maps: contours against scikit-image, folders and names against nibabel, `.seg.nrrd` in pynrrd and ITK."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import nibabel as nib
import nrrd
import numpy as np
import pydicom
import SimpleITK as sitk
from common import SAME_PLACE_MM
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, generate_uid
from skimage.measure import points_in_poly

SIZE = (60, 50, 12)
# LPS, mm: columns, rows, slices; and the first voxel.
STEPS = np.array([[0.7, 0, 0], [0, 0.9, 0], [0, 0, 2.5]])
FIRST = np.array([-21.3, 14.7, -100.5])
STRUCTURE_SET = "1.2.840.10008.5.1.4.1.1.481.3"
NAMES = ["rib_left_7", "lung_left", "tumor", "aorta"]
# Scans whose columns, rows and slices run otherwise, by nibabel's letters: the same axes backwards, sagittal and
# coronal stacks, and columns that are slices.
ORIENTATIONS = ["RAI", "LAS", "PIR", "PSL", "RIA", "SLA"]


def volume(path: Path, size: tuple[int, ...] = SIZE, steps: np.ndarray = STEPS, first: np.ndarray = FIRST) -> None:
    """A scan on these voxels; rows of the steps are those of columns, rows and slices."""
    hu = np.random.default_rng(5).integers(-1000, 1000, size).astype(np.int16)
    image = sitk.GetImageFromArray(np.ascontiguousarray(hu.T))
    spacing = np.linalg.norm(steps, axis=1)
    image.SetSpacing(tuple(spacing))
    image.SetDirection(tuple((steps / spacing[:, None]).T.ravel()))
    image.SetOrigin(tuple(first))
    sitk.WriteImage(image, str(path))


def star(rng: np.random.Generator, centre: np.ndarray, radius: float) -> np.ndarray:
    """A polygon with dents, in indices of a slice."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, 40))
    radii = radius * rng.uniform(0.6, 1.0, 40)
    return centre + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def inside(polygon: np.ndarray) -> np.ndarray:
    """Of a slice, by scikit-image, from the numbers that the file has."""
    centres = np.stack(np.mgrid[: SIZE[0], : SIZE[1]], axis=-1).reshape(-1, 2)
    return points_in_poly(centres, polygon).reshape(SIZE[:2])


def structure_set(path: Path, syntax: str) -> list[np.ndarray]:
    """Four structures with holes and islands; their masks."""
    rng = np.random.default_rng(9)
    data = Dataset()
    data.SOPClassUID, data.SOPInstanceUID, data.Modality = STRUCTURE_SET, generate_uid(), "RTSTRUCT"
    data.StructureSetROISequence, data.ROIContourSequence = [], []
    masks = []
    for number, name in enumerate(NAMES, start=1):
        roi, drawn = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName = number, name
        drawn.ReferencedROINumber, drawn.ContourSequence = number, []
        mask = np.zeros(SIZE, bool)
        for k in range(number, SIZE[2] - number):
            centre = rng.uniform([20, 18], [38, 32])
            # An outline, a hole in it that crosses it at places, and an island beside.
            for polygon in (star(rng, centre, 17), star(rng, centre, 8), star(rng, centre + [22, 3], 6)):
                places = FIRST + np.column_stack([polygon, np.full(len(polygon), k)]) @ STEPS
                written = [f"{value:.8g}" for value in places.ravel()]
                contour = Dataset()
                contour.ContourGeometricType = "CLOSED_PLANAR"
                contour.NumberOfContourPoints, contour.ContourData = len(polygon), written
                drawn.ContourSequence.append(contour)
                read = np.array(written, float).reshape(-1, 3)
                mask[..., k] ^= inside(((read - FIRST) @ np.linalg.inv(STEPS))[:, :2])
        data.StructureSetROISequence.append(roi)
        data.ROIContourSequence.append(drawn)
        masks.append(mask)
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = syntax
    pydicom.dcmwrite(path, data, enforce_file_format=True)
    return masks


def painted(masks: list[np.ndarray]) -> np.ndarray:
    """Labels by the rule: lesions before bone, vessels and lungs."""
    labels = np.zeros(SIZE, np.uint16)
    for name in ("lung_left", "aorta", "rib_left_7", "tumor"):
        at = NAMES.index(name)
        labels[masks[at]] = at + 1
    return labels


def affine() -> np.ndarray:
    """In the world of NIfTI."""
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = STEPS.T, FIRST
    return np.diag([-1, -1, 1, 1]) @ whole


def folder_of(path: Path, masks: list[np.ndarray]) -> np.ndarray:
    """As TotalSegmentator writes it; labels are in the order of the names."""
    path.mkdir()
    for name, mask in [*zip(NAMES, masks, strict=True), ("urinary_bladder", np.zeros(SIZE, bool))]:
        # Some of them with columns that run the other way.
        image = nib.Nifti1Image(mask.astype(np.uint8), affine())
        nib.save(nib.as_closest_canonical(image) if name == "aorta" else image, path / f"{name}.nii.gz")
    number = {0: 0} | {NAMES.index(name) + 1: at for at, name in enumerate(sorted(NAMES), start=1)}
    return np.vectorize(number.get)(painted(masks)).astype(np.uint16)


def with_names(path: Path, labels: np.ndarray, code: int) -> None:
    """One file, with the names in an extension of the header."""
    image = nib.Nifti1Image(labels, affine())
    table = "".join(
        f'<Label Key="{at}" Red="1" Green="0" Blue="0" Alpha="1"><![CDATA[{name}]]></Label>\n'
        for at, name in enumerate(NAMES, start=1)
    )
    xml = f'<CaretExtension><VolumeInformation><LabelTable>{table}</LabelTable></VolumeInformation></CaretExtension>'
    image.header.extensions.append(nib.nifti1.Nifti1Extension(code, xml.encode()))
    nib.save(image, path)


def same(
    answer: dict, wanted: np.ndarray, names: list[str], steps: np.ndarray = STEPS, first: np.ndarray = FIRST
) -> None:
    """The labels, and what other libraries read of the segmentation that was written."""
    assert "refused" not in answer, answer
    labels = np.fromfile(answer["labels"], "<u2").reshape(wanted.shape, order="F")
    assert (labels == wanted).all(), f"{(labels != wanted).sum()} voxels differ"
    assert answer["names"] == [[at, name] for at, name in enumerate(names, start=1)], answer["names"]
    values, header = nrrd.read(answer["segmentation"])
    assert header["space"] == "left-posterior-superior"
    assert (values == wanted).all()
    assert np.abs(header["space directions"] - steps).max() < SAME_PLACE_MM
    assert np.abs(header["space origin"] - first).max() < SAME_PLACE_MM
    for at, name in enumerate(names):
        assert header[f"Segment{at}_Name"] == name
        assert int(header[f"Segment{at}_LabelValue"]) == at + 1
        ends = np.array(header[f"Segment{at}_Extent"].split(), int).reshape(3, 2)
        voxels = np.argwhere(wanted == at + 1)
        assert (ends == np.stack([voxels.min(0), voxels.max(0)], axis=1)).all()
    image = sitk.ReadImage(answer["segmentation"])
    assert (sitk.GetArrayFromImage(image).T == wanted).all()
    assert np.abs(np.array(image.GetOrigin()) - first).max() < SAME_PLACE_MM
    directions = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    assert np.abs(directions.T - steps).max() < SAME_PLACE_MM


def check(program: Path, folder: Path) -> int:
    """How many label maps are the same."""
    scan = folder / "scan.nrrd"
    volume(scan)
    cases = []
    for name, syntax in {"implicit": ImplicitVRLittleEndian, "explicit": ExplicitVRLittleEndian}.items():
        masks = structure_set(folder / f"{name}.dcm", syntax)
        cases.append((folder / f"{name}.dcm", painted(masks), NAMES))
    cases.append((folder / "masks", folder_of(folder / "masks", masks), sorted(NAMES)))
    for code in (0, 30):
        with_names(folder / f"named-{code}.nii.gz", painted(masks), code)
        cases.append((folder / f"named-{code}.nii.gz", painted(masks), NAMES))
    out = folder / "labels"
    out.mkdir()
    paths = [path for path, *_ in cases]
    run = subprocess.run([program, out, scan, *paths], capture_output=True, text=True, timeout=600, check=True)
    for line, (_, wanted, names) in zip(run.stdout.splitlines(), cases, strict=True):
        same(json.loads(line), wanted, names)
    return len(cases) + turned(program, folder, painted(masks))


def turned(program: Path, folder: Path, labels: np.ndarray) -> int:
    """Scans with other orders of the axes, and label maps with the same and with another one: how many are the same."""
    straight = folder / "named-0.nii.gz"
    image = nib.load(straight)
    own = nib.orientations.io_orientation(image.affine)
    count = 0
    for letters in ORIENTATIONS:
        there = nib.orientations.ornt_transform(own, nib.orientations.axcodes2ornt(letters))
        moved = nib.Nifti1Image(labels, image.affine).as_reoriented(there)
        wanted = np.asarray(moved.dataobj)
        whole = np.diag([-1, -1, 1, 1]) @ moved.affine
        steps, first = whole[:3, :3].T, whole[:3, 3]
        assert nib.aff2axcodes(moved.affine) == tuple(letters)
        scan, same_order = folder / f"scan-{letters}.nrrd", folder / f"labels-{letters}.nii.gz"
        volume(scan, wanted.shape, steps, first)
        for extension in image.header.extensions:
            moved.header.extensions.append(extension)
        nib.save(moved, same_order)
        out = folder / f"labels-{letters}"
        out.mkdir()
        words = [program, out, scan, straight, same_order]
        run = subprocess.run(words, capture_output=True, text=True, timeout=600, check=True)
        lines = run.stdout.splitlines()
        assert len(lines) == 2, lines
        for line in lines:
            same(json.loads(line), wanted, NAMES, steps, first)
        # The other way: a scan along the patient's axes, and labels that run otherwise.
        out = folder / f"labels-of-{letters}"
        out.mkdir()
        words = [program, out, folder / "scan.nrrd", same_order]
        run = subprocess.run(words, capture_output=True, text=True, timeout=600, check=True)
        same(json.loads(run.stdout), labels, NAMES)
        count += 3
    return count
