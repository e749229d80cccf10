"""Needles in tissue: error budgets of scenarios that differ in needle, bevel, guide, tissue and depth.

`tissue.py --program PROGRAM` writes each scenario, runs it, and compares as `compare.py` does what the needle is part
of, in one configuration of each goal. Then it changes the model that is compared with, and each change has to be found
in a scenario. Exits with 1 where bias or covariance differ by more than is allowed, or where a change is not found.
"""

import argparse
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import bending
import sources
from compare import BEND_TIMES_AS_MANY, DRAWS, compare, printed
from model import read_toml

SCENARIO = """
name = "{name}"
seed = 1

[robot]
urdf = "ur3"
base_position_mm = [-280, 350, 1050]
base_rpy_deg = [0, 0, 270]

[tool]
urdf = "perpendicular"
needle_length_mm = 260
needle_gauge = {gauge}

[phantom]
model = "{phantom}"

[table]
center_mm = [-300, 0]
top_height_mm = 780

# No motion is needed: the needle is rejected before any is planned.
[planning.needle_route]
bone_mm = 50
{goals}
[imperfections]
budget_samples = 400

[imperfections.calibration]

[imperfections.registration]

[imperfections.imaging]

[imperfections.indentation]

[imperfections.breathing]
{breath}

[imperfections.needle]
{needle}
{more}
"""
GOAL = """
[[goals]]
name = "{name}"
lesion = "{lesion}"
entry_direction_deg = {direction}
target_offset_mm = {offset}
standoff_mm = {standoff}
"""
# Lesion, direction of the entry, offset of the target, stand-off: 44 to 120 mm deep.
GOALS = {
    "shallow": ("pleural_based", [-75, -15], [-9, 0, -2], 15),
    "lateral": ("pleural_based", [-75, -15], [0, 0, 0], 25),
    "middle": ("right_upper_lobe", [-50, 0], [0, 0, 0], 10),
    "deep": ("right_lower_lobe", [-30, 0], [0, 0, 0], 15),
}


@dataclass(frozen=True)
class Variant:
    """A scenario, by what it has of its own."""

    name: str
    gauge: int
    needle: str
    goals: list[str]
    more: str = "[imperfections.guide]"
    phantom: str = "male-p50-supine"
    breath: str = "hold_failure = 0"

    def written(self) -> str:
        goals = ""
        for name in self.goals:
            lesion, direction, offset, standoff = GOALS[name]
            goals += GOAL.format(name=name, lesion=lesion, direction=direction, offset=offset, standoff=standoff)
        return SCENARIO.format(
            name=self.name,
            gauge=self.gauge,
            phantom=self.phantom,
            goals=goals,
            needle=self.needle,
            more=self.more,
            breath=self.breath,
        )


DRAWS_OF_CHANGES = 4_000
TISSUE = 'model = "tissue"\n'
# Stiff tissue, and a force that is known: what the power of the stiffness does to it is the largest part.
STIFF = """
[imperfections.needle.stiffness]
fat_kn_m2 = 12
wall_kn_m2 = 60
lung_kn_m2 = 5
lesion_kn_m2 = 60

[imperfections.needle.forces]
wall_spread = 1.1

[imperfections.guide]
diametral_clearance_mm = 0.3
"""
# A guide that fits.
FITS = """
[imperfections.guide]
diametral_clearance_mm = 0
"""
# A breath that is held for long and long after the image, with keys of its own and usual ones.
LEVEL = """
since_image_s = 90
level_at_once = 0.1
held_s = 15
skin_drift_mm_s = [0, 0.05, 0]
"""
VARIANTS = [
    Variant("known", 18, TISSUE + 'bevel = "superior"', ["shallow", "deep"]),
    Variant("unknown", 20, TISSUE, ["middle"]),
    Variant("thin", 22, TISSUE + 'bevel = "4:30"\nbevel_spread_deg = 25\nbevel_deg = 40', ["lateral", "deep"]),
    Variant("symmetric", 18, TISSUE + 'tip = "symmetric"', ["lateral"]),
    Variant("rolled", 22, TISSUE + 'tip = "rolled"\nbore_mm = 0.413', ["middle"]),
    Variant("turned", 20, TISSUE + 'bevel = "left"\nturn_at_mm = 30', ["middle"], phantom="female-p5-supine"),
    Variant("fits", 22, TISSUE + 'bevel = "3:00"', ["lateral"], more=FITS, phantom="female-p5-supine"),
    Variant("stiff", 18, TISSUE + 'bevel = "posterior"', ["deep"], more=STIFF, phantom="female-p5-supine"),
    Variant("aimed", 20, TISSUE + 'bevel = "3:00"\naim = true', ["lateral", "deep"]),
    Variant("best", 22, TISSUE + 'bevel = "9:00"\nturn_at = "best"\naim = true', ["deep"]),
    Variant("in_air", 18, 'model = "cantilever"', ["lateral"]),
    Variant("level", 18, 'model = "cantilever"', ["lateral"], breath=LEVEL),
]


@dataclass
class Compared:
    """What was found of a scenario."""

    variant: Variant
    failures: list[str]
    worst: dict[str, list[float]] = field(default_factory=dict)
    radii: list[tuple[float, float]] = field(default_factory=list)
    count: int = 0


def of(variant: Variant, folder: Path, draws: int = DRAWS) -> Compared:
    """Compares the results that a folder has of a scenario."""
    scenario = read_toml(folder / f"{variant.name}.toml")
    results = folder / variant.name
    report = json.loads((results / "report.json").read_text())
    return Compared(variant, *compare(scenario, report, results, draws, of_needle=True))


def ran(program: str, folder: Path, variant: Variant) -> Compared:
    """Runs a scenario, and compares."""
    file = folder / f"{variant.name}.toml"
    file.write_text(variant.written())
    options = ["--engine", "rapier", "--no-pictures", "--no-page", "--quiet", "--jobs", "1", "--out", folder]
    # Fails by criteria that say nothing here.
    done = subprocess.run([program, "run", file, *options], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        return Compared(variant, [done.stderr])
    found = of(variant, folder)
    if found.count != len(variant.goals):
        found.failures.append(f"{found.count} of {len(variant.goals)} goals were compared")
    return found


ONCE = sources.needle_in_tissue


def play_twice(case, block, random, truth) -> None:
    """The needle in tissue, and the play of the guide once more beside it."""
    ONCE(case, block, random, truth)
    sources.guide(case, sources.defaults("GuideBlock", case.blocks["guide"]), random, truth)


# What is changed, and the scenario that has to show it.
CHANGES = {
    "force by stiffness to another power": ("stiff", bending, "FORCE_BY_STIFFNESS", 0.6),
    "no factor of the model": ("stiff", bending, "MODEL_SPREAD", 1.0),
    "a level that does not grow": ("level", sources, "LEVEL", sources.LEVEL | {"level_per_s": 0.0}),
    "no drift of the target": ("level", sources, "DRIFT_MM_S", dict.fromkeys(sources.DRIFT_MM_S, (0.0, 0.0, 0.0))),
    "play counted twice": ("unknown", sources, "needle_in_tissue", play_twice),
}


def changed(folder: Path, name: str) -> list[str]:
    """What is found wrong if the model is changed: few draws show it."""
    shown_by, module, what, value = CHANGES[name]
    variant = next(each for each in VARIANTS if each.name == shown_by)
    before, bends = getattr(module, what), bending.BENDS
    setattr(module, what, value)
    bending.BENDS = DRAWS_OF_CHANGES * BEND_TIMES_AS_MANY
    sources.KNOWN_BENDS.clear()
    failures = of(variant, folder, DRAWS_OF_CHANGES).failures
    setattr(module, what, before)
    bending.BENDS = bends
    sources.KNOWN_BENDS.clear()
    # That few draws show less of a total is not what was changed.
    return [failure for failure in failures if "would not be noticed" not in failure]


def main() -> int:
    """Compares all scenarios, then changes the model."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--program", required=True)
    program = arguments.parse_args().program
    began = time.monotonic()
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as made, multiprocessing.Pool() as pool:
        folder = Path(made)
        every = pool.starmap(ran, [(program, folder, each) for each in VARIANTS], chunksize=1)
        for each in every:
            print(f"{each.variant.name}, {', '.join(each.variant.goals)}:")
            printed(each.worst, each.radii)
            failures += [f"{each.variant.name}, {failure}" for failure in each.failures]
        if not failures:
            shown = pool.starmap(changed, [(folder, name) for name in CHANGES], chunksize=1)
            for name, found in zip(CHANGES, shown, strict=True):
                print(f"{name}: {found[0] if found else 'not found'}")
                if not found:
                    failures.append(f"{name} would not be found")
        bent = [each.worst["needle"] for each in every if "needle, drawn" in each.worst]
        if bent:
            print(f"figure bend_bias_um {max(worst[2] for worst in bent) * 1e6:.3f}")
            print(f"figure bend_covariance_percent {max(worst[3] for worst in bent) * 100:.3f}")
    print(f"{time.monotonic() - began:.1f} s")
    for failure in failures:
        print(f"FAIL: {failure}")
    print("FAIL" if failures else "PASS")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
