"""Success rate and 5 % quantile of the clearance of each configuration, with Polars.

    python with_polars.py STUDY/results.parquet

The clearance is that of static cases; dynamic ones have clearance_attained_mm and, proven, clearance_mm.
The file may be results.csv as well. Only the columns that are used are read.
"""

import sys

import polars as pl

file = sys.argv[1]
rows = pl.scan_parquet(file) if file.endswith(".parquet") else pl.scan_csv(file)
table = (
    rows.group_by("configuration")
    .agg(
        success=(pl.col("outcome") == "ok").mean(),
        clearance=pl.col("clearance_static_mm").cast(pl.Float64).quantile(0.05, "linear"),
    )
    .sort("configuration")
    .collect()
)
for configuration, success, clearance in table.iter_rows():
    print(f"{configuration:17} {success:7.2%} {clearance:9.3f} mm")
