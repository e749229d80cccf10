"""Commands of the command line, in this process."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import CriterionFailed, EnvironmentFailed, InputError, Interrupted
from ._progress import Watching

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ._progress import Progress

    Option = bool | int | float | str | os.PathLike[str] | Iterable[int | float | str | os.PathLike[str]] | None


class Answer:
    """Answer of a command."""

    def __init__(self, status: int, output: str, messages: str) -> None:
        self.status = status
        """Exit status: 0, or 1 if a criterion failed or was not evaluated."""
        self.output = output
        """Text that the command line prints to standard output."""
        self.messages = messages
        """Text that it prints to standard error."""
        self._data: Any = None

    @property
    def data(self) -> Any:
        """The printed JSON document, SI units."""
        if self._data is None:
            self._data = json.loads(self.output)
        return self._data

    def check(self) -> Answer:
        """Returns itself if all criteria are met; raises `CriterionFailed` otherwise."""
        if self.status:
            raise CriterionFailed(self.messages or self.output)
        return self

    def __repr__(self) -> str:
        return f"Answer(status={self.status}, {len(self.output)} characters)"


def option_words(options: dict[str, Option]) -> list[str]:
    """Converts keyword options to command-line options: ``no_page=True`` is ``--no-page``, a list is repeated."""
    arguments: list[str] = []
    for name, value in options.items():
        option = f"--{name.rstrip('_').replace('_', '-')}"
        if value is None or value is False:
            continue
        if value is True:
            arguments.append(option)
        elif isinstance(value, (str, int, float, os.PathLike)):
            arguments += [f"{option}={_text(value)}"]
        else:
            arguments += [f"{option}={_text(each)}" for each in value]
    return arguments


def _text(value: int | float | str | os.PathLike[str]) -> str:
    return (
        repr(value) if isinstance(value, float) else os.fspath(value) if isinstance(value, os.PathLike) else str(value)
    )


def command(
    *arguments: str | os.PathLike[str],
    json: bool = True,
    progress: bool | Progress | None = None,
    **options: Option,
) -> Answer:
    """Runs any command of the command line in this process.

    ``nb.command("suggest", "my.toml", lesion="left_upper_lobe")`` runs
    ``needlebench suggest my.toml --lesion=left_upper_lobe --json``.

    Args:
        arguments: the command and its positional arguments.
        json: request the JSON document for `Answer.data`; ``False`` for commands without JSON.
        progress: ``True`` shows a bar; a function is called with message, done and total.
        options: options by their names with underscores; ``True`` for flags, lists for repeatable options.

    Raises:
        InputError: exit status 2.
        EnvironmentFailed: exit status 3.
        Interrupted: exit status 130.
    """
    every = [os.fspath(each) for each in arguments] + option_words(options)
    if json:
        every.append("--json")
    with Watching(progress) as watch:
        status, output, messages, findings, interrupted = _native.invoke(every, watch)
    answer = Answer(status, output, messages)
    if interrupted is not None:
        raise with_result(interrupted, answer)
    if status == InputError.status:
        # The JSON document may contain the errors, without messages.
        raise InputError(messages.strip() or output.strip(), findings)
    if status == EnvironmentFailed.status:
        raise EnvironmentFailed(messages.strip(), answer if output else None)
    return answer


def with_result(raised: BaseException, result: Any) -> BaseException:
    """A signal with completed results; exceptions of callbacks unchanged."""
    if isinstance(raised, KeyboardInterrupt):
        said = result.messages.strip() if isinstance(result, Answer) else ""
        return Interrupted(said, result)
    return raised
