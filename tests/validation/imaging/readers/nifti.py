"""NIfTI against nibabel: files of its own test data, and files made for the purpose."""

from __future__ import annotations

import gzip
import io
from pathlib import Path

import nibabel as nib
import numpy as np
from common import Answer, Reader, as_hu, refused, remarked, same

LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
RNG = np.random.default_rng(7)
SHEARED = np.array(
    [[-0.7, 0.0, 0.1, 11.0], [0.02, 0.71, -0.4, -22.5], [0.0, 0.03, 1.25, 333.3], [0, 0, 0, 1.0]]
)
TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]


def phantom(shape: tuple[int, int, int] = (7, 6, 5)) -> np.ndarray:
    """Values of a CT, air among them."""
    hu = RNG.integers(-1024, 3072, size=shape)
    hu[: shape[0] // 2] = -1000
    return hu


def reference(path: Path) -> tuple[np.ndarray, np.ndarray]:
    image = nib.load(path)
    data = np.asarray(image.dataobj.get_unscaled()).reshape((*image.shape, 1)[:3] if image.ndim < 3 else image.shape[:3])
    # One slope and intercept of 32 bits; the sum in 64, as the reader has it.
    slope, intercept = float(image.dataobj.slope), float(image.dataobj.inter)
    return as_hu(data, slope, intercept), LPS_FROM_RAS @ image.affine


def header_of(path: Path) -> tuple[str, nib.Nifti1Header]:
    image = nib.load(path)
    return type(image).__name__, image.header


def shipped(reader: Reader) -> list[str]:
    """Every file of nibabel's tests that could be taken for a volume."""
    folder = Path(nib.__file__).parent / "tests" / "data"
    names = sorted(p for p in folder.rglob("*") if p.name.endswith((".nii", ".nii.gz", ".hdr", ".img", ".img.gz")))
    table = []
    for answer in reader.read(*names):
        path = answer.path
        if answer.refused is not None:
            assert answer.refused.strip(), answer.said
            table.append(f"{path.name}: refused, {answer.refused}")
            continue
        hu, affine = reference(path)
        header = nib.load(path).header
        unit = {"meter": 1e3, "micron": 1e-3}.get(header.get_xyzt_units()[0], 1.0)
        affine = np.diag([unit, unit, unit, 1]) @ affine
        same(answer, hu, affine)
        table.append(f"{path.name}: same")
    return table


def saved(folder: Path, name: str, image: nib.Nifti1Image) -> Path:
    path = folder / name
    nib.save(image, path)
    return path


def every_type(reader: Reader, folder: Path) -> int:
    """All types, both byte orders, both versions, plain, compressed, in pairs, with and without slope."""
    paths = []
    versions = {
        "1": (nib.Nifti1Image, nib.Nifti1Header, ".nii"),
        "1z": (nib.Nifti1Image, nib.Nifti1Header, ".nii.gz"),
        "2": (nib.Nifti2Image, nib.Nifti2Header, ".nii"),
        "2z": (nib.Nifti2Image, nib.Nifti2Header, ".nii.gz"),
        "pair": (nib.Nifti1Pair, nib.Nifti1Pair.header_class, ".hdr"),
        "pair2": (nib.Nifti2Pair, nib.Nifti2Pair.header_class, ".img"),
    }
    for version, (image_class, header_class, end) in versions.items():
        for order in "<>":
            for kind in TYPES:
                for slope, intercept in [(None, None), (1.0, -1024.0), (0.1, 3.5), (-2.0, 0.25)]:
                    data = phantom()
                    info = np.finfo if kind[0] == "f" else np.iinfo
                    limits = info(kind)
                    data = np.clip(data, max(float(limits.min), -1e6), min(float(limits.max), 1e6)).astype(kind)
                    if kind[0] == "f":
                        data = data + np.asarray(0.25, dtype=kind)
                        data[0, 0, :2] = [np.nan, 1e9]
                    header = header_class(endianness=order)
                    header.set_data_dtype(np.dtype(order + kind))
                    header.set_xyzt_units("mm")
                    image = image_class(data, None, header)
                    image.set_sform(SHEARED, 1)
                    image.set_qform(None, 0)
                    image.header.set_slope_inter(slope, intercept)
                    name = f"{version}-{'le' if order == '<' else 'be'}-{kind}-{slope}{end}"
                    paths.append(saved(folder, name, image))
    for answer in reader.read(*paths):
        hu, affine = reference(answer.path)
        same(answer, hu, affine)
    return len(paths)


def simple(kind: str = "i2", **units: str) -> nib.Nifti1Image:
    header = nib.Nifti1Header()
    header.set_data_dtype(kind)
    header.set_xyzt_units(units.get("unit", "mm"))
    image = nib.Nifti1Image(phantom().astype(kind), SHEARED, header)
    image.set_sform(SHEARED, 1)
    image.set_qform(None, 0)
    return image


def raw(image: nib.Nifti1Image) -> bytearray:
    stream = io.BytesIO()
    image.file_map["image"].fileobj = stream
    image.to_file_map()
    return bytearray(stream.getvalue())


def odd(reader: Reader, folder: Path) -> int:
    """Files that are read with a remark, and files that are refused."""
    before = reader.answers

    def written(name: str, data: bytes) -> Path:
        path = folder / name
        path.write_bytes(data)
        return path

    def read(name: str, data: bytes, *options: str) -> Answer:
        return reader.one(written(name, data), *options)

    good = bytes(raw(simple()))
    packed = gzip.compress(good, mtime=0)
    hu, affine = reference(written("good.nii", good))
    # The first byte of the second member is the last of what is read from the disk at a time.
    first = bytearray(gzip.compress(good[:500], mtime=0))
    # With a file's name and a comment.
    first[3] |= 0x18
    comment = 131071 - len(first) - 65302
    first[10:10] = b"a" * 65300 + b"\0" + b"b" * comment + b"\0"
    assert len(first) == 131071
    same(read("members-apart.nii.gz", bytes(first) + gzip.compress(good[500:])), hu, affine)
    same(read("members.nii.gz", gzip.compress(good[:500]) + gzip.compress(good[500:])), hu, affine)
    same(read("unnamed-gzip.nii", packed), hu, affine)
    same(read("not-packed.nii.gz", good), hu, affine)
    answer = read("trailing.nii.gz", packed + b"garbage")
    same(answer, hu, affine)
    remarked(answer, "not gzip")
    remarked(read("trailing.nii", good + b"garbage"), "ignored")
    remarked(read("no-sum.nii.gz", packed[:-6]), "checksum")
    refused(read("wrong-sum.nii.gz", packed[:-8] + b"\0\0\0\0" + packed[-4:]), "damaged")
    for cut in [0, 1, 10, 30, len(packed) // 2, len(packed) - 40]:
        refused(read("cut.nii.gz", packed[:cut]))
    for cut in [0, 3, 347, 348, 351, 352, 353, len(good) - 1]:
        refused(read("cut.nii", good[:cut]))
    refused(read("cut.nii", good[:-1]), "truncated", "copy or export")
    refused(read("text.nii.gz", b"this is no gzip"), "gzip")
    refused(read("text.nii", b"this is no volume" * 40), "348")

    # 4D, RGB, complex, single bits, 128-bit floats.
    four = nib.Nifti1Image(np.zeros((4, 4, 4, 3), np.int16), np.eye(4))
    refused(read("four.nii", bytes(raw(four))), "3 volumes", "dim[4]")
    one = nib.Nifti1Image(phantom((7, 6, 5)).astype("i2")[..., None], SHEARED)
    assert read("one-of-four.nii", bytes(raw(one))).refused is None
    colours = np.zeros((4, 4, 4), dtype=[("R", "u1"), ("G", "u1"), ("B", "u1")])
    refused(read("rgb.nii", bytes(raw(nib.Nifti1Image(colours, np.eye(4))))), "colours")
    refused(read("complex.nii", bytes(raw(nib.Nifti1Image(np.zeros((4, 4, 4), "c8"), np.eye(4))))), "complex")

    def changed(at: int, data: bytes) -> bytes:
        copy = bytearray(good)
        copy[at : at + len(data)] = data
        return bytes(copy)

    refused(read("type.nii", changed(70, b"\x01\x00")), "bits")
    refused(read("type.nii", changed(70, b"\x00\x06")), "128-bit")
    refused(read("bitpix.nii", changed(72, b"\x20\x00")), "bitpix")
    refused(read("dim.nii", changed(40, b"\x00\x00")), "dim[0]")
    refused(read("dim.nii", changed(42, b"\xff\xff")), "dim[1]")
    # 6000 x 6000 x 300: refused by the limit; 1024 x 1024 x 511: by what the file can hold.
    refused(read("vast.nii", changed(42, b"\x70\x17\x70\x17\x2c\x01")), "MiB")
    refused(read("large.nii", changed(42, b"\x00\x04\x00\x04\xff\x01")), "truncated")
    refused(read("large.nii.gz", gzip.compress(changed(42, b"\x00\x04\x00\x04\xff\x01"))), "truncated")
    refused(read("offset.nii", changed(108, np.float32(100).tobytes())), "vox_offset")
    refused(read("offset.nii", changed(108, np.float32(np.nan).tobytes())), "vox_offset")
    same(read("offset0.nii", changed(108, np.float32(0).tobytes())), hu, affine)
    refused(read("inter.nii", changed(112, np.array([1, np.inf], "<f4").tobytes())), "scl_inter")
    same(read("slope0.nii", changed(112, np.array([0, 5], "<f4").tobytes())), hu, affine)
    same(read("slope-nan.nii", changed(112, np.array([np.nan, 5], "<f4").tobytes())), hu, affine)
    refused(read("magic.nii", changed(344, b"\0\0\0\0")), "ANALYZE")
    refused(read("pair.nii", changed(344, b"ni1\0")), ".hdr")
    refused(read("flat.nii", changed(280, np.zeros(12, "<f4").tobytes())), "sform")
    refused(read("nan.nii", changed(280, np.full(12, np.nan, "<f4").tobytes())), "sform")

    # Orientation: neither form; both, which disagree; qform alone.
    neither = changed(252, b"\0\0\0\0")
    refused(read("neither.nii", neither), "sform_code", "--assume-orientation")
    remarked(read("neither.nii", neither, "--assume-orientation", "RAS"), "RAS")
    assumed = read("neither.nii", neither, "--assume-orientation", "RAS").ct_from_index_mm()
    assert np.all(np.sign(np.diag(assumed)[:3]) == [-1, -1, 1]), assumed
    both = simple()
    both.set_qform(np.diag([-0.7, -0.7, 1.25, 1]), 1)
    answer = read("both.nii", bytes(raw(both)))
    remarked(answer, "at a corner: the sform is used")
    same(answer, *reference(folder / "both.nii"))
    turned = nib.Nifti1Image(phantom().astype("i2"), None)
    turn = np.array([[0.0, -0.5, 0], [-0.6, 0, 0], [0, 0, 2.0]])
    for sign in (1, -1):
        affine_q = np.eye(4)
        affine_q[:3, :3] = turn * [1, 1, sign]
        affine_q[:3, 3] = [5, 6, 7]
        turned.set_sform(None, 0)
        turned.set_qform(affine_q, 2)
        turned.header.set_xyzt_units("mm")
        same(read("qform.nii", bytes(raw(turned))), *reference(folder / "qform.nii"))

    # Units.
    for unit, factor in [("meter", 1e3), ("micron", 1e-3)]:
        image = simple(unit=unit)
        image.set_sform(np.diag([1 / factor, 1 / factor, 1 / factor, 1]) @ SHEARED, 1)
        answer = read(f"{unit}.nii", bytes(raw(image)))
        remarked(answer, "metres")
        got = answer.ct_from_index_mm()
        assert np.abs(got - LPS_FROM_RAS @ SHEARED).max() < 1e-4, got
    refused(read("metres-or-not.nii", bytes(raw(simple(unit="meter")))), "xyzt_units")
    remarked(read("no-unit.nii", bytes(raw(simple(unit="unknown")))), "mm assumed")
    unit_steps = nib.Nifti1Image(phantom().astype("i2"), np.eye(4))
    remarked(read("default.nii", bytes(raw(unit_steps))), "1 x 1 x 1 mm")

    # Values: not CT, rounding, clipping, padding.
    zeros = nib.Nifti1Image(np.abs(phantom()).astype("i2"), SHEARED)
    remarked(read("no-air.nii", bytes(raw(zeros))), "no air")
    floats = nib.Nifti1Image(np.full((4, 4, 4), 0.5, "f4"), SHEARED)
    remarked(read("halves.nii", bytes(raw(floats))), "rounded")
    circle = phantom().astype("i2")
    circle[0] = -3024
    remarked(read("circle.nii", bytes(raw(nib.Nifti1Image(circle, SHEARED)))), "set to air")
    metal = phantom().astype("i2")
    metal[-1] = 3071
    remarked(read("metal.nii", bytes(raw(nib.Nifti1Image(metal, SHEARED)))), "maximum 12-bit value")
    beyond = nib.Nifti1Image(np.full((4, 4, 4), 40000, "i4"), SHEARED)
    remarked(read("beyond.nii", bytes(raw(beyond))), "clipped")
    refused(reader.one(folder / "good.nii", "--series", "1"), "--series")
    refused(reader.one(folder / "missing.nii"), "cannot be read")
    empty = folder / "empty"
    empty.mkdir()
    refused(reader.one(empty), "empty")
    return reader.answers - before
