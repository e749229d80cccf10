"""Success rate and 5 % quantile of the clearance of each configuration, with DuckDB.

    python with_duckdb.py STUDY/results.parquet

The clearance is that of static cases; dynamic ones have clearance_attained_mm and, proven, clearance_mm.
The file may be results.csv as well. DuckDB reads it piece by piece: it may be larger than memory.
"""

import sys

import duckdb

QUERY = """
    SELECT configuration,
           avg(CASE WHEN outcome = 'ok' THEN 1 ELSE 0 END),
           quantile_cont(clearance_static_mm::DOUBLE, 0.05)
    FROM read_{kind}(?)
    GROUP BY configuration
    ORDER BY configuration
"""

file = sys.argv[1]
kind = "parquet" if file.endswith(".parquet") else "csv"
for configuration, success, clearance in duckdb.execute(QUERY.format(kind=kind), [file]).fetchall():
    print(f"{configuration:17} {success:7.2%} {clearance:9.3f} mm")
