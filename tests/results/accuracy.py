"""Whether every cell of an accuracy table is what DuckDB makes of the study's Parquet table.

    python accuracy.py target/release/needlebench

Columns, groups, needles and tests are written down here anew, from the documentation. Prints what differs.
"""

import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import duckdb
import pandas as pd

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "imperfect.toml"
# The table keeps 24 bits of each number, which both sides read alike; what is left are sums in another order.
ROUNDING = 1e-9
# Column of the table: unit, and columns of the study, of which the first that a row has counts.
QUANTITIES = {
    "entry_target_length": ("mm", ["entry_target_length_mm"]),
    "entry_nd": ("mm", [f"entry_lateral_error{end}_mm" for end in ("", "_predicted", "_static")]),
    "entry_ed": ("mm", [f"entry_error{end}_mm" for end in ("", "_predicted", "_static")]),
    "target_nd": ("mm", [f"lateral_error{end}_mm" for end in ("", "_predicted", "_static")]),
    "target_ed": ("mm", [f"tip_error{end}_mm" for end in ("", "_predicted", "_static")]),
    "angle": ("deg", [f"needle_angle_error{end}_deg" for end in ("", "_predicted", "_static")]),
    "angle_axial": ("deg", [f"needle_angle_axial{end}_deg" for end in ("", "_predicted", "_static")]),
    "angle_sagittal": ("deg", [f"needle_angle_sagittal{end}_deg" for end in ("", "_predicted", "_static")]),
    "depth_error": ("mm", [f"depth_error{end}_mm" for end in ("", "_predicted", "_static")]),
    "duration": ("s", ["motion_time_s"]),
}
# Needles of a table as a condition on rows. Of static cases the best is the one with the largest clearance of those
# that are ok, the first of equal ones.
NEEDLES = {
    "every": "WHERE outcome IN ('ok', 'failed')",
    "Right-Up-Fold": "WHERE outcome IN ('ok', 'failed') AND configuration = 'Right-Up-Fold'",
    "best": """WHERE outcome = 'ok' AND clearance_static_mm IS NOT NULL QUALIFY 1 = row_number() OVER (
        PARTITION BY "case" ORDER BY clearance_static_mm DESC, file_row_number)""",
}
STUDIES = {
    "static": ('mode = "static"', 12, [("best", "goal"), ("every", "goal"), ("every", "configuration"), ("best", "side")]),
    "dynamic": ('mode = "dynamic"\nengines = ["rapier"]', 1, [("Right-Up-Fold", "goal"), ("every", "side")]),
}
HIT_RADIUS_MM = 1.7


def study(name: str, mode: str, draws: int) -> str:
    return f"""name = "{name}"
scenario = "{SCENARIO.as_posix()}"
replanned_cases = 0
{mode}
[[factors]]
name = "draw"
key = "seed"
grid = {{ from = 1, to = {draws + 1}, steps = {draws + 1} }}
[[factors]]
name = "side"
key = "phantom.position_mm[0]"
relative = true
values = [0, 5]
"""


def friedman(rows: pd.DataFrame, by: str, value: str) -> float | None:
    """p of two groups that share their draws; one value for each draw and group."""
    table = rows.pivot_table(index="draw", columns=by, values=value, aggfunc="mean").dropna()
    if len(table) < 10 or len(table.columns) < 2:
        return None
    ranks = table.rank(axis=1)
    blocks, groups = table.shape
    if groups != 2:
        return None
    statistic = 12 / (blocks * groups * (groups + 1)) * (ranks.sum() ** 2).sum() - 3 * blocks * (groups + 1)
    return math.erfc(math.sqrt(max(statistic, 0.0) / 2))


def differing(name: str, table: Path, found: Path, needles: str, by: str) -> list[str]:
    wrong = []
    with found.open(newline="") as file:
        cells = {row["group"]: row for row in csv.DictReader(file)}
    schema = duckdb.execute("SELECT * FROM read_parquet(?) LIMIT 0", [str(table)]).description or []
    known = {column[0] for column in schema}
    values = []
    for key, (_, columns) in QUANTITIES.items():
        present = [f"{column}::DOUBLE" for column in columns if column in known]
        values.append(f"coalesce({', '.join([*present, 'NULL::DOUBLE'])}) AS {key}")
    query = f"""
        SELECT "case", configuration, goal, draw, side::VARCHAR AS side, {", ".join(values)}
        FROM read_parquet(?, file_row_number = true) {NEEDLES[needles]}
    """
    rows = duckdb.execute(query, [str(table)]).df()

    def check(what: str, expected: float | None, text: str) -> None:
        if expected is None or math.isnan(expected):
            same = text == ""
        else:
            same = text != "" and abs(float(text) - expected) <= ROUNDING * max(1.0, abs(expected))
        if not same:
            wrong.append(f"{name}, {needles} by {by}, {what}: the table has `{text}`, DuckDB {expected}")

    labels = [str(label) for label in rows[by].unique()]
    groups = {label: rows[rows[by].astype(str) == label] for label in labels} | {"all": rows}
    # Numbers as labels may be written otherwise.
    by_number = {float(label): label for label in cells if by == "side" and label != "all"}
    for label, members in groups.items():
        row = cells[by_number[float(label)] if by == "side" and label != "all" else label]
        duckdb.register("members", members)
        check(f"{label} n", len(members), row["n"])
        for key, (unit, _) in QUANTITIES.items():
            count, mean, sd, least, most = duckdb.execute(
                f"SELECT count({key}), avg({key}), stddev_samp({key}), min({key}), max({key}) FROM members"
            ).fetchall()[0]
            check(f"{label} {key}_n", count, row[f"{key}_n"])
            for figure, expected in (("mean", mean), ("sd", sd), ("min", least), ("max", most)):
                check(f"{label} {key} {figure}", expected, row[f"{key}_{figure}_{unit}"])
        within, of = duckdb.execute(
            f"SELECT count(*) FILTER (target_ed <= {HIT_RADIUS_MM}), count(target_ed) FROM members"
        ).fetchall()[0]
        check(f"{label} hits", within, row["hits"])
        check(f"{label} hits_of", of, row["hits_of"])
    if len(cells) != len(groups):
        wrong.append(f"{name}, {needles} by {by}: {len(cells)} rows in the table, {len(groups)} groups in DuckDB")
    if len(labels) == 2:
        for key in QUANTITIES:
            if key == "entry_target_length":
                continue
            expected = friedman(rows, by, key) if rows[key].notna().any() else None
            check(f"{key}_p", expected, cells["all"][f"{key}_p"])
    return wrong


def failures(program: Path) -> list[str]:
    """What differs."""
    wrong = []
    compared = 0
    for name, (mode, draws, tables) in STUDIES.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "study.toml")
            file.write_text(study(name, mode, draws))
            for needles, by in tables:
                command = [program, "study", file, "--out", folder, "--yes", "--quiet", "--no-page", "--resume"]
                command += ["--table", "accuracy", "--of", needles, "--by", by, "--hit-radius", str(HIT_RADIUS_MM)]
                subprocess.run(command, check=True, capture_output=True)
                results = Path(folder, name)
                wrong += differing(name, results / "results.parquet", results / "accuracy.csv", needles, by)
                compared += 1
    print(f"{compared} accuracy tables compared with DuckDB, {len(wrong)} cells differ")
    return wrong


if __name__ == "__main__":
    sys.exit("\n".join(failures(Path(sys.argv[1]).resolve())) or None)
