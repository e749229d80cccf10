"""What a table says about itself: the study, where it comes from, and what each column is.

    python metadata.py STUDY/results.parquet
"""

import json
import sys

import pyarrow.parquet as pq

schema = pq.read_schema(sys.argv[1])
texts = {key.decode(): value.decode() for key, value in schema.metadata.items()}
print("study", texts["needlebench.study_name"], texts["needlebench.study_id"])
print(json.dumps(json.loads(texts["needlebench.provenance"]), indent=2, ensure_ascii=False))
descriptions = json.loads(texts["needlebench.columns"])
for field in schema:
    print(f"{field.name:30} {field.type!s:8} {descriptions[field.name]}")
