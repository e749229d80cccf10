"""Compares the reader of scenario and study files with an independent validator of their schemas.

    cargo run -p needlebench-cell --example schema_probes > probes.jsonl
    python tests/schema/check.py probes.jsonl

Each probe is a document at, inside or outside one limit that a schema states, with what the reader
said of it. The validator (jsonschema) has to say the same, and every shipped file has to fit.
"""

import copy
import json
import sys
import tomllib
from collections import Counter
from pathlib import Path

from jsonschema import Draft7Validator

ROOT = Path(__file__).parents[2]
SCHEMAS = {
    "scenario": ROOT / "scenarios/scenario.schema.json",
    "study": ROOT / "scenarios/studies/study.schema.json",
}
# Fewer probes than this and the comparison has lost its subject.
LEAST_PROBES = {"scenario": 2000, "study": 150}


def main() -> int:
    """Runs the comparison; the exit status is 1 if anything disagrees."""
    validators: dict[str, Draft7Validator] = {}
    readers: dict[str, Draft7Validator] = {}
    for kind, file in SCHEMAS.items():
        schema = json.loads(file.read_text())
        Draft7Validator.check_schema(schema)
        validators[kind] = Draft7Validator(schema)
        # Which engines there are is said to the reader when a file is resolved, not when it is read.
        nameless = copy.deepcopy(schema)
        del nameless["definitions"]["EngineName"]["enum"]
        readers[kind] = Draft7Validator(nameless)
    wrong: list[str] = []
    seen: Counter[tuple[str, bool]] = Counter()
    for line in Path(sys.argv[1]).read_text().splitlines():
        probe = json.loads(line)
        is_valid = readers[probe["schema"]].is_valid(probe["document"])
        seen[probe["schema"], is_valid] += 1
        if not is_valid == probe["is_read"] == probe["fits"]:
            wrong.append(
                f"{probe['schema']} {probe['key']}: valid {is_valid}, read {probe['is_read']}, "
                f"meant to fit {probe['fits']}: {probe['document']}"
            )
    for kind in SCHEMAS:
        count = seen[kind, True] + seen[kind, False]
        print(f"{kind}: {count} probes, of which {seen[kind, False]} are to be refused")
        if count < LEAST_PROBES[kind] or min(seen[kind, True], seen[kind, False]) < count // 10:
            wrong.append(f"{kind}: {seen} are too few probes")
    shipped = sorted((ROOT / "scenarios").rglob("*.toml"))
    for file in shipped:
        document = tomllib.loads(file.read_text())
        kind = "study" if "factors" in document else "scenario"
        wrong += [
            f"{file.relative_to(ROOT)}: {error.json_path}: {error.message}"
            for error in validators[kind].iter_errors(document)
        ]
    print(f"{len(shipped)} shipped files")
    print("\n".join(wrong[:40]))
    print(f"{len(wrong)} disagreements")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
