"""Success rate and 5 % quantile of the clearance of each configuration, with pandas and pyarrow.

    python with_pandas.py STUDY/results.parquet

The clearance is that of static cases; dynamic ones have clearance_attained_mm and, proven, clearance_mm.
The file may be results.csv as well. The columns that are used must fit into memory.
"""

import sys

import pandas as pd

file = sys.argv[1]
columns = ["configuration", "outcome", "clearance_static_mm"]
if file.endswith(".parquet"):
    rows = pd.read_parquet(file, columns=columns)
else:
    rows = pd.read_csv(file, usecols=columns)
rows["ok"] = rows["outcome"] == "ok"
rows["clearance_static_mm"] = rows["clearance_static_mm"].astype("float64")
groups = rows.groupby("configuration")
table = pd.DataFrame({"success": groups["ok"].mean(), "clearance": groups["clearance_static_mm"].quantile(0.05)})
for configuration, (success, clearance) in table.iterrows():
    print(f"{configuration:17} {success:7.2%} {clearance:9.3f} mm")
