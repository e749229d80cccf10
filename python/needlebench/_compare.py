"""Two results side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from ._command import command
from ._errors import CriterionFailed

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


class Comparison:
    """What changed from one result to another."""

    def __init__(self, data: dict[str, Any], messages: str) -> None:
        self.data: dict[str, Any] = data
        """As ``needlebench compare --json`` prints it."""
        self._messages = messages

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``incomplete``."""
        return self.data["verdict"]

    @property
    def failures(self) -> list[Any]:
        """What was lost beyond what is allowed."""
        return self.data["failures"]

    def check(self) -> Comparison:
        """Itself if no more was lost than is allowed; raises `CriterionFailed` otherwise."""
        if self.verdict != "pass":
            lines = [_line(each) for each in [*self.failures, *self.data["incomplete"]]]
            raise CriterionFailed("\n".join([self.verdict, *lines]))
        return self

    def __repr__(self) -> str:
        return f"Comparison({self.verdict}: {len(self.failures)} failures)"


def _line(entry: Any) -> str:
    """One thing that was lost, in words."""
    if not isinstance(entry, dict):
        return str(entry)
    known = cast("dict[str, Any]", entry)
    place = " ".join(str(known[key]) for key in ("goal", "label") if known.get(key))
    return f"{place}: {known['detail']}" if known.get("detail") else f"{place}: {known}"


def compare(
    a: str | os.PathLike[str],
    b: str | os.PathLike[str],
    *,
    max_loss: Mapping[str, str | float] | None = None,
    **options: Any,
) -> Comparison:
    """Compares two results: folders of runs or studies, reports, or scenarios, which are run.

    Args:
        a: the former one.
        b: the later one.
        max_loss: by how much a metric may get worse, with its unit: ``{"clearance": "0.5mm"}``.
        options: further options of ``needlebench compare``.

    Raises:
        InputError: what ``needlebench compare`` refuses.
    """
    losses = [f"{metric}={value}" for metric, value in (max_loss or {}).items()]
    answer = command("compare", a, b, max_loss=losses, **options)
    return Comparison(answer.data, answer.messages)
