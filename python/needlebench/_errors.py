"""What is wrong, one class for each exit status of the command line."""

from __future__ import annotations

from typing import Any, NamedTuple


class Finding(NamedTuple):
    """One thing that is wrong with an input."""

    file: str
    """File, option or argument."""
    line: int | None
    """Line, from 1, where it is known."""
    key: str | None
    """Key or element, such as ``goals[0].standoff_mm``."""
    message: str
    """What is wrong, with value and unit."""
    hint: str | None
    """How to mend it."""


class NeedlebenchError(Exception):
    """Anything that needlebench could not do."""

    status: int = 3
    """Exit status that the command line would end with."""


class CriterionFailed(NeedlebenchError):
    """A criterion was not met, or could not be judged. Raised on request only: ``result.check()``."""

    status = 1


class InputError(NeedlebenchError, ValueError):
    """The input is wrong. The text is what the command line prints, with lines and hints."""

    status = 2

    findings: list[Finding]
    """The same as values; empty where an option itself is wrong."""

    def __init__(self, text: str, findings: list[dict[str, Any]] | None = None) -> None:
        super().__init__(text)
        self.findings = [Finding(**each) for each in findings or []]


class EnvironmentFailed(NeedlebenchError, RuntimeError):
    """The environment or an engine failed. What was finished until then is in ``result``."""

    status = 3

    result: Any
    """What there is all the same, or ``None``."""

    def __init__(self, text: str, result: Any = None) -> None:
        super().__init__(text)
        self.result = result


class Interrupted(KeyboardInterrupt):
    """Interrupted. What was finished until then is in ``result``."""

    status = 130

    result: Any
    """What there is all the same, or ``None``."""

    def __init__(self, text: str = "", result: Any = None) -> None:
        super().__init__(text)
        self.result = result
