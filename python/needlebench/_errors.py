"""Errors, with one class for each exit status of the command line."""

from __future__ import annotations

from typing import Any, NamedTuple


class Finding(NamedTuple):
    """One error in an input."""

    file: str
    """File, option or argument."""
    line: int | None
    """Line, from 1, if known."""
    key: str | None
    """Key or element, e.g. ``goals[0].standoff_mm``."""
    message: str
    """Description of the error, with value and unit."""
    hint: str | None
    """How to fix it."""


class NeedlebenchError(Exception):
    """Base class of the errors of needlebench."""

    status: int = 3
    """Exit status of the command line."""


class CriterionFailed(NeedlebenchError):
    """A criterion failed, or was not evaluated. Raised on request only: ``result.check()``."""

    status = 1


class InputError(NeedlebenchError, ValueError):
    """The input is invalid. The text is that of the command line, with lines and hints."""

    status = 2

    findings: list[Finding]
    """The same as values; empty if an option itself is invalid."""

    def __init__(self, text: str, findings: list[dict[str, Any]] | None = None) -> None:
        super().__init__(text)
        self.findings = [Finding(**each) for each in findings or []]


class EnvironmentFailed(NeedlebenchError, RuntimeError):
    """The environment or an engine failed. Completed results are in ``result``."""

    status = 3

    result: Any
    """Completed results, or ``None``."""

    def __init__(self, text: str, result: Any = None) -> None:
        super().__init__(text)
        self.result = result


class Interrupted(KeyboardInterrupt):
    """Interrupted. Completed results are in ``result``."""

    status = 130

    result: Any
    """Completed results, or ``None``."""

    def __init__(self, text: str = "", result: Any = None) -> None:
        super().__init__(text)
        self.result = result
