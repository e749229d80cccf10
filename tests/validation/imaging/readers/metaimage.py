"""MetaImage against SimpleITK, which writes and reads it with ITK."""

from __future__ import annotations

from pathlib import Path

import SimpleITK as sitk
from common import Reader, as_hu, by_itk, oblique, refused, same, typed

TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]


def check(reader: Reader, folder: Path) -> int:
    """All types, in one file and beside it, raw and compressed, in both byte orders, on an oblique grid."""
    before = reader.answers
    for kind in TYPES:
        paths, stored, affine = by_itk(folder, kind, "mha", "mhd")
        head, _ = paths[0].read_bytes().split(b"ElementDataFile = LOCAL\n")
        big = folder / f"{kind}-big.mha"
        head = head.replace(b"OrderMSB = False", b"OrderMSB = True") + b"ElementDataFile = LOCAL\n"
        big.write_bytes(head + stored.astype(">" + kind).tobytes(order="F"))
        assert (sitk.GetArrayFromImage(sitk.ReadImage(str(big))).T == stored).all()
        for answer in reader.read(*paths, big):
            same(answer, as_hu(stored), affine)
    four = folder / "four.mha"
    image, affine = oblique(typed("i2"))
    sitk.WriteImage(sitk.JoinSeries([image, image]), str(four))
    refused(reader.one(four), "2 volumes", "Extract")
    sitk.WriteImage(sitk.JoinSeries([image]), str(four))
    same(reader.one(four), as_hu(sitk.GetArrayFromImage(image).T), affine)
    colours = folder / "colours.mha"
    sitk.WriteImage(sitk.Compose(image, image, image), str(colours))
    refused(reader.one(colours), "3 numbers a voxel")
    return reader.answers - before
