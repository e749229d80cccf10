"""Figures of a run with `--reference`: how far its engines are from the third integrator, and of which order they are.

    python3 tests/validation/referee.py REPORT_JSON

Says them as the records of the checks have them; fails where there are none, or where an engine is not of first order.
"""

import json
import sys
from pathlib import Path

# Rate at which the difference falls with the time step: semi-implicit Euler's 1, and what the next order adds.
ORDER = (0.9, 1.15)


def main() -> None:
    report = json.loads(Path(sys.argv[1]).read_text())
    found = [
        each
        for goal in report["goals"]
        for configuration in goal["configurations"]
        for each in (configuration.get("referee") or {}).values()
    ]
    if not found:
        sys.exit("the report has nothing of a referee")
    torques = [each["held_torques"] for each in found if each["held_torques"]]
    held = max(each["peak_tip_m"] for each in torques)
    closed = max(each["closed_loop"]["peak_tip_m"] for each in found)
    print(f"figure motions {len(found)}")
    print(f"figure held_um {held * 1e6:.4f}")
    print(f"figure closed_um {closed * 1e6:.4f}")
    orders = [each["order"] for each in torques if each["order"] is not None]
    print(f"figure order {max(orders):.3f}\nfigure lowest_order {min(orders):.3f}")
    if not ORDER[0] < min(orders) <= max(orders) < ORDER[1]:
        sys.exit(f"the engines are of order {min(orders):.3f} to {max(orders):.3f}, documented is 1")


if __name__ == "__main__":
    main()
