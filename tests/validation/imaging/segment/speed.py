"""`ct synth` and `ct build` beside SimpleITK, processor seconds on one thread, in one run.

    target/segment/bin/python tests/validation/imaging/segment/speed.py --program target/release/needlebench

A scan of 512 x 512 x 300 voxels is made, then read and taken apart: by `ct build`, which writes surfaces, label map and
volume, too; and by SimpleITK, which does what comes nearest to it: reading, thresholds, the largest component and its
holes, lungs, bone, one distance map, and writing labels and volume.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

for name in ("OMP_NUM_THREADS", "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS"):
    os.environ[name] = "1"

import SimpleITK as sitk


def processor_seconds(command: list[str]) -> float:
    """Of a program that is run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def with_simpleitk(scan: Path, folder: Path) -> dict[str, float]:
    """Seconds of each step."""
    times: dict[str, float] = {}

    def timed(what, call):
        start = time.process_time()
        result = call()
        times[what] = time.process_time() - start
        return result

    def largest(mask):
        parts = sitk.RelabelComponent(sitk.ConnectedComponent(mask), sortByObjectSize=True)
        return parts == 1

    image = timed("read", lambda: sitk.ReadImage(str(scan)))
    body = timed("body", lambda: largest(sitk.BinaryMorphologicalOpening(image > -480, [4, 4, 3])))
    filled = timed("holes", lambda: sitk.BinaryFillhole(body))
    lungs = timed("lungs", lambda: largest(sitk.And(image < -400, filled)))
    bone = timed("bone", lambda: sitk.ConnectedComponent(sitk.And(image > 190, filled)) > 0)
    timed("one distance map", lambda: sitk.SignedMaurerDistanceMap(bone, useImageSpacing=True))
    labels = sitk.Cast(filled, sitk.sitkUInt16) + sitk.Cast(lungs, sitk.sitkUInt16) + 2 * sitk.Cast(bone, sitk.sitkUInt16)
    timed("write labels", lambda: sitk.WriteImage(labels, str(folder / "labels.nii.gz"), True, 1))
    timed("write volume", lambda: sitk.WriteImage(image, str(folder / "volume.nii.gz"), True, 1))
    return times


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--times", type=int, default=3)
    options = parser.parse_args()
    rows: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        for turn in range(options.times):
            folder = Path(temporary) / str(turn)
            synth = ["ct", "synth", "scenarios/supine_suite.toml", "--range-mm=-149.5,149.5", "--jobs", "1"]
            seconds = processor_seconds([options.program, *synth, "--out", str(folder / "scan")])
            rows.setdefault("ct synth", []).append(seconds)
            scan = folder / "scan/ct.nii.gz"
            build = ["ct", "build", str(scan), "--out", str(folder / "built"), "--no-pictures", "--jobs", "1"]
            rows.setdefault("ct build", []).append(processor_seconds([options.program, *build]))
            times = with_simpleitk(scan, folder)
            rows.setdefault("SimpleITK", []).append(sum(times.values()))
            for what, each in times.items():
                rows.setdefault(f"  {what}", []).append(each)
    for what, seconds in rows.items():
        print(f"{what:20} {min(seconds):6.2f} s least of {len(seconds)}, {max(seconds):6.2f} most")


if __name__ == "__main__":
    main()
