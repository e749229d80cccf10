"""MGH of FreeSurfer against nibabel."""

from __future__ import annotations

from pathlib import Path

import nibabel as nib
import numpy as np
from common import Reader, as_hu, oblique, refused, same, typed


def check(reader: Reader, folder: Path) -> int:
    """All types that nibabel writes, plain and compressed, on oblique grids of even and odd sizes."""
    before = reader.answers
    lps_from_ras = np.diag([-1.0, -1.0, 1.0, 1.0])
    for kind in ["u1", "i2", "i4", "f4"]:
        for shape in [(7, 6, 5), (4, 8, 3)]:
            stored = typed(kind, shape)
            _, affine = oblique(stored)
            for end in ("mgh", "mgz"):
                path = folder / f"{kind}-{shape[0]}.{end}"
                nib.save(nib.MGHImage(stored, lps_from_ras @ affine), path)
                image = nib.load(path)
                assert (np.asarray(image.dataobj) == stored).all()
                same(reader.one(path), as_hu(stored), lps_from_ras @ image.affine, tolerance_mm=1e-4)
    path = folder / "four.mgz"
    nib.save(nib.MGHImage(np.zeros((4, 4, 4, 2), np.int16), np.eye(4)), path)
    refused(reader.one(path), "2 volumes", "mri_convert")
    return reader.answers - before
