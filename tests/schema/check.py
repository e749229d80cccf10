"""Compares the reader of scenario and study files with an independent validator of their schemas.

    cargo run --release -p needlebench-programs-schema --bin schema_probes > probes.jsonl
    python tests/schema/check.py probes.jsonl

Without probes, only whether the schemas are schemas and every shipped file fits.

Each probe is a document at, inside or outside one limit that a schema states, with what the reader
said of it. The validator (jsonschema-rs) has to say the same, and every shipped file has to fit.
"""

import json
import sys
import tomllib
from collections import Counter
from functools import cache
from multiprocessing import Pool
from pathlib import Path

from jsonschema_rs import Draft7Validator, meta

ROOT = Path(__file__).parents[2]
SCHEMAS = {
    "scenario": ROOT / "scenarios/scenario.schema.json",
    "study": ROOT / "scenarios/studies/study.schema.json",
}
# Fewer probes than this and the comparison has lost its subject.
LEAST_PROBES = {"scenario": 2000, "study": 150}


@cache
def readers() -> dict[str, Draft7Validator]:
    """Validators of what the reader knows."""
    found: dict[str, Draft7Validator] = {}
    for kind, file in SCHEMAS.items():
        schema = json.loads(file.read_text())
        # Which engines there are is said to the reader when a file is resolved, not when it is read.
        del schema["definitions"]["EngineName"]["enum"]
        found[kind] = Draft7Validator(schema)
    return found


def judge(line: str) -> tuple[str, bool, str | None]:
    """Schema and validity of a probe, and what disagrees."""
    probe = json.loads(line)
    is_valid = readers()[probe["schema"]].is_valid(probe["document"])
    wrong = None
    if not is_valid == probe["is_read"] == probe["fits"]:
        wrong = (
            f"{probe['schema']} {probe['key']}: valid {is_valid}, read {probe['is_read']}, "
            f"meant to fit {probe['fits']}: {probe['document']}"
        )
    return probe["schema"], is_valid, wrong


def main() -> int:
    """Runs the comparison; the exit status is 1 if anything disagrees."""
    validators: dict[str, Draft7Validator] = {}
    for kind, file in SCHEMAS.items():
        schema = json.loads(file.read_text())
        meta.validate(schema)
        validators[kind] = Draft7Validator(schema)
    wrong: list[str] = []
    seen: Counter[tuple[str, bool]] = Counter()
    for file in map(Path, sys.argv[1:2]):
        with Pool() as pool, file.open() as lines:
            for kind, is_valid, disagreement in pool.imap(judge, lines, chunksize=200):
                seen[kind, is_valid] += 1
                if disagreement:
                    wrong.append(disagreement)
    for kind in SCHEMAS if sys.argv[1:] else ():
        count = seen[kind, True] + seen[kind, False]
        print(f"{kind}: {count} probes, of which {seen[kind, False]} are to be refused")
        if count < LEAST_PROBES[kind] or min(seen[kind, True], seen[kind, False]) < count // 10:
            wrong.append(f"{kind}: {seen} are too few probes")
    shipped = sorted((ROOT / "scenarios").rglob("*.toml"))
    for file in shipped:
        document = tomllib.loads(file.read_text())
        kind = "study" if "factors" in document else "scenario"
        wrong += [
            f"{file.relative_to(ROOT)}: {'.'.join(map(str, error.instance_path))}: {error.message}"
            for error in validators[kind].iter_errors(document)
        ]
    print(f"{len(shipped)} shipped files")
    print("\n".join(wrong[:40]))
    print(f"{len(wrong)} disagreements")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
