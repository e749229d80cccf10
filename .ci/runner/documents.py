"""Figures of the evidence in README and guide.

`<!-- coal.apart_nm .1f -->2.4<!-- -->` in a document is the figure `apart_nm` in the record of the check `coal`, with
that format. `.ci/run --figures` writes them, and a check fails where one is not what is on record.
"""

from __future__ import annotations

import re
import sys

from . import records
from .tree import FIGURE, TOP, MistakeError

DOCUMENTS = ("README.md", "guide/src/trust.md", "tests/validation/README.md")


def written(value: float, form: str) -> str:
    """The figure as Python's format has it; `e` without the zeros that it puts before an exponent."""
    text = format(value, form)
    return re.sub(r"e([-+])0*(\d)", lambda match: f"e{match[1].strip('+')}{match[2]}", text)


def update(*, look_only: bool) -> int:
    known = records.read()
    edited = [f"{name}: {record}" for name, record in known.items() if isinstance(record, records.EditedError)]
    if edited:
        raise MistakeError("; ".join(edited))
    stale = []
    for name in DOCUMENTS:
        path = TOP / name
        before = path.read_text()

        def figure(match: re.Match[str], name: str = name) -> str:
            check, key, form, shown = match.groups()
            record = known.get(check)
            if not isinstance(record, records.Record) or key not in record.figures:
                raise MistakeError(f"{name}: no record has the figure `{check}.{key}`")
            text = written(record.figures[key], form)
            if text != shown:
                stale.append(f"{name}: {check}.{key} is {text} on record, {shown} there")
            return f"<!-- {check}.{key} {form} -->{text}<!-- -->"

        after = FIGURE.sub(figure, before)
        if after != before and not look_only:
            path.write_text(after)
    for each in stale:
        print(each if not look_only else f"error: {each}", file=sys.stderr)
    if look_only and stale:
        print("run .ci/run --figures", file=sys.stderr)
        return 1
    return 0
