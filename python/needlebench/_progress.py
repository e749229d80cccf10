"""Progress for people who watch."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

Progress = Callable[[str, int, int], object]
"""Is called with what is being done, how many steps are done, and how many there are (0: unknown)."""


class Bar:
    """A line on standard error that is written over, in a terminal as in a notebook; lines of a log elsewhere."""

    def __init__(self) -> None:
        self._started = self._last = time.monotonic()
        self._length = 0
        stream = sys.stderr
        # Notebooks show carriage returns as terminals do, and have no terminal.
        self._is_live = stream.isatty() or type(stream).__module__.startswith("ipykernel")

    def __call__(self, message: str, done: int, total: int) -> None:
        """Shows how far the work is."""
        now = time.monotonic()
        elapsed = now - self._started
        # As the command line: no line for what is short, and rarer ones the longer it takes.
        least = 0.1 if self._is_live else max(1.0, 0.05 * elapsed)
        if now - self._last < least:
            return
        self._last = now
        count = f" {done} of {total}" if total else ""
        line = f"[{elapsed:.0f} s] {message}{count}"
        if self._is_live:
            padding = " " * max(0, self._length - len(line))
            self._length = len(line)
            sys.stderr.write(f"\r{line}{padding}")
        else:
            sys.stderr.write(f"{line}\n")
        sys.stderr.flush()

    def close(self) -> None:
        """Wipes the line."""
        if self._is_live and self._length:
            sys.stderr.write("\r" + " " * self._length + "\r")
            sys.stderr.flush()
            self._length = 0


class Watching:
    """Watches some work: silently, with a bar, or with a function of the caller's."""

    def __init__(self, progress: bool | Progress | None) -> None:
        self._bar = Bar() if progress is True else None
        self._progress: Progress | None
        if callable(progress):
            self._progress = progress
        else:
            self._progress = self._bar

    def __enter__(self) -> Progress | None:
        """What is told how far the work is."""
        return self._progress

    def __exit__(self, *_: object) -> None:
        """Wipes the bar."""
        if self._bar:
            self._bar.close()
