"""DICOM against pydicom: real files of its test data, and series made for the purpose."""

from __future__ import annotations

import io
import shutil
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pydicom
import SimpleITK as sitk
from common import BIRTH_DATE, NAME, PATIENT_ID, Reader, as_hu, refused, remarked, same
from pydicom.data import get_testdata_files
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.encaps import encapsulate, generate_frames
from pydicom.fileset import FileSet
from pydicom.sequence import Sequence
from pydicom.uid import (
    JPEG2000,
    MPEG2MPML,
    CTImageStorage,
    DeflatedExplicitVRLittleEndian,
    EnhancedCTImageStorage,
    ExplicitVRBigEndian,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    JPEG2000Lossless,
    JPEGLosslessSV1,
    JPEGLSLossless,
    JPEGLSNearLossless,
    RLELossless,
    XRay3DAngiographicImageStorage,
    XRayAngiographicImageStorage,
    generate_uid,
)

RNG = np.random.default_rng(11)
# JPEG 2000 is not made smaller than 32.
COLUMNS, ROWS, SLICES = 40, 36, 6


def numbers(text: object) -> list[float]:
    """Of a decimal string, whatever VR it was given."""
    if isinstance(text, bytes):
        text = text.decode().strip(" \0")
    if isinstance(text, str):
        return [float(word) for word in text.split("\\")]
    return [float(each) for each in np.atleast_1d(text)]


def hu_of(dataset: Dataset, stored: np.ndarray) -> np.ndarray:
    slope = numbers(dataset.get("RescaleSlope", 1))[0]
    intercept = numbers(dataset.get("RescaleIntercept", 0))[0]
    padding = None
    if "PixelPaddingValue" in dataset:
        ends = [int(dataset.PixelPaddingValue), int(dataset.get("PixelPaddingRangeLimit", dataset.PixelPaddingValue))]
        if dataset.PixelRepresentation:
            ends = [end - 65536 if end > 32767 else end for end in ends]
        padding = (min(ends), max(ends))
    return as_hu(stored, slope, intercept, padding).T


def affine_of(first: Dataset, step: np.ndarray) -> np.ndarray:
    """By the standard's equation C.7.6.2.1-1, with cosines of unit length at right angles."""
    orientation = np.array(numbers(first.ImageOrientationPatient))
    row = orientation[:3] / np.linalg.norm(orientation[:3])
    column = orientation[3:] - row * (row @ orientation[3:])
    column /= np.linalg.norm(column)
    between_rows, between_columns = numbers(first.PixelSpacing)
    affine = np.eye(4)
    affine[:3] = np.column_stack(
        [row * between_columns, column * between_rows, step, numbers(first.ImagePositionPatient)]
    )
    return affine


def shipped(reader: Reader, folder: Path) -> list[str]:
    """Every DICOM file of pydicom and pydicom-data."""
    here = Path(pydicom.__file__).parent
    every = {Path(p).resolve() for p in get_testdata_files("**/*") if Path(p).is_file()}
    every |= {p.resolve() for p in here.rglob("*.dcm")}
    data = Path(__import__("data_store").__file__).parent
    every |= {p.resolve() for p in data.rglob("*") if p.is_file() and p.suffix not in {".py", ".pyc"}}
    # Some readers want one file in a folder of its own.
    table = []
    for answer in reader.read(*sorted(every)):
        path = answer.path
        if answer.refused is not None:
            assert answer.refused.strip()
            assert not is_ct_slice(path), f"{path}: {answer.said}"
            table.append(f"{path.name}: refused, {answer.refused}")
            continue
        dataset = pydicom.dcmread(path, force=True)
        assert dataset.get("Modality", "CT") == "CT", path
        if not hasattr(dataset.file_meta, "TransferSyntaxUID"):
            dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
        if "PerFrameFunctionalGroupsSequence" in dataset:
            same(answer, *expected(single_frames(dataset)))
        else:
            same(answer, *single_slice(dataset))
        table.append(f"{path.name}: same")
    return table


def is_ct_slice(path: Path) -> bool:
    """Whether pydicom finds all in it that a slice of a CT has."""
    try:
        dataset = pydicom.dcmread(path, force=True)
    except (pydicom.errors.InvalidDicomError, OSError, ValueError, KeyError, EOFError):
        return False
    needed = ["PixelData", "ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"]
    if dataset.get("Modality") != "CT" or not all(key in dataset for key in needed):
        return False
    return "LOCALIZER" not in dataset.get("ImageType", [])


def single_slice(dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
    orientation = np.array(numbers(dataset.ImageOrientationPatient))
    normal = np.cross(orientation[:3], orientation[3:])
    # One slice: its thickness stands for the distance to the next, and 1 mm where there is none.
    step = normal / np.linalg.norm(normal) * numbers(dataset.get("SliceThickness") or 1.0)[0]
    return hu_of(dataset, dataset.pixel_array)[..., None], affine_of(dataset, step)


class Frame(Dataset):
    """A frame of an enhanced object as a slice of its own."""

    @property
    def pixel_array(self) -> np.ndarray:
        return self.__dict__["stored"]


def single_frames(dataset: Dataset) -> list[Frame]:
    frames = []
    shared = dataset.SharedFunctionalGroupsSequence[0]
    for own, stored in zip(dataset.PerFrameFunctionalGroupsSequence, dataset.pixel_array, strict=True):
        frame = Frame()
        for group in (shared, own):
            for sequence in group:
                if sequence.VR == "SQ" and len(sequence.value) == 1:
                    frame.update(sequence.value[0])
        frame.__dict__["stored"] = stored
        frames.append(frame)
    return frames


def slice_of(
    at: int,
    stored: np.ndarray,
    position: Iterable[float],
    orientation: Iterable[float] = (1, 0, 0, 0, 1, 0),
    **changes: object,
) -> FileDataset:
    """One slice of a scanner, with a patient's name on it."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CTImageStorage
    meta.MediaStorageSOPInstanceUID = generate_uid()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    slice_ = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    slice_.SOPClassUID = CTImageStorage
    slice_.SOPInstanceUID = meta.MediaStorageSOPInstanceUID
    slice_.PatientName, slice_.PatientID, slice_.PatientBirthDate = NAME, PATIENT_ID, BIRTH_DATE
    slice_.ImageComments = f"{NAME} {BIRTH_DATE}"
    slice_.OtherPatientIDs = PATIENT_ID
    slice_.Modality, slice_.ImageType = "CT", ["ORIGINAL", "PRIMARY", "AXIAL"]
    slice_.SeriesInstanceUID, slice_.StudyInstanceUID = "1.2.3.4", "1.2.3"
    slice_.FrameOfReferenceUID, slice_.SeriesNumber = "1.2.3.5", 3
    # Wrong on purpose: none of them may count.
    slice_.InstanceNumber, slice_.SliceLocation, slice_.SpacingBetweenSlices = 100 - at, -7.0 * at, 99
    slice_.SliceThickness, slice_.KVP, slice_.ConvolutionKernel = 1.25, 120, "B30f"
    slice_.ImagePositionPatient = [float(each) for each in position]
    slice_.ImageOrientationPatient = [float(each) for each in orientation]
    slice_.PixelSpacing = [0.75, 0.5]
    slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
    slice_.Rows, slice_.Columns = stored.shape
    slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit = 16, 16, 15
    slice_.PixelRepresentation = int(stored.dtype.kind == "i")
    slice_.RescaleSlope, slice_.RescaleIntercept = 1, -1024
    slice_.PixelData = stored.astype(stored.dtype.newbyteorder("<")).tobytes()
    for key, value in changes.items():
        if value is None:
            del slice_[key]
        else:
            setattr(slice_, key, value)
    return slice_


def stored_slices(kind: str = "u2", count: int = SLICES) -> list[np.ndarray]:
    stored = RNG.integers(0, 4096, size=(count, ROWS, COLUMNS))
    stored[:, :3] = 24
    return list(stored.astype(kind))


def series(count: int = SLICES, step: Iterable[float] = (0, 0, 1.25), **changes: object) -> list[FileDataset]:
    start, step = np.array([-12.5, 30.25, -100.0]), np.array(list(step))
    return [
        slice_of(at, stored, start + at * step, **changes)
        for at, stored in enumerate(stored_slices(count=count))
    ]


def saved(folder: Path, slices: Iterable[FileDataset], prefix: str = "s") -> Path:
    """In an order and with names that say nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    slices = list(slices)
    for name, at in enumerate(RNG.permutation(len(slices))):
        slices[at].save_as(folder / f"{prefix}{name:03}", enforce_file_format=True)
    return folder


def expected(slices: list[FileDataset]) -> tuple[np.ndarray, np.ndarray]:
    """By position along the normal."""
    orientation = np.array(numbers(slices[0].ImageOrientationPatient))
    normal = np.cross(orientation[:3], orientation[3:])
    ordered = sorted(slices, key=lambda each: normal @ np.array(numbers(each.ImagePositionPatient)))
    first, last = (np.array(numbers(each.ImagePositionPatient)) for each in (ordered[0], ordered[-1]))
    hu = np.stack([hu_of(each, each.pixel_array) for each in ordered], axis=-1)
    return hu, affine_of(ordered[0], (last - first) / (len(ordered) - 1))


def geometries(reader: Reader, folder: Path) -> int:
    """Directions, tilt, order, types: read as pydicom has them."""
    turn = np.radians(22.0)
    tilted = (1, 0, 0, 0, np.cos(turn), -np.sin(turn))
    kinds = {
        "plain": series(),
        "downwards": series(step=(0, 0, -1.25)),
        "tilted": series(orientation=tilted),
        "tilted-table": series(orientation=tilted, step=(0, 0.3, 1.5)),
        "coronal": series(orientation=(1, 0, 0, 0, 0, -1), step=(0, 2, 0)),
        "flipped": series(orientation=(-1, 0, 0, 0, 1, 0)),
        "prone": series(orientation=(-1, 0, 0, 0, -1, 0), step=(0, 0, -1.25)),
        "decubitus": series(orientation=(0, 1, 0, -1, 0, 0)),
        "sagittal": series(orientation=(0, 1, 0, 0, 0, -1), step=(-1.5, 0, 0)),
        "decreasing-columns": series(orientation=(0, 0, -1, 0, 1, 0), step=(2, 0, 0)),
        "feet-first": series(orientation=(-1, 0, 0, 0, -1, 0)),
        "oblique": series(orientation=(0.8, 0.6, 0, -0.6, 0.8, 0), step=(0.1, 0.2, 3)),
        "12-bits": series(BitsStored=12, HighBit=11),
    }
    kinds["intercepts"] = series()
    for at, each in enumerate(kinds["intercepts"]):
        each.RescaleIntercept, each.RescaleSlope = -1000 - at, 1 + at / 2
    kinds["signed"] = [
        slice_of(at, (stored.astype("i2") - 1024), (0, 0, at), RescaleIntercept=0)
        for at, stored in enumerate(stored_slices())
    ]
    kinds["padding"] = [
        slice_of(at, np.where(stored > 3000, -2000, stored.astype("i2")).astype("i2"), (0, 0, at))
        for at, stored in enumerate(stored_slices())
    ]
    for each in kinds["padding"]:
        each.add_new(0x00280120, "US", 63536)
    kinds["32-bits"] = [
        slice_of(at, stored.astype("u4"), (0, 0, at), BitsAllocated=32, BitsStored=32, HighBit=31)
        for at, stored in enumerate(stored_slices())
    ]
    syntaxes = {
        "implicit": ImplicitVRLittleEndian,
        "deflated": DeflatedExplicitVRLittleEndian,
    }
    for name, syntax in syntaxes.items():
        kinds[name] = series()
        for each in kinds[name]:
            each.file_meta.TransferSyntaxUID = syntax
    kinds["un"] = series()
    references = {name: expected(slices) for name, slices in kinds.items()}
    for each in kinds["un"]:
        for tag, value in [(0x00281052, b"-1024 "), (0x00281053, b"1 "), (0x00280030, b"0.75\\0.5")]:
            each[tag] = pydicom.DataElement(tag, "UN", value)
    for name, slices in kinds.items():
        answer = reader.one(saved(folder / name, slices))
        same(answer, *references[name], what=name)
    again = reader.one(folder / "plain", "--threads", "3")
    same(again, *references["plain"])

    # One byte order that pydicom writes itself.
    big = series()
    reference = expected(big)
    for each in big:
        each.PixelData = each.pixel_array.astype(">u2").tobytes()
        each.file_meta.TransferSyntaxUID = ExplicitVRBigEndian
    (folder / "big").mkdir()
    for at, each in enumerate(big):
        path = folder / "big" / str(at)
        pydicom.dcmwrite(path, each, implicit_vr=False, little_endian=False, force_encoding=True)
    same(reader.one(folder / "big"), *reference)
    return len(kinds) + 1


def compressed(reader: Reader, folder: Path) -> None:
    for name, syntax in {"rle": RLELossless, "jpeg2000": JPEG2000Lossless}.items():
        slices = series(BitsStored=12, HighBit=11)
        reference = expected(slices)
        for each in slices:
            each.compress(syntax, generate_instance_uid=False)
        same(reader.one(saved(folder / name, slices)), *reference, what=name)
    # JPEG lossless by GDCM; its writer knows no positions, so its pixels go into slices of ours.
    slices = series()
    reference = expected(slices)
    for at, each in enumerate(slices):
        writer = sitk.ImageFileWriter()
        writer.SetImageIO("GDCMImageIO")
        path = folder / f"jpeg-lossless-{at}.dcm"
        writer.SetFileName(str(path))
        writer.UseCompressionOn()
        writer.SetCompressor("JPEG")
        writer.Execute(sitk.GetImageFromArray(each.pixel_array))
        packed = pydicom.dcmread(path)
        path.unlink()
        assert packed.file_meta.TransferSyntaxUID == JPEGLosslessSV1
        each.file_meta.TransferSyntaxUID = JPEGLosslessSV1
        each.PixelData = packed.PixelData
        each["PixelData"].is_undefined_length = True
    same(reader.one(saved(folder / "jpeg-lossless", slices)), *reference)
    lossy = series(BitsStored=12, HighBit=11)
    for each in lossy:
        each.compress(JPEG2000Lossless, generate_instance_uid=False)
        each.file_meta.TransferSyntaxUID = JPEG2000
    path = saved(folder / "maybe-lossy", lossy)
    remarked(reader.one(path), "may have been compressed with loss")
    for each in lossy:
        each.LossyImageCompression = "00"
    remarks = reader.one(saved(path, lossy)).text["remarks"]
    assert not any("loss" in remark for remark in remarks), remarks
    damaged_streams(reader, folder, slices, lossy)
    jpeg_ls(reader, folder)
    for each in slices:
        each.file_meta.TransferSyntaxUID = MPEG2MPML
    refused(reader.one(saved(folder / "film", slices)), "MPEG2", "gdcmconv")


def pictures(bits: int) -> Iterable[np.ndarray]:
    """What JPEG-LS codes by its modes: noise, one value, gradients, runs with sharp ends, a body in air."""
    greatest = 2**bits - 1
    y, x = np.mgrid[:ROWS, :COLUMNS]
    yield RNG.integers(0, greatest + 1, (ROWS, COLUMNS))
    # CharLS takes the width of a picture from its greatest value: one pixel says it.
    one = np.full((ROWS, COLUMNS), 1024 % greatest)
    one[-1, -1] = greatest
    yield one
    yield (x * 37 + y * 5) % (greatest + 1)
    yield np.repeat(RNG.integers(0, greatest + 1, (ROWS, COLUMNS // 8)), 8, axis=1)
    yield RNG.choice([0, greatest], (ROWS, COLUMNS))
    body = ((x - 20) / 15) ** 2 + ((y - 18) / 12) ** 2 < 1
    yield np.clip(np.where(body, 1064 + RNG.normal(0, 12, x.shape), 24), 0, greatest).round()


def jpeg_ls(reader: Reader, folder: Path) -> None:
    """Lossless and nearly so, by CharLS."""
    count = 0
    for bits in (8, 10, 12, 16):
        for near in (0, 2):
            allocated = 8 if bits == 8 else 16
            slices = [
                slice_of(at, stored.astype(f"u{allocated // 8}"), (0, 0, at), BitsAllocated=allocated)
                for at, stored in enumerate(pictures(bits))
            ]
            for each in slices:
                each.BitsStored, each.HighBit = bits, bits - 1
                stored = each.pixel_array.astype(int)
                if near:
                    each.compress(JPEGLSNearLossless, jls_error=near, generate_instance_uid=False)
                else:
                    each.compress(JPEGLSLossless, generate_instance_uid=False)
                apart = np.abs(each.pixel_array.astype(int) - stored).max()
                assert apart <= near, (bits, near, apart)
            answer = reader.one(saved(folder / f"jpeg-ls-{bits}-{near}", slices))
            same(answer, *expected(slices))
            assert any("with loss" in remark for remark in answer.text["remarks"]) == (near > 0)
            count += len(slices)
            # The stream decides, whichever of the two the file says that it is.
            for each in slices:
                each.file_meta.TransferSyntaxUID = JPEGLSLossless if near else JPEGLSNearLossless
            answer = reader.one(saved(folder / f"jpeg-ls-other-{bits}-{near}", slices))
            assert any("with loss" in remark for remark in answer.text["remarks"]) == (near > 0)
    signed = [
        slice_of(at, (stored.astype("i2") - 1024), (0, 0, at), RescaleIntercept=0)
        for at, stored in enumerate(stored_slices())
    ]
    reference = expected(signed)
    for each in signed:
        each.compress(JPEGLSLossless, generate_instance_uid=False)
    same(reader.one(saved(folder / "jpeg-ls-signed", signed)), *reference)
    print(count + len(signed), "JPEG-LS slices are the same as by CharLS")
    damaged_streams(reader, folder, slices)


def damaged_streams(reader: Reader, folder: Path, *kinds: list[FileDataset]) -> None:
    """Streams cut, and of another width, are refused. Changed ones are refused as damaged or read, whatever their
    numbers then are, and no decoder panics."""
    for slices in kinds:
        whole = slices[0].PixelData
        good = pydicom.dcmread(saved(folder / "stream", slices[:1]) / "s000").pixel_array
        frame = next(generate_frames(whole, number_of_frames=1))
        for keep in range(4, len(frame) - 8, 97):
            slices[0].PixelData = encapsulate([frame[:keep]])
            refused(reader.one(saved(folder / "stream", slices[:1])), "damaged")
        paths = []
        for trial in range(60):
            changed = bytearray(frame)
            for at in RNG.integers(2, len(frame), 4):
                changed[at] = RNG.integers(256)
            slices[0].PixelData = encapsulate([bytes(changed)])
            slices[0].save_as(folder / "stream" / f"t{trial}", enforce_file_format=True)
            paths.append(folder / "stream" / f"t{trial}")
        for answer in reader.read(*paths):
            assert answer.refused is None or "damaged" in answer.said, answer.said
        # As wide as the file says, and a number for each pixel.
        changed = bytearray(frame)
        if changed[2:4] == b"\xff\x51":
            changed[43] = 2
            slices[0].PixelData = encapsulate([bytes(changed)])
            refused(reader.one(saved(folder / "stream", slices[:1])), "several of them")
        elif changed[2:4] == b"\xff\xf7":
            changed[6] = 17
            slices[0].PixelData = encapsulate([bytes(changed)])
            refused(reader.one(saved(folder / "stream", slices[:1])), "17 bits")
        else:
            at = changed.index(b"\xff\xc3")
            changed[at + 4] = 8
            slices[0].PixelData = encapsulate([bytes(changed)])
            refused(reader.one(saved(folder / "stream", slices[:1])), "8 bits")
        slices[0].PixelData = whole
        shutil.rmtree(folder / "stream")
        assert good.shape == (ROWS, COLUMNS)


def enhanced(slices: list[FileDataset], shared_orientation: bool = True) -> FileDataset:
    """The same slices as one enhanced multi-frame object."""
    whole = slice_of(0, slices[0].pixel_array, (0, 0, 0))
    whole.SOPClassUID = whole.file_meta.MediaStorageSOPClassUID = EnhancedCTImageStorage
    for key in [
        "ImagePositionPatient",
        "ImageOrientationPatient",
        "PixelSpacing",
        "RescaleSlope",
        "RescaleIntercept",
        "SliceThickness",
        "ConvolutionKernel",
    ]:
        delattr(whole, key)
    whole.NumberOfFrames = len(slices)
    whole.PixelData = b"".join(each.PixelData for each in slices)

    def group(**values: object) -> Sequence:
        item = Dataset()
        for key, value in values.items():
            setattr(item, key, value)
        return Sequence([item])

    orientation = group(ImageOrientationPatient=slices[0].ImageOrientationPatient)
    shared = Dataset()
    shared.PixelMeasuresSequence = group(PixelSpacing=slices[0].PixelSpacing, SliceThickness=1.25)
    shared.CTReconstructionSequence = group(ConvolutionKernel="B30f")
    if shared_orientation:
        shared.PlaneOrientationSequence = orientation
    whole.SharedFunctionalGroupsSequence = Sequence([shared])
    frames = []
    for at, each in enumerate(slices):
        frame = Dataset()
        frame.FrameContentSequence = group(StackID="1", InStackPositionNumber=at + 1)
        frame.PlanePositionSequence = group(ImagePositionPatient=each.ImagePositionPatient)
        frame.PixelValueTransformationSequence = group(
            RescaleSlope=each.RescaleSlope, RescaleIntercept=each.RescaleIntercept, RescaleType="HU"
        )
        if not shared_orientation:
            frame.PlaneOrientationSequence = orientation
        frames.append(frame)
    whole.PerFrameFunctionalGroupsSequence = Sequence(frames)
    return whole


def multi_frame(reader: Reader, folder: Path) -> None:
    for name, compress in {"enhanced": None, "enhanced-rle": RLELossless, "enhanced-j2k": JPEG2000Lossless}.items():
        for is_shared in (True, False):
            slices = series(orientation=(1, 0, 0, 0, 0.96, -0.28))
            for at, each in enumerate(slices):
                each.RescaleIntercept = -1024 + at
            reference = expected(slices)
            RNG.shuffle(slices)
            whole = enhanced(slices, is_shared)
            if compress:
                whole.compress(compress, generate_instance_uid=False)
            path = folder / f"{name}-{is_shared}.dcm"
            whole.save_as(path, enforce_file_format=True)
            answer = reader.one(path)
            same(answer, *reference, what=name)
            assert answer.text["description"]["kernel"] == "B30f"
            assert answer.text["slice_thickness_m"] == 1.25e-3
    deflated = series()
    reference = expected(deflated)
    whole = enhanced(deflated)
    whole.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
    whole.save_as(folder / "enhanced-deflated.dcm", enforce_file_format=True)
    same(reader.one(folder / "enhanced-deflated.dcm"), *reference)
    fewer = enhanced(series())
    fewer.NumberOfFrames = 60000
    fewer.save_as(folder / "enhanced-60000.dcm", enforce_file_format=True)
    refused(reader.one(folder / "enhanced-60000.dcm"), "describes 6", "copy or export")
    legacy = slice_of(0, stored_slices()[0], (0, 0, 0), NumberOfFrames=3)
    legacy.PixelData = legacy.PixelData * 3
    legacy.save_as(folder / "frames-at-one-place.dcm", enforce_file_format=True)
    refused(reader.one(folder / "frames-at-one-place.dcm"), "same position")


class Stream(io.RawIOBase):
    """Where nothing is gone back to, so that sizes come after the files."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("wb")

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:
        return self.file.write(data)


def archives(reader: Reader, folder: Path, disc: Path, reference: tuple[np.ndarray, np.ndarray]) -> None:
    """A folder in ZIP archives of Python: deflated, stored, of a stream; cut off."""
    files = [path for path in sorted(disc.rglob("*")) if path.is_file()]
    targets = {name: folder / f"{name}.zip" for name in ("deflated", "stored", "stream")}
    for name, path in targets.items():
        method = zipfile.ZIP_STORED if name == "stored" else zipfile.ZIP_DEFLATED
        with zipfile.ZipFile(Stream(path) if name == "stream" else path, "w", method) as archive:
            for file in files:
                archive.write(file, file.relative_to(disc.parent))
            archive.writestr("__MACOSX/disc/._A0", b"Mac OS X")
        answer = reader.one(path)
        same(answer, *reference, what=name)
        assert answer.text["description"]["format"].endswith("in a ZIP archive")
    whole = targets["deflated"].read_bytes()
    for keep in range(4, len(whole), len(whole) // 7):
        (folder / "cut.zip").write_bytes(whole[:keep])
        refused(reader.one(folder / "cut.zip"), "damaged or cut off")
    with zipfile.ZipFile(folder / "bzip2.zip", "w", zipfile.ZIP_BZIP2) as archive:
        archive.write(files[0], "IM0")
    refused(reader.one(folder / "bzip2.zip"), "bzip2", "unpack it")


def indexed(reader: Reader, folder: Path) -> None:
    """A disc with a DICOMDIR by pydicom: the index itself, its folder, in a ZIP archive, with files missing."""
    slices = series()
    reference = expected(slices)
    disc = FileSet()
    for at, each in enumerate(slices):
        each.StudyDate, each.StudyTime, each.StudyID, each.InstanceNumber = "20240101", "120000", "1", at + 1
        disc.add(each)
    disc.write(folder)
    (folder / "other").mkdir()
    slice_of(0, stored_slices()[0], (0, 0, 0), SeriesNumber=8, SeriesInstanceUID="1.2.8").save_as(
        folder / "other" / "IM0", enforce_file_format=True
    )
    same(reader.one(folder / "DICOMDIR"), *reference)
    packed = Path(shutil.make_archive(str(folder), "zip", folder))
    for path in (folder, packed):
        answer = reader.one(path)
        same(answer, *reference)
        assert not any("missing" in remark for remark in answer.text["remarks"]), answer.text["remarks"]
    files = sorted(path for path in folder.rglob("IM*") if path.parent.name != "other")
    assert len(files) == SLICES, files
    last = next(path for path in files if pydicom.dcmread(path).SOPInstanceUID == slices[-1].SOPInstanceUID)
    last.unlink()
    for path in (folder / "DICOMDIR", folder):
        answer = reader.one(path)
        remarked(answer, "1 of the 6 files that the DICOMDIR names are missing")
        assert answer.text["size"][2] == SLICES - 1
    for path in files:
        path.unlink(missing_ok=True)
    refused(reader.one(folder / "DICOMDIR"), "none of the 6 files", "whole disc")


def cone_beam(reader: Reader, folder: Path) -> None:
    """Of angiography systems: volumes as slices and as X-Ray 3D, and what is none."""
    slices = series(Modality="XA")
    answer = reader.one(saved(folder / "cone-beam", slices))
    same(answer, *expected(slices))
    remarked(answer, "cone beam CT: its values are not calibrated")
    whole = enhanced(slices)
    whole.SOPClassUID = whole.file_meta.MediaStorageSOPClassUID = XRay3DAngiographicImageStorage
    whole.Modality, whole.ImageType = "XA", ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"]
    whole.save_as(folder / "x-ray-3d.dcm", enforce_file_format=True)
    answer = reader.one(folder / "x-ray-3d.dcm")
    same(answer, *expected(slices))
    remarked(answer, "cone beam CT: its values are not calibrated")
    run = slice_of(0, stored_slices()[0], (0, 0, 0), Modality="XA", NumberOfFrames=4)
    run.SOPClassUID = run.file_meta.MediaStorageSOPClassUID = XRayAngiographicImageStorage
    del run.ImagePositionPatient, run.ImageOrientationPatient, run.PixelSpacing
    run.PixelData = run.PixelData * 4
    run.save_as(folder / "run.dcm", enforce_file_format=True)
    refused(reader.one(folder / "run.dcm"), "4 X-ray projections", "3D reconstruction")


def sent(reader: Reader, folder: Path) -> None:
    """What is no plain series of one volume, called what it is."""
    gated = [series(SeriesDescription=f"{NAME} gated {percent}%") for percent in range(0, 100, 10)]
    path = saved(folder / "gated", [each for phase in gated for each in phase])
    refused(reader.one(path), "10 phases (4D)", "phase 1 of 10 (0 %)", "phase 10 of 10 (90 %)")
    answer = reader.one(path, "--series", "3.4")
    same(answer, *expected(gated[3]))
    remarked(answer, "phase 4 of 10 (30 %)")

    scan = series()
    bolus = [
        slice_of(
            at, stored, (0, 0, 0), SeriesInstanceUID="1.2.3.6", SeriesNumber=2, AcquisitionTime=f"1015{at:02}.5"
        )
        for at, stored in enumerate(stored_slices(count=12))
    ]
    refused(reader.one(saved(folder / "bolus", bolus)), "all 12 slices are at one place", "bolus tracking")
    mip = series(
        SeriesInstanceUID="1.2.3.7",
        SeriesNumber=7,
        ImageType=["DERIVED", "SECONDARY", "AXIAL", "CT_SOM5 MIP"],
        SliceThickness=10,
    )
    refused(reader.one(saved(folder / "mip", mip)), "maximum intensity projections (MIP)", "thin slices")
    answer = reader.one(saved(folder / "study", [*bolus, *scan, *mip]))
    same(answer, *expected(scan))
    remarked(answer, "bolus tracking", "maximum intensity projections")

    (folder / "study" / "s999").touch()
    refused(reader.one(folder / "study"), "s999", "0 bytes", "slices are missing")
    (folder / "no-bytes").mkdir()
    for at in range(3):
        (folder / "no-bytes" / f"IM{at}").touch()
    refused(reader.one(folder / "no-bytes"), "all 3 files are empty (0 bytes)")

    rounded = series()
    for each in rounded[1::2]:
        each.PixelSpacing = [0.75002, 0.50002]
    same(reader.one(saved(folder / "spacings", rounded)), *expected(rounded), tolerance_mm=2e-5 * COLUMNS)
    answer = reader.one(saved(folder / "slabs", series(SliceThickness=10)))
    remarked(answer, "10 mm thick, but 1.250 mm apart")


def folders(reader: Reader, folder: Path) -> None:
    """What people have in folders."""
    both = [*series(), *series(7, SeriesInstanceUID="1.2.3.9", SeriesNumber=5, ConvolutionKernel="B70f")]
    path = saved(folder / "two-series", both)
    refused(reader.one(path), "2 series", "kernel B30f", "kernel B70f", "7 slices", "--series", "1.25 mm thick")
    same(reader.one(path, "--series", "5"), *expected(both[6:]))
    same(reader.one(path, "--series", "1.2.3.4"), *expected(both[:6]))
    refused(reader.one(path, "--series", "8"), "no series 8", "B70f")

    scout = slice_of(
        0, stored_slices()[0], (0, 0, 0), (0, 1, 0, 0, 0, -1), ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER"]
    )
    slices = series()
    path = saved(folder / "scout", [scout, *slices])
    (path / "README.txt").write_text("made by a clinic")
    (path / "DICOMDIR.xml").write_bytes(b"\0" * 400)
    answer = reader.one(path)
    same(answer, *expected(slices))
    remarked(answer, "a scout")

    coronal = series(orientation=(1, 0, 0, 0, 0, -1), step=(0, 2, 0), SeriesNumber=3)
    path = saved(folder / "reformats", [*slices, *coronal])
    refused(reader.one(path), "coronal", "axial", "3.1", "3.2")
    same(reader.one(path, "--series", "3.1"), *expected(slices))

    phases = [*series(AcquisitionNumber=1), *series(AcquisitionNumber=2)]
    path = saved(folder / "phases", phases)
    refused(reader.one(path), "3.1", "3.2")
    same(reader.one(path, "--series", "3.2"), *expected(phases[6:]))

    # Two breath-holds that overlap, at places of their own: even each, uneven together.
    first = series(AcquisitionNumber=1)
    second = [
        slice_of(at, stored, (-12.5, 30.25, -95.6 + 1.25 * at), AcquisitionNumber=2)
        for at, stored in enumerate(stored_slices())
    ]
    path = saved(folder / "interleaved", [*first, *second])
    refused(reader.one(path), "3.1: 6 slices", "3.2: 6 slices", "--series")
    same(reader.one(path, "--series", "3.2"), *expected(second))
    # Step and shoot: every slice its own acquisition, one of them missing.
    shots = series(9)
    for at, each in enumerate(shots):
        each.AcquisitionNumber = at // 2
    same(reader.one(saved(folder / "shots", shots)), *expected(shots))
    del shots[3]
    refused(reader.one(saved(folder / "shots-gap", shots)), "missing between")

    # A disc as burned: folders, an index of them, other things, a file of another size.
    disc = series()
    for at, each in enumerate(disc):
        saved(folder / "disc" / "DICOM" / f"A{at % 2}", [each], prefix=f"I{at}")
    (folder / "disc" / "AUTORUN.INF").write_text("[autorun]")
    (folder / "disc" / "empty").touch()
    index = Path(pydicom.data.get_testdata_file("DICOMDIR"))
    shutil.copy(index, folder / "disc" / "DICOMDIR")
    same(reader.one(folder / "disc"), *expected(disc))
    archives(reader, folder, folder / "disc", expected(disc))
    indexed(reader, folder / "index")
    other = slice_of(9, np.zeros((16, 16), "u2"), (0, 0, 50))
    path = saved(folder / "sizes", [*series(), other])
    remarked(reader.one(path), "16 x 16")

    copies = series()
    path = saved(folder / "copies", copies)
    shutil.copytree(path, path / "again")
    answer = reader.one(path)
    same(answer, *expected(copies))
    remarked(answer, "duplicates")

    twice = [*series(), series()[2]]
    refused(reader.one(saved(folder / "duplicate", twice)), "same position", "mm along the slice normal")

    holed = series()
    del holed[2]
    path = saved(folder / "gap", holed)
    refused(reader.one(path), "missing between", "-98.75", "-96.25", "--fill-gaps")
    answer = reader.one(path, "--fill-gaps")
    remarked(answer, "interpolated")
    hu = answer.hu().astype(int)
    assert hu.shape[2] == 6
    middle = (hu[..., 1] + hu[..., 3]) / 2
    assert np.abs(hu[..., 2] - middle).max() <= 0.5
    wide = series(9)
    del wide[3:5]
    refused(reader.one(saved(folder / "wide-gap", wide), "--fill-gaps"), "2 slices are missing")

    heights = [0, 1, 2, 3.5, 5, 6.5, 8]
    uneven = [
        slice_of(at, stored, (0, 0, height))
        for at, (stored, height) in enumerate(zip(stored_slices(count=7), heights, strict=True))
    ]
    answer = reader.one(saved(folder / "uneven", uneven))
    remarked(answer, "interpolated to a uniform 1.000 mm")
    source, _ = expected(uneven)
    for k in range(answer.hu().shape[2]):
        upper = min(int(np.searchsorted(heights, k, side="right")), 6)
        weight = (k - heights[upper - 1]) / (heights[upper] - heights[upper - 1])
        mean = source[..., upper - 1] * (1 - weight) + source[..., upper] * weight
        assert np.abs(answer.hu()[..., k] - mean).max() <= 0.5 + 1e-9, k

    rounded = [
        slice_of(at, stored, (0, 0, round(at * 1.25, 1))) for at, stored in enumerate(stored_slices())
    ]
    remarked(reader.one(saved(folder / "rounded", rounded)), "rounding")
    aside = series()
    aside[3].ImagePositionPatient[0] += 2
    refused(reader.one(saved(folder / "aside", aside)), "off the line")


def odd(reader: Reader, folder: Path) -> None:
    """Files that say too little, or what is wrong."""
    at_least = 6

    def one(name: str, *options: str, **changes: object) -> object:
        slices = series(at_least)
        for each in slices:
            for key, value in changes.items():
                if value is None:
                    delattr(each, key)
                else:
                    setattr(each, key, value)
        return reader.one(saved(folder / name, slices), *options)

    refused(one("no-position", ImagePositionPatient=None), "ImagePositionPatient")
    refused(one("no-orientation", ImageOrientationPatient=None), "ImageOrientationPatient")
    refused(one("no-spacing", PixelSpacing=None), "PixelSpacing")
    refused(one("not-square", ImageOrientationPatient=[1, 0, 0, 0.5, 1, 0]), "not perpendicular")
    refused(one("mr", Modality="MR"), "MR", "not CT")
    remarked(one("no-modality", Modality=None), "modality is not stated")
    refused(one("colours", PhotometricInterpretation="PALETTE COLOR"), "PALETTE COLOR")
    refused(one("slope-0", RescaleSlope=0), "(0028,1053)")
    remarked(one("no-rescale", RescaleSlope=None, RescaleIntercept=None), "stored values are used as HU")
    remarked(one("unit", RescaleType="US"), "US")
    remarked(one("lossy", LossyImageCompression="01"), "loss")
    remarked(one("water-padding", PixelPaddingValue=1024), "not applied")
    refused(one("bits", BitsStored=17), "17 bits")
    refused(one("pixels", PixelData=b"12"), "truncated")
    commas = series()
    for each in commas:
        each[0x00280030] = pydicom.DataElement(0x00280030, "LO", "0,75\\0,5")
    refused(reader.one(saved(folder / "commas", commas)), "(0028,0030)", "not a number")

    path = saved(folder / "cut", series())
    victim = sorted(path.iterdir())[1]
    whole = victim.read_bytes()
    for length in [len(whole) - 1, len(whole) - 100, 700, 400, 140]:
        victim.write_bytes(whole[:length])
        answer = reader.one(path)
        refused(answer)
        assert victim.name in answer.said, answer.said

    # Without preamble, meta group, or its length.
    plain = series()
    reference = expected(plain)
    path = saved(folder / "bare", plain)
    for file in path.iterdir():
        file.write_bytes(file.read_bytes()[132:])
    same(reader.one(path), *reference)
    path = saved(folder / "no-length", plain)
    for file in path.iterdir():
        data = file.read_bytes()
        assert data[132:136] == b"\x02\x00\x00\x00"
        file.write_bytes(data[:132] + data[144:])
    same(reader.one(path), *reference)
    for name, is_implicit in {"no-meta-implicit": True, "no-meta-explicit": False}.items():
        path = folder / name
        path.mkdir()
        for at, each in enumerate(plain):
            pydicom.dcmwrite(
                path / f"{at}", Dataset(each), implicit_vr=is_implicit, little_endian=True, enforce_file_format=False
            )
        answer = reader.one(path)
        same(answer, *reference)
        remarked(answer, "no transfer syntax")

    # Called as other files are, and written in another way than it says.
    single = slice_of(0, stored_slices()[0], (0, 0, 0))
    for name in ["scan.img", "scan.nii", "no-ending"]:
        single.save_as(folder / name, enforce_file_format=True)
        same(reader.one(folder / name), *single_slice(single))
    data = (folder / "no-ending").read_bytes()
    at = data.index(b"1.2.840.10008.1.2.1\0")
    (folder / "no-ending").write_bytes(data[:at] + b"1.2.840.10008.1.2\0\0\0" + data[at + 20 :])
    answer = reader.one(folder / "no-ending")
    same(answer, *single_slice(single))
    remarked(answer, "implicit VRs")
    shouting = slice_of(0, stored_slices()[0], (0, 0, 0), ConvolutionKernel="\x1b[31mB30f\x07")
    shouting.save_as(folder / "shouting.dcm", enforce_file_format=True)
    assert reader.one(folder / "shouting.dcm").text["description"]["kernel"] == "[31mB30f"

    damaged = series()
    for each in damaged:
        each.compress(RLELossless, generate_instance_uid=False)
    path = saved(folder / "rle-damaged", damaged)
    file = sorted(path.iterdir())[0]
    data = bytearray(file.read_bytes())
    data[-60:-8] = bytes(52)
    file.write_bytes(data)
    answer = reader.one(path)
    assert answer.refused is None or "damaged" in answer.said, answer.said
    tilt = series(orientation=(1, 0, 0, 0, 0.96, -0.28), GantryDetectorTilt=-16)
    remarked(reader.one(saved(folder / "tilt", tilt)), "tilted gantry")
    single = slice_of(0, stored_slices()[0], (0, 0, 0))
    single.save_as(folder / "single.dcm", enforce_file_format=True)
    remarked(reader.one(folder / "single.dcm"), "there is one slice")
    del single.SliceThickness
    single.save_as(folder / "single.dcm", enforce_file_format=True)
    remarked(reader.one(folder / "single.dcm"), "1 mm")
