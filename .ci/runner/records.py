"""What is known of earlier runs: records of evidence, which are committed, and stamps of this machine.

A record is a line of `.ci/evidence.lock`: the check, the hash of all that it depended on, figures, date, machine,
seconds.
It is written when the check passes, and by nobody else: a line that was edited by hand does not fit its seal.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from . import tree
from .checks import Check, target_folder
from .tree import TOP

LOCK = TOP / ".ci/evidence.lock"
HEAD = "# Written by .ci/run when a check of evidence passes. Not to be edited: each line has a seal.\n"


@dataclass(frozen=True)
class Record:
    """A check that passed."""

    check: str
    inputs_sha256: str
    date: str
    machine: str
    seconds: float
    # Whether it was seen to open nothing beyond its inputs.
    traced: bool
    figures: dict[str, float]
    # What is not to grow, as it was seen; the least of each that was ever on record; and why one grew.
    marks: dict[str, float]
    bars: dict[str, float]
    because: str
    groups: dict[str, str]
    seal: str = ""

    def sealed(self) -> str:
        told = {**asdict(self), "seal": ""}
        return tree.digest(json.dumps(told, sort_keys=True).encode())[:16]

    def line(self) -> str:
        told = {**asdict(self), "seal": self.sealed()}
        return json.dumps(told, ensure_ascii=False) + "\n"


class EditedError(Exception):
    """A line of the lock file is not as it was written."""


def read() -> dict[str, Record | EditedError]:
    """By name of the check."""
    found: dict[str, Record | EditedError] = {}
    if not LOCK.exists():
        return found
    for number, line in enumerate(LOCK.read_text().splitlines(), start=1):
        if not line or line.startswith("#"):
            continue
        try:
            told = json.loads(line)
            record = Record(**told)
        except (ValueError, TypeError) as error:
            raise tree.MistakeError(f"{LOCK.relative_to(TOP)}:{number}: {error}") from None
        fits = record.seal == record.sealed()
        found[record.check] = (
            record if fits else EditedError(f"its record ({LOCK.relative_to(TOP)}:{number}) was edited by hand")
        )
    return found


def write(new: dict[str, Record], known: set[str]) -> None:
    """Adds records; those of checks that are gone leave."""
    kept = {}
    for line in LOCK.read_text().splitlines(keepends=True) if LOCK.exists() else []:
        if line.startswith("{"):
            kept[json.loads(line)["check"]] = line
    kept |= {name: record.line() for name, record in new.items()}
    partial = LOCK.with_suffix(".partial")
    partial.write_text(HEAD + "".join(line for name, line in sorted(kept.items()) if name in known))
    partial.replace(LOCK)


def stamp_file(check: Check):
    return target_folder() / "ci/stamps" / f"{check.name}.json"


def stamp(check: Check, seconds: float) -> None:
    """Remembers that a check passed on these inputs, on this machine."""
    path = stamp_file(check)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        json.dumps({"inputs_sha256": check.digest, "seconds": round(seconds, 1), "groups": check.group_digests()})
    )


def stamped(check: Check) -> dict | None:
    try:
        return json.loads(stamp_file(check).read_text())
    except (OSError, ValueError):
        return None


def changed(check: Check, groups: dict[str, str]) -> str:
    """Where the inputs differ from those of a record, in words."""
    now = check.group_digests()
    names = [name for name in now if groups.get(name) != now[name]]
    names += [f"{name} (no longer an input)" for name in groups if name not in now]
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return f"changed: {shown}" if names else "changed"


def state(check: Check, records: dict[str, Record | EditedError]) -> tuple[bool, str]:
    """Whether a check holds at this tree, and why, or why not."""
    if check.tier == "evidence":
        record = records.get(check.name)
        if record is None:
            return False, "has no record"
        if isinstance(record, EditedError):
            return False, str(record)
        if record.inputs_sha256 == check.digest:
            return True, f"recorded {record.date}, {record.seconds:.0f} s"
        return False, changed(check, record.groups)
    known = stamped(check)
    if known is None:
        return False, "has not run here"
    if known["inputs_sha256"] == check.digest:
        return True, f"ran here, {known['seconds']:.0f} s"
    return False, changed(check, known["groups"])
