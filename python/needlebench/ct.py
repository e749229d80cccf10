"""CT volumes: what one is, synthetic ones, surfaces and scenarios made of them, routes for a needle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._command import command

if TYPE_CHECKING:
    import os

    from ._progress import Progress

__all__ = ["build", "info", "routes", "synth"]


def info(path: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
    """What a volume is: voxels, spacing, orientation, Hounsfield units, and what is odd about it.

    Args:
        path: NIfTI or DICOM file, or a folder of DICOM files.
        options: further options of ``needlebench ct info``.

    Raises:
        InputError: what cannot be read, and why.
    """
    return command("ct", "info", path, **options).data


def synth(
    phantom: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    progress: bool | Progress | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Makes a synthetic CT of a phantom or of a scenario's.

    Args:
        phantom: a phantom's name, or a scenario file.
        out: folder of the volume.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct synth``, such as ``preset="thick"``.

    Raises:
        InputError: what ``needlebench ct synth`` refuses.
    """
    return command("ct", "synth", phantom, out=out, progress=progress, **options).data


def build(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    lesions: dict[str, tuple[float, float, float]] | None = None,
    progress: bool | Progress | None = None,
    **options: Any,
) -> Path:
    """Makes a patient of a scan: surfaces, labels, a report, and a scenario to run.

    Args:
        path: NIfTI or DICOM file, or a folder of DICOM files.
        out: folder of the patient.
        lesions: names, and a point in each in the scan's coordinates (LPS, mm).
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct build``.

    Returns:
        The scenario file, for `Scenario.load`.

    Raises:
        InputError: what ``needlebench ct build`` refuses.
    """
    points = [f"{name}={','.join(map(repr, point))}" for name, point in (lesions or {}).items()]
    command("ct", "build", path, out=out, lesion=points, progress=progress, **options)
    return Path(out) / "scenario.toml"


def routes(
    path: str | os.PathLike[str],
    *,
    progress: bool | Progress | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Straight ways for a needle to a lesion, with the robot: which directions are free, why others are not, the best.

    Args:
        path: folder of a patient that `build` made, or a scenario file.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct routes``, such as ``lesion="lower"``.

    Raises:
        InputError: what ``needlebench ct routes`` refuses.
    """
    return command("ct", "routes", path, progress=progress, **options).data
