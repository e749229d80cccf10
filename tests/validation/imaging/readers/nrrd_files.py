"""NRRD against SimpleITK, which writes and reads it with ITK, and pynrrd."""

from __future__ import annotations

from pathlib import Path

import nrrd
import numpy as np
from common import Reader, as_hu, by_itk, refused, same, typed

TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]
SPACES = {
    "left-posterior-superior": [1, 1, 1],
    "right-anterior-superior": [-1, -1, 1],
    "left-anterior-superior": [1, -1, 1],
}


def written_by_itk(reader: Reader, folder: Path) -> None:
    """All types, attached and detached, raw and compressed, on an oblique grid."""
    for kind in TYPES:
        paths, stored, affine = by_itk(folder, kind, "nrrd", "nhdr")
        for answer in reader.read(*paths):
            same(answer, as_hu(stored), affine)


def by_pynrrd(reader: Reader, folder: Path) -> None:
    """All types and byte orders, in each space, with both encodings, and axes of length 1."""
    steps = np.array([[0.6, 0.02, 0.1], [0.0, 0.7, -0.2], [0.01, 0.0, 1.5]])
    origin = np.array([-11.0, 22.5, 333.25])
    for space, signs in SPACES.items():
        for kind in TYPES:
            for order in "<>":
                stored = typed(kind)
                affine = np.eye(4)
                affine[:3, :3] = steps.T
                affine[:3, 3] = origin
                affine = np.diag([*signs, 1]) @ affine
                for encoding in ("raw", "gzip"):
                    path = folder / f"{space[:1]}{kind}{'l' if order == '<' else 'b'}-{encoding}.nrrd"
                    header = {"space": space, "space directions": steps, "space origin": origin, "encoding": encoding}
                    nrrd.write(str(path), stored.astype(order + kind), header)
                    same(reader.one(path), as_hu(stored), affine)
                directions = np.vstack([[np.nan] * 3, steps])
                header = {"space": space, "space directions": directions, "space origin": origin}
                header["kinds"] = ["list", "domain", "domain", "domain"]
                path = folder / "one.nrrd"
                nrrd.write(str(path), stored.astype(order + kind)[None], header)
                same(reader.one(path), as_hu(stored), affine)
                nrrd.write(str(path), np.stack([stored, stored]), header)
                refused(reader.one(path), "2 volumes")
    stored = typed("i2")
    for encoding, word in [("bzip2", "bzip2"), ("ascii", "text")]:
        path = folder / f"{encoding}.nrrd"
        nrrd.write(str(path), stored, {"encoding": encoding, "space": "LPS", "space directions": steps})
        refused(reader.one(path), word, "gzip")
    path = folder / "nowhere.nrrd"
    nrrd.write(str(path), stored, {"spacings": [0.5, 0.6, 0.7]})
    refused(reader.one(path), "--assume-orientation")
    assert reader.one(path, "--assume-orientation", "LPS").refused is None


def check(reader: Reader, folder: Path) -> int:
    before = reader.answers
    written_by_itk(reader, folder)
    by_pynrrd(reader, folder)
    return reader.answers - before
