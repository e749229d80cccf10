"""Progress of long work."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

Progress = Callable[[str, int, int], object]
"""Is called with the current activity, the number of completed steps and the total (0: unknown)."""


class Bar:
    """A line on standard error that is overwritten, in a terminal or notebook; log lines elsewhere."""

    def __init__(self) -> None:
        self._started = self._last = time.monotonic()
        self._length = 0
        stream = sys.stderr
        # Notebooks show carriage returns as terminals do, and have no terminal.
        self._is_live = stream.isatty() or type(stream).__module__.startswith("ipykernel")

    def __call__(self, message: str, done: int, total: int) -> None:
        """Shows the progress."""
        now = time.monotonic()
        elapsed = now - self._started
        # As the command line: no line for short work, and fewer lines the longer it takes.
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
        """Clears the line."""
        if self._is_live and self._length:
            sys.stderr.write("\r" + " " * self._length + "\r")
            sys.stderr.flush()
            self._length = 0


class Watching:
    """Reports progress: not at all, with a bar, or to a function of the caller."""

    def __init__(self, progress: bool | Progress | None) -> None:
        self._bar = Bar() if progress is True else None
        self._progress: Progress | None
        if callable(progress):
            self._progress = progress
        else:
            self._progress = self._bar

    def __enter__(self) -> Progress | None:
        """The function that receives the progress."""
        return self._progress

    def __exit__(self, *_: object) -> None:
        """Clears the bar."""
        if self._bar:
            self._bar.close()
