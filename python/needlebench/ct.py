"""CT volumes: description, synthesis, conversion to scenarios, and needle paths."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._command import command

if TYPE_CHECKING:
    import os

    from ._progress import Progress

__all__ = ["build", "info", "routes", "synth"]


def info(path: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
    """Describes a volume: voxels, spacing, orientation, Hounsfield units and irregularities.

    Args:
        path: NIfTI or DICOM file, or a folder of DICOM files.
        options: further options of ``needlebench ct info``.

    Raises:
        InputError: the volume cannot be read, with the reason.
    """
    return command("ct", "info", path, **options).data


def synth(
    phantom: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    progress: bool | Progress | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Synthesises a CT of a phantom or of a scenario's phantom.

    Args:
        phantom: a phantom's name, or a scenario file.
        out: folder of the volume.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct synth``, e.g. ``preset="thick"``.

    Raises:
        InputError: input that ``needlebench ct synth`` rejects.
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
    """Builds a patient from a scan: surfaces, labels, a report and a scenario.

    Args:
        path: NIfTI or DICOM file, or a folder of DICOM files.
        out: folder of the patient.
        lesions: seed point of each lesion by its name, mm in the scan (LPS).
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct build``, e.g. ``outside=300``.

    Returns:
        The scenario file, for `Scenario.load`.

    Raises:
        InputError: input that ``needlebench ct build`` rejects.
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
    """Plans needle paths to a lesion, with the robot: admissible directions, reasons for rejection, the best paths.

    Args:
        path: patient folder written by `build`, or a scenario file.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: further options of ``needlebench ct routes``, e.g. ``lesion="lower"``.

    Raises:
        InputError: input that ``needlebench ct routes`` rejects.
    """
    return command("ct", "routes", path, progress=progress, **options).data
