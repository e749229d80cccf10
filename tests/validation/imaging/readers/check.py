"""The readers of volumes against nibabel, pydicom, SimpleITK and pynrrd: HU bit for bit, places to rounding, bad files answered.

    check.py --reader target/release/dump_volume --labels target/release/dump_labels --program target/release/needlebench [--times]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import dicom
import label_maps
import metaimage
import mgh
import nibabel as nib
import nifti
import nrrd_files
import numpy as np
import SimpleITK as sitk
from common import BIRTH_DATE, NAME, PATIENT_ID, Reader


def private(texts: list[str]) -> None:
    """Nothing of the patient is in what was printed."""
    words = [*NAME.split("^"), PATIENT_ID, BIRTH_DATE]
    for text in texts:
        for word in words:
            assert word.lower() not in text.lower(), f"{word} in {text}"


def through_program(program: Path, folder: Path) -> list[str]:
    """All that `ct info` says of every folder and file made here."""
    said = []
    for path in sorted(folder.iterdir()):
        for options in ([], ["--json"]):
            run = subprocess.run(
                [program, "ct", "info", *options, path], capture_output=True, text=True, timeout=600, check=False
            )
            assert run.returncode in (0, 2), f"{path}: {run.returncode}\n{run.stderr}"
            assert "panicked" not in run.stderr, run.stderr
            said += [run.stdout, run.stderr]
    return said


def times(reader: Reader, folder: Path) -> None:
    """Seconds of a scan of 512 x 512 x 300, one thread."""
    rng = np.random.default_rng(3)
    size = (512, 512, 300)
    i, j = np.mgrid[: size[0], : size[1]]
    body = ((i - 256) / 220) ** 2 + ((j - 256) / 160) ** 2 < 1
    hu = np.empty(size, np.int16)
    for k in range(size[2]):
        noisy = np.where(body, 40, -1000) + rng.normal(0, 20, size[:2])
        hu[..., k] = np.maximum(noisy, -1024)
    packed = folder / "scan.nii.gz"
    image = nib.Nifti1Image(hu, np.diag([-0.7, -0.7, 1.0, 1.0]))
    image.header.set_xyzt_units("mm")
    nib.save(image, packed)
    slices = folder / "scan"
    slices.mkdir()
    for k in range(size[2]):
        stored = (hu[..., k].T + 1024).astype("u2")
        dicom.slice_of(k, stored, (0, 0, k)).save_as(slices / f"{k:03}", enforce_file_format=True)

    def best(run: object, count: int = 5) -> str:
        seconds = []
        for _ in range(count):
            start, cpu = time.perf_counter(), time.process_time()
            run()
            seconds.append((time.perf_counter() - start, time.process_time() - cpu))
        return f"{min(s[0] for s in seconds):.3f} s wall, {min(s[1] for s in seconds):.3f} s CPU"

    def series() -> None:
        names = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(slices))
        sitk.GetArrayViewFromImage(sitk.ReadImage(names))

    sitk.ProcessObject.SetGlobalDefaultNumberOfThreads(1)
    for name, path in {".nii.gz": packed, "DICOM": slices}.items():
        answers = reader.read(*[path] * 5)
        for answer in answers:
            assert (answer.hu().shape == size) and (answer.hu() == hu).all()
        wall, cpu = (min(a.text[key] for a in answers) for key in ("read_s", "read_cpu_s"))
        print(f"needlebench {name}: {wall:.3f} s wall, {cpu:.3f} s CPU")
    print("SimpleITK .nii.gz:", best(lambda: sitk.ReadImage(str(packed))))
    print("nibabel .nii.gz:", best(lambda: np.asarray(nib.load(packed).dataobj), 3))
    print("SimpleITK DICOM:", best(series, 3))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reader", type=Path, required=True, help="example dump_volume")
    parser.add_argument("--labels", type=Path, required=True, help="example dump_labels")
    parser.add_argument("--program", type=Path, help="needlebench")
    parser.add_argument("--times", action="store_true", help="measure, too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        out, made = root / "out", root / "made"
        for folder in (out, made, made / "nifti", made / "dicom"):
            folder.mkdir()
        reader = Reader(arguments.reader.resolve(), out)
        tables = [nifti.shipped(reader), dicom.shipped(reader, made)]
        for table in tables:
            print("\n".join(table))
        same = sum(line.endswith(": same") for table in tables for line in table)
        print(f"{same} shipped files are the same, {sum(map(len, tables)) - same} refused")
        print(nifti.every_type(reader, made / "nifti"), "NIfTI files of all types are the same")
        odd = root / "odd-nifti"
        odd.mkdir()
        print(nifti.odd(reader, odd), "odd NIfTI files answered")
        for name, module in {"NRRD": nrrd_files, "MetaImage": metaimage, "MGH": mgh}.items():
            folder = made / name
            folder.mkdir()
            print(module.check(reader, folder), name, "files answered")
        maps = made / "labels"
        maps.mkdir()
        print(label_maps.check(arguments.labels.resolve(), maps), "label maps are the same, and in pynrrd and SimpleITK")
        before = reader.answers
        dicom.geometries(reader, made / "dicom")
        dicom.compressed(reader, made / "dicom")
        dicom.multi_frame(reader, made / "dicom")
        dicom.folders(reader, made / "dicom")
        dicom.cone_beam(reader, made / "dicom")
        dicom.sent(reader, made / "dicom")
        dicom.odd(reader, made / "dicom")
        print(reader.answers - before, "DICOM series answered")
        private(reader.everything_said)
        if arguments.program:
            said = through_program(arguments.program.resolve(), made / "dicom")
            said += through_program(arguments.program.resolve(), odd)
            private(said)
            print(len(said) // 2, "answers of ct info hold nothing of the patient")
        if arguments.times:
            times(reader, root)
    return 0


if __name__ == "__main__":
    sys.exit(main())
