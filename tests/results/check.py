"""Whether others read a study's tables as they were meant.

    cargo build --release -p needlebench-programs-study
    cargo build --release -p needlebench
    python3 -m venv env && env/bin/pip install -r tests/results/requirements.txt
    env/bin/python tests/results/check.py --maker target/release/synthetic \\
        --program target/release/needlebench

Makes the tables of a study without physics, runs the examples beside this file on both, and compares
every cell of `results.csv` with `results.parquet`. With the program it also makes small studies of an imperfect
arm and compares every cell of their accuracy tables with what DuckDB makes of the Parquet tables
(`accuracy.py`). Exit status 1 where anything differs.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import accuracy
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

HERE = Path(__file__).parent
EXAMPLES = ["with_duckdb.py", "with_polars.py", "with_pandas.py"]
# Several row groups, the last of them not full.
CASES = 20_000
CONFIGURATIONS = 8


def printed(example: str, file: Path) -> str:
    command = [sys.executable, HERE / example, file]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def differing_columns(parquet: Path, csv: Path) -> list[str]:
    """Columns of which a cell differs in any bit."""
    expected = pq.read_table(parquet)
    options = pa.csv.ConvertOptions(
        column_types={field.name: field.type for field in expected.schema}, strings_can_be_null=False
    )
    found = pa.csv.read_csv(csv, convert_options=options)
    if found.column_names != expected.column_names:
        return ["names or order of the columns"]
    names = expected.column_names
    return [name for name in names if found[name].to_pylist() != expected[name].to_pylist()]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--maker", type=Path, required=True)
    parser.add_argument("--program", type=Path)
    arguments = parser.parse_args()
    maker = arguments.maker.resolve()
    failures = accuracy.failures(arguments.program.resolve()) if arguments.program else []
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([maker, folder, str(CASES), "2", "0", "csv"], check=True)
        tables = [Path(folder, name) for name in ("results.parquet", "results.csv")]
        answers = {(example, table.name): printed(example, table) for example in EXAMPLES for table in tables}
        first = next(iter(answers.values()))
        print(first, end="")
        if len(first.splitlines()) != CONFIGURATIONS:
            failures.append(f"not {CONFIGURATIONS} configurations")
        for (example, table), answer in answers.items():
            if answer != first:
                failures.append(f"{example} prints something else of {table}:\n{answer}")
        failures += [f"{column}: CSV and Parquet differ" for column in differing_columns(*tables)]
        described = printed("metadata.py", tables[0]).splitlines()
        rows = pq.read_metadata(tables[0])
        if rows.num_rows != CASES * CONFIGURATIONS:
            failures.append(f"{rows.num_rows} rows")
        if len(described) < rows.num_columns:
            failures.append("columns without a description")
    sys.exit("\n".join(failures) or None)


if __name__ == "__main__":
    main()
