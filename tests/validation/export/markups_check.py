"""Markups for 3D Slicer over the scans that their patients were built from.

    python3 -m venv env && env/bin/pip install -r tests/validation/imaging/requirements.txt
    env/bin/python tests/validation/export/markups_check.py --program target/release/needlebench

Synthetic scans, read by nibabel (NIfTI) and pydicom (DICOM), become patients; their needles are planned and exported.
Where the file has an entry, the scan changes from air to tissue; where it has a target, the ground truth has the lesion.
The document has what 3D Slicer's schema of markups 1.0.3 requires. Exit status 1 where anything is beyond its limit.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import nibabel
import numpy as np
import pydicom
from scipy.ndimage import map_coordinates

ROOT = Path(__file__).resolve().parents[3]
LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
# Between air and skin.
SKIN_HU = -500.0
# How far the line is searched for the skin, and in which steps.
REACH_MM, STEP_MM = 20.0, 0.05
LESION = "pleural_based"
# Scans: supine and head first, straight; leaning and elsewhere, with axes the other way; prone, which DICOM says; with
# a robot that is registered to it.
CASES = {
    "straight": ("male-p50-supine", ["--pixels", "256", "--preset", "biopsy"], "dicom"),
    "turned": (
        "male-p50-supine",
        ["--pixels", "256", "--preset", "biopsy", "--turn", "9", "--axes", "RAI", "--shift-mm", "12.5,-148.25,-731.5"],
        "ct.nii.gz",
    ),
    "tilted": ("male-p50-supine", ["--pixels", "256", "--preset", "biopsy", "--tilt", "12"], "dicom"),
    "prone": ("prone.toml", ["--pixels", "256", "--preset", "biopsy"], "dicom"),
    "registered": (
        ROOT / "scenarios/supine_suite.toml",
        ["--pixels", "300", "--preset", "biopsy", "--markers", "ct-sphere"],
        "ct.nii.gz",
    ),
}
PRONE = """name = "prone"
[phantom]
posture = "prone"
[[goals]]
lesion = "pleural_based"
"""
# The schema's properties that the document uses: their types and values.
POINT = {"id": str, "label": str, "description": str, "locked": bool, "position": list, "positionStatus": str}
MARKUP = {
    "type": {"Fiducial", "Line", "Angle", "Curve", "ClosedCurve", "Plane", "ROI"},
    "coordinateSystem": {"LPS", "RAS"},
    "coordinateUnits": {"mm", "um"},
    "name": str,
    "locked": bool,
    "fixedNumberOfControlPoints": bool,
    "controlPoints": list,
    "display": dict,
}
DISPLAY = {"pointLabelsVisibility": bool, "propertiesLabelVisibility": bool}


class Failed(Exception):
    """Something is not as it should be."""


def holds(condition: bool, text: str) -> None:
    """What has to be so."""
    if not condition:
        raise Failed(text)


def check_properties(value: dict, known: dict, where: str) -> None:
    """Each property is one that the schema has, of its type or one of its values."""
    for key, given in value.items():
        wanted = known.get(key)
        holds(wanted is not None, f"{where}: {key} is not in the schema")
        is_right = given in wanted if isinstance(wanted, set) else type(given) is wanted
        holds(is_right, f"{where}: {key} is {given!r}")


def check_document(document: dict) -> None:
    """What markups-schema-v1.0.3.json and the reader of 3D Slicer require."""
    holds(document["@schema"].endswith("/markups-schema-v1.0.3.json#"), f"@schema {document['@schema']}")
    for markup in document["markups"]:
        where = markup["name"]
        check_properties(markup, MARKUP, where)
        check_properties(markup["display"], DISPLAY, where)
        holds(markup["coordinateSystem"] == "LPS" and markup["coordinateUnits"] == "mm", where)
        for point in markup["controlPoints"]:
            check_properties(point, POINT, where)
            position = point["position"]
            holds(len(position) == 3 and all(type(each) is float for each in position), f"{where}: {position}")
            holds(point["positionStatus"] == "defined", where)
        identifiers = [point["id"] for point in markup["controlPoints"]]
        holds(len(set(identifiers)) == len(identifiers), f"{where}: {identifiers}")


def volume_of_nifti(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Values by i, j, k, and the voxels' places in mm, LPS."""
    image = nibabel.load(path)
    return np.asarray(image.dataobj, dtype=float), LPS_FROM_RAS @ image.affine


def volume_of_dicom(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The same of a series, by the attributes of its slices alone."""
    slices = [pydicom.dcmread(file) for file in folder.rglob("*") if file.is_file()]
    slices = [each for each in slices if "PixelData" in each]
    along, down = np.array(slices[0].ImageOrientationPatient, dtype=float).reshape(2, 3)
    places = {id(each): np.array(each.ImagePositionPatient, dtype=float) for each in slices}
    slices.sort(key=lambda each: places[id(each)] @ np.cross(along, down))
    first, last = (places[id(slices[index])] for index in (0, -1))
    row_mm, column_mm = (float(each) for each in slices[0].PixelSpacing)
    lps = np.eye(4)
    lps[:3, 0], lps[:3, 1] = along * column_mm, down * row_mm
    lps[:3, 2], lps[:3, 3] = (last - first) / (len(slices) - 1), first
    hu = [each.pixel_array * float(each.RescaleSlope) + float(each.RescaleIntercept) for each in slices]
    return np.stack(hu, axis=-1).swapaxes(0, 1).astype(float), lps


def values(hu: np.ndarray, lps: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Between voxels, at places in mm, LPS."""
    index = np.linalg.solve(lps, np.vstack([places.T, np.ones(len(places))]))[:3]
    return map_coordinates(hu, index, order=1, mode="nearest")


def off_the_skin(hu: np.ndarray, lps: np.ndarray, entry: np.ndarray, target: np.ndarray) -> float:
    """How far the skin is from the entry along the needle, mm: where the scan turns from air into what is no air."""
    inwards = (target - entry) / np.linalg.norm(target - entry)
    along = np.arange(-REACH_MM, REACH_MM, STEP_MM)
    is_body = values(hu, lps, entry + along[:, None] * inwards) > SKIN_HU
    holds(bool(is_body.any() and not is_body.all()), f"no skin within {REACH_MM} mm of {entry}")
    changes = along[1:][is_body[1:] & ~is_body[:-1]]
    return float(np.abs(changes).min()) if len(changes) else np.inf


def check(program: Path, name: str, folder: Path) -> tuple[float, float]:
    """Entry's distance from the skin and target's from the lesion's centre, mm."""
    subject, options, source = CASES[name]

    def run(*words: object) -> str:
        command = [program, *(str(word) for word in words)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        holds(done.returncode == 0, f"{name}: {' '.join(map(str, words))}: {done.returncode}\n{done.stderr[-1500:]}")
        return done.stdout

    (folder / "prone.toml").write_text(PRONE)
    run("ct", "synth", subject, "--out", "ct", "--format", "both", "--seed", "5", *options)
    lesions = json.loads((folder / "ct/lesions.json").read_text())["lesions"]
    truth = next(each for each in lesions if each["name"] == LESION)
    centre = 1e3 * np.array(truth["center_m"])
    seed = ",".join(f"{each:.3f}" for each in centre)
    room = ["--markers", "ct/marker_list.toml", "--room", subject] if name == "registered" else []
    run("ct", "build", f"ct/{source}", "--out", "patient", "--lesion", f"nodule={seed}", "--no-pictures", *room)
    plan = ["--directions", "2000", "--no-robot", "--no-pictures", "--write", "patient/planned.toml"]
    run("ct", "routes", "patient", "--lesion", "nodule", *plan)
    words = ["export", "patient/planned.toml", "--as", "markups", "--out"]
    run(*words, "a/needles.mrk.json")
    run(*words, "b/needles.mrk.json")
    data = (folder / "a/needles.mrk.json").read_bytes()
    holds(data == (folder / "b/needles.mrk.json").read_bytes(), f"{name}: two exports differ")
    document = json.loads(data)
    check_document(document)
    line, entries, targets = document["markups"]
    holds([line["type"], entries["type"], targets["type"]] == ["Line", "Fiducial", "Fiducial"], f"{name}: types")
    holds(line["name"] == "nodule" and [each["label"] for each in line["controlPoints"]] == ["entry", "target"], name)
    entry, target = (np.array(each["position"]) for each in line["controlPoints"])
    for markup, place in ((entries, entry), (targets, target)):
        (point,) = markup["controlPoints"]
        holds(point["label"] == "nodule" and np.array_equal(point["position"], place), f"{name}: {markup['name']}")
    path = folder / "ct" / source
    hu, lps = volume_of_dicom(path) if path.is_dir() else volume_of_nifti(path)
    voxel_mm = float(np.linalg.norm(lps[:3, :3], axis=0).max())
    skin_mm = off_the_skin(hu, lps, entry, target)
    lesion_mm = float(np.linalg.norm(target - centre))
    holds(skin_mm <= voxel_mm, f"{name}: the skin is {skin_mm:.2f} mm from the entry {entry}, a voxel is {voxel_mm} mm")
    holds(lesion_mm <= voxel_mm, f"{name}: the target is {lesion_mm:.2f} mm from the lesion's centre")
    # The labels of the truth at the target, in the file's own voxels.
    labels, at = volume_of_nifti(folder / "ct/labels.nii.gz")
    index = np.rint(np.linalg.solve(at, np.append(target, 1.0))[:3]).astype(int)
    names = json.loads((folder / "ct/labels.json").read_text())["labels"]
    found = next(each["name"] for each in names if each["label"] == labels[tuple(index)])
    holds(found == f"lesion_{LESION}", f"{name}: {found} at the target")
    # A reader that took LPS for RAS would see something else: the check tells the two apart.
    holds(float(np.linalg.norm(target * [-1, -1, 1] - centre)) > 10.0 * voxel_mm, f"{name}: of no use for LPS and RAS")
    found = f"skin {skin_mm:.2f} mm from the entry, target {lesion_mm:.2f} mm from the centre"
    print(f"{name}: {found}, voxels {voxel_mm:.2f} mm")
    return skin_mm, lesion_mm


def main() -> int:
    """Check all scans."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/needlebench")
    parser.add_argument("cases", nargs="*", choices=[*CASES, []])
    arguments = parser.parse_args()
    worst = [0.0, 0.0]
    try:
        for name in arguments.cases or CASES:
            with tempfile.TemporaryDirectory() as folder:
                found = check(arguments.program.resolve(), name, Path(folder))
                worst = [max(*pair) for pair in zip(worst, found, strict=True)]
    except Failed as failed:
        print(f"FAILED: {failed}")
        return 1
    print(f"entries within {worst[0]:.2f} mm of the skin, targets within {worst[1]:.2f} mm of the lesion's centre")
    return 0


if __name__ == "__main__":
    sys.exit(main())
