"""Comparison of two results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from ._command import command
from ._errors import CriterionFailed

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


class Comparison:
    """The comparison of two results."""

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
        """Regressions beyond the thresholds."""
        return self.data["failures"]

    def check(self) -> Comparison:
        """Returns itself if there is no regression beyond the thresholds; raises `CriterionFailed` otherwise."""
        if self.verdict != "pass":
            lines = [_line(each) for each in [*self.failures, *self.data["incomplete"]]]
            raise CriterionFailed("\n".join([self.verdict, *lines]))
        return self

    def __repr__(self) -> str:
        return f"Comparison({self.verdict}: {len(self.failures)} failures)"


def _line(entry: Any) -> str:
    """The text of one regression."""
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
        a: the first result.
        b: the second result.
        max_loss: largest permitted loss of a metric, with its unit: ``{"clearance": "0.5mm"}``.
        options: further options of ``needlebench compare``.

    Raises:
        InputError: input that ``needlebench compare`` rejects.
    """
    losses = [f"{metric}={value}" for metric, value in (max_loss or {}).items()]
    answer = command("compare", a, b, max_loss=losses, **options)
    return Comparison(answer.data, answer.messages)
