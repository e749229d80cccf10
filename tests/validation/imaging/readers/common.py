"""The reader under test, and the rules by which references become what it should give."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import SimpleITK as sitk

AIR_HU = -1000
# Rules of the reader: what is not measured is air.
UNSEEN_BELOW_HU = -1500.0
PADDING_BELOW_HU = -900.0
# Of places in mm: some roundings of 1e-13, and of cosines that were made square.
SAME_PLACE_MM = 1e-9

NAME, PATIENT_ID, BIRTH_DATE = "Zyxwvut^Abcdefg", "ID-7318264", "19431127"


@dataclass(frozen=True)
class Answer:
    """What the reader said of a path."""

    path: Path
    text: dict

    @property
    def refused(self) -> str | None:
        return self.text.get("refused")

    @property
    def said(self) -> str:
        """All words of the answer."""
        return json.dumps(self.text)

    def hu(self) -> np.ndarray:
        """Voxels by column, row, slice."""
        flat = np.fromfile(self.text["voxels"], dtype="<i2")
        return flat.reshape(self.text["size"], order="F")

    def ct_from_index_mm(self) -> np.ndarray:
        affine = np.eye(4)
        affine[:3, :3] = np.reshape(self.text["steps_m"], (3, 3)).T * 1e3
        affine[:3, 3] = np.array(self.text["first_m"]) * 1e3
        return affine


@dataclass
class Reader:
    """Runs the example that dumps volumes."""

    program: Path
    folder: Path
    answers: int = 0
    everything_said: list[str] = field(default_factory=list)

    def read(self, *paths: Path, options: tuple[str, ...] = ()) -> list[Answer]:
        run = subprocess.run(
            [self.program, self.folder, *options, *paths],
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        # Of decoders that give up, too.
        assert not run.stderr, run.stderr
        self.everything_said += [run.stdout, run.stderr]
        lines = run.stdout.splitlines()
        assert len(lines) == len(paths)
        self.answers += len(paths)
        return [Answer(path, json.loads(line)) for path, line in zip(paths, lines, strict=True)]

    def one(self, path: Path, *options: str) -> Answer:
        return self.read(path, options=options)[0]


def as_hu(
    stored: np.ndarray,
    slope: float = 1.0,
    intercept: float = 0.0,
    padding: tuple[float, float] | None = None,
) -> np.ndarray:
    """Rounded half to even, clipped to 16 bits, with air for what was not measured."""
    hu = stored.astype(np.float64) * slope + intercept
    air = ~(hu > UNSEEN_BELOW_HU)
    if padding is not None:
        ends = np.array(padding) * slope + intercept
        if ends.max() <= PADDING_BELOW_HU:
            air |= (stored >= padding[0]) & (stored <= padding[1])
    hu = np.where(air, AIR_HU, hu)
    return np.clip(np.rint(hu), -32768, 32767).astype(np.int16)


def typed(kind: str, shape: tuple[int, int, int] = (7, 6, 5)) -> np.ndarray:
    """Values of a CT as far as a type holds them, air among them, by column, row, slice."""
    hu = np.random.default_rng(11).integers(-1024, 3072, size=shape)
    hu[: shape[0] // 2] = -1000
    if kind[0] == "f":
        return hu.astype(kind) + np.asarray(0.25, dtype=kind)
    limits = np.iinfo(kind)
    return np.clip(hu, max(limits.min, -2000), min(limits.max, 4000)).astype(kind)


def oblique(stored: np.ndarray) -> tuple[sitk.Image, np.ndarray]:
    """On a turned grid, and where that is in LPS mm."""
    image = sitk.GetImageFromArray(np.ascontiguousarray(stored.T))
    turn = sitk.Euler3DTransform()
    turn.SetRotation(0.2, 0.3, -0.4)
    image.SetSpacing((0.7, 0.8, 1.3))
    image.SetOrigin((-10.5, 20.25, -333.125))
    image.SetDirection(turn.GetMatrix())
    # By ITK itself, voxel by voxel.
    first = np.array(image.TransformIndexToPhysicalPoint((0, 0, 0)))
    steps = [np.array(image.TransformIndexToPhysicalPoint(tuple(index))) - first for index in np.eye(3, dtype=int).tolist()]
    affine = np.eye(4)
    affine[:3, :3] = np.array(steps).T
    affine[:3, 3] = first
    return image, affine


def by_itk(folder: Path, kind: str, attached: str, detached: str) -> tuple[list[Path], np.ndarray, np.ndarray]:
    """Files of ITK with voxels of a type on an oblique grid: attached and detached, raw and compressed.

    With them the voxels and their places, which ITK itself reads back.
    """
    stored = typed(kind)
    image, affine = oblique(stored)
    paths = []
    for end in (attached, detached):
        for name, compressed in [("raw", False), ("compressed", True)]:
            path = folder / f"{kind}-{name}.{end}"
            sitk.WriteImage(image, str(path), useCompression=compressed)
            assert (sitk.GetArrayFromImage(sitk.ReadImage(str(path))).T == stored).all()
            paths.append(path)
    return paths, stored, affine


def same(
    answer: Answer, hu: np.ndarray, ct_from_index_mm: np.ndarray, what: str = "", tolerance_mm: float = SAME_PLACE_MM
) -> None:
    """Bit for bit in HU, and to rounding in place."""
    what = what or str(answer.path)
    assert answer.refused is None, f"{what}: {answer.said}"
    got = answer.hu()
    assert got.shape == hu.shape, f"{what}: {got.shape}, not {hu.shape}"
    wrong = int((got != hu).sum())
    assert wrong == 0, f"{what}: {wrong} of {hu.size} voxels differ"
    last = np.array(hu.shape) - 1.0
    corners = np.array([[i, j, k, 1] for i in (0, last[0]) for j in (0, last[1]) for k in (0, last[2])])
    apart = np.abs((answer.ct_from_index_mm() - ct_from_index_mm) @ corners.T).max()
    assert apart < tolerance_mm, f"{what}: corners are {apart} mm apart"


def refused(answer: Answer, *words: str) -> None:
    """Answered with words that say what is wrong, and how to mend it."""
    assert answer.refused is not None, f"{answer.path} was read: {answer.said}"
    assert answer.text["hint"], f"{answer.path}: what is to be done? {answer.said}"
    for word in words:
        assert word in answer.said, f"{answer.path}: no '{word}' in {answer.said}"


def remarked(answer: Answer, *words: str) -> None:
    assert answer.refused is None, answer.said
    for word in words:
        assert any(word in remark for remark in answer.text["remarks"]), f"{word}: {answer.text['remarks']}"
