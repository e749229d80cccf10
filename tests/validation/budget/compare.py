"""The error budget of a run against many arms and patients that are drawn here.

`compare.py --scenario scenarios/imperfect.toml --results OUT/imperfect` reads what `needlebench run` wrote: goals,
final postures and analytic budgets from `report.json`, the planned motion's references from a CSV of each
configuration. Everything else comes from the files of scenario and models, see `model.py`; what the sources do is
in `sources.py`. Exits with 1 where bias or covariance of a source or of all differ by more than the error of the
draws and what a budget of first order leaves out.
"""

import argparse
import csv
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from model import (
    GRAVITY_M_S2,
    MODELS,
    OUTER_M,
    Arm,
    defaults,
    from_rpy,
    from_vector,
    read_chain,
    read_deviations,
    read_toml,
    read_tool,
)
from sources import SOURCES, WITHOUT_REST, Case, as_planned, errors, planned

DRAWS = 20_000
# Times as many where the fourth moment is that of a rare event, and a draw costs nothing.
TIMES_AS_MANY = {"breathing": 20}
RADIUS_TIMES_AS_MANY = 5
# Of the program, unless the scenario says.
BUDGET_SAMPLES = 2000
# A needle in tissue bends by a lognormal, whose fourth moment is large; so many are solved, and no more.
BEND_TIMES_AS_MANY = 2
# Standard errors of the draws that a moment may be off by: of 2268 moments of `imperfect.toml` one in 700 runs
# would have one beyond by chance, and the seed is given.
STANDARD_ERRORS = 5.0
# What the budget leaves out: terms of third order in a bias, of second order in a covariance. Angles of up
# to 7 mrad, compliances off by 20 % and friction by 15 %: below 0.5 um, and below 1 % of a covariance.
BIAS_LEFT_OUT_M = 0.5e-6
COVARIANCE_LEFT_OUT = 0.01
# The budget takes what bent bristles hold for proportional to a joint's friction. With more friction they bend over a
# longer way, and hold less of it at the end of the same motion: 5 % of the covariance by friction alone.
COVARIANCE_SIMPLIFIED = {"friction": 0.06}
# A budget whose spread is wrong by this has to be found out: else these limits are too wide to say anything.
FOUND_OUT = 1.05
# Planned points and the goal's are the same: rounding of the kinematics.
SAME_POINT_M = 1e-9
# Of a needle in tissue the budget has 512 draws, which say of themselves that their mean is known to 0.5 % and their
# spread to 2 %. It is up to 4 % off those of 20 000 draws of the same program, which are ours to 1 %.
BEND_BIAS, BEND_COVARIANCE = 0.005, 0.04
# Fat under the skin, and how far lengths of layers may be off: the skin is found to this.
FAT_M, SAME_LENGTH_M = 10e-3, 1e-6
# Of the budget's sums; all else is before the insertion.
STAGES = {"in_tissue": ("needle", "indentation"), "of_breath": ("breathing", "skin_markers")}
# Where a bevel may look, along the phantom's axes (left, posterior, superior).
DIRECTIONS = {
    "left": (1, 0, 0),
    "right": (-1, 0, 0),
    "posterior": (0, 1, 0),
    "anterior": (0, -1, 0),
    "superior": (0, 0, 1),
    "inferior": (0, 0, -1),
}


def arm_data(path: Path, scenario: dict) -> dict:
    """A shipped arm's data, with the gains that a scenario's controller has instead.

    And gravity, m/s^2: the world's, and what the controller takes it for, which is the world's unless it says.
    """
    data = read_toml(path)
    controller = scenario.get("controller", {})
    for key in ("stiffness_nm_rad", "damping_nms_rad"):
        if key in controller:
            data["servo"][key] = controller[key]
    data["world_m_s2"] = scenario.get("engines", {}).get("gravity_m_s2", GRAVITY_M_S2)
    data["believed_m_s2"] = controller.get("gravity_m_s2", data["world_m_s2"])
    return data


def last_phase(path: Path, phase: dict) -> tuple[np.ndarray, np.ndarray]:
    """References of the last phase that moves, from its start to its end."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name.endswith("_reference_rad")]
    read = [
        (float(row["time_s"]), [float(row[name]) for name in names]) for row in rows
    ]
    start, end = phase["start_s"], phase["end_s"]
    inside = [(t, q) for t, q in read if start < t < end - 1e-9]
    # The reference holds from the end on.
    held = next(q for t, q in read if t >= end - 1e-9)
    return np.array([*(t for t, _ in inside), end]), np.array(
        [*(q for _, q in inside), held]
    )


def tilted(straight: np.ndarray, along: np.ndarray, head: np.ndarray) -> np.ndarray:
    """Axes of a guide that stands along one line, tilted to another."""
    straight = straight / np.linalg.norm(straight)
    towards_head = head - straight * (head @ straight)
    towards_head /= np.linalg.norm(towards_head)
    about = np.cross(straight, along)
    sine = np.linalg.norm(about)
    turn = from_vector(about / sine * np.arctan2(sine, straight @ along)) if sine > 0.0 else np.eye(3)
    return np.array([turn @ towards_head, turn @ np.cross(straight, towards_head), along])


def pushed_towards(block: dict, axes: np.ndarray, turn: np.ndarray) -> np.ndarray | None:
    """Away from where the bevel's face looks, along the goal's axes: a unit vector, if that is known."""
    bevel = block.get("bevel", "unknown")
    if bevel == "unknown" or block.get("tip", "bevel") != "bevel":
        return None
    if ":" in bevel:
        hours, minutes = (int(part) for part in bevel.split(":"))
        clock = 2.0 * np.pi * (hours + minutes / 60.0) / 12.0
        return -np.array([np.cos(clock), np.sin(clock)])
    looks = (axes @ turn @ np.array(DIRECTIONS[bevel]))[:2]
    return -looks / np.linalg.norm(looks)


def layers_of(goal: dict, radius: float, offset: np.ndarray) -> list[tuple[str, float]]:
    """Tissues from the skin to the tip. Where the lung begins is the run's, as its meshes are; the rest is checked."""
    layers = [(each["tissue"], each["length_m"]) for each in goal["needle"]["layers"]]
    depth = goal["insertion_length_m"] - goal["standoff_m"]
    # From where the axis enters the lesion, a ball, to the target in it.
    along = offset @ np.array(goal["axis"])
    within = along + np.sqrt(radius**2 - offset @ offset + along**2)
    assert abs(sum(length for _, length in layers) - depth) < SAME_LENGTH_M, layers
    for (tissue, length), (wanted, ours) in zip(
        (layers[0], layers[-1]), (("fat", FAT_M), ("lesion", within)), strict=True
    ):
        assert tissue == wanted and abs(length - ours) < SAME_LENGTH_M, (layers, wanted, ours)
    return layers


def cases(
    scenario: dict, report: dict, results: Path, each_goal: int | None = None
) -> list[tuple[str, Case, dict]]:
    """Every configuration with a budget and, where friction needs it, a recorded motion; or so many of each goal."""
    moves = "friction" in scenario["imperfections"]
    robot = scenario["robot"]
    chain, bodies = read_chain(robot["urdf"])
    arm_file = MODELS / robot["urdf"] / "arm.toml"
    data = arm_data(arm_file, scenario)
    base = np.array(robot["base_position_mm"]) * 1e-3
    base_turn = from_rpy(*np.radians(robot["base_rpy_deg"]))
    tool = read_tool(scenario["tool"]["urdf"])
    if "needle_gauge" in scenario["tool"]:
        tool = replace(tool, needle=OUTER_M[scenario["tool"]["needle_gauge"]])
    arm = Arm(chain, bodies, base_turn, base, tool, data)
    real_arms = read_deviations(
        data["population"]["calibrations"], arm_file.parent, data["name"]
    )
    phantom = scenario["phantom"]
    assert phantom.get("posture", "supine") == "supine" and not phantom.get(
        "body_roll_deg", 0.0
    )
    # Supine with the head along x: left is -y, posterior down, superior x; then the yaw.
    yaw = from_rpy(0.0, 0.0, np.radians(phantom.get("head_yaw_deg", 0.0)))
    turn = yaw @ np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    lesions = {
        each["name"]: (np.array(each["center_mm"]) * 1e-3, 0.5e-3 * each["diameter_mm"])
        for each in read_toml(MODELS / "chest_phantom" / f"{phantom['model']}.toml")[
            "lesions"
        ]
    }
    found = []
    for given, goal in zip(scenario["goals"], report["goals"], strict=True):
        along = np.array(goal["axis"])
        target = np.array(goal["target_m"])
        # Where a straight needle is aimed at.
        depth = goal["insertion_length_m"] - goal["standoff_m"]
        aim = np.array(goal["entry_m"]) + depth * along - target
        # The phantom lies where the lesion is the target.
        lesion, radius = lesions[goal["lesion"]]
        offset = turn @ np.array(given.get("target_offset_mm", [0.0, 0.0, 0.0])) * 1e-3
        place = target - offset - turn @ lesion
        towards_head = turn[:, 2] - along * (turn[:, 2] @ along)
        towards_head /= np.linalg.norm(towards_head)
        axes = np.array([towards_head, np.cross(along, towards_head), along])
        block = defaults("NeedleBlock", scenario["imperfections"].get("needle", {}))
        pushed = pushed_towards(block, axes, turn)
        if block["aim"]:
            # The guide is tilted from where it would stand, and so are the axes.
            clock = axes[:2]
            axes = tilted(target - np.array(goal["entry_m"]), along, turn[:, 2])
            pushed = axes[:2] @ (pushed @ clock)
        bends = block["model"] == "tissue" and "needle" in scenario["imperfections"]
        blocks = scenario["imperfections"]
        if block.get("turn_at") == "best":
            at = {"turn_at_mm": 1e3 * goal["needle"]["turn_at_m"]}
            blocks = blocks | {"needle": blocks["needle"] | at}
        with_budget = [
            (each, [file for file in each["files"] if file.endswith(".csv")])
            for each in goal["configurations"]
            if each.get("budget")
        ]
        for each, recordings in [each for each in with_budget if each[1] or not moves][:each_goal]:
            joints = np.array(each["joints_rad"])
            times, path = np.zeros(1), joints[None]
            if moves:
                moving = [phase for phase in each["motion"] if phase["phase"] != "hold"]
                times, path = last_phase(results / recordings[0], moving[-1])
            case = Case(
                arm,
                joints,
                (goal["standoff_m"], goal["insertion_length_m"]),
                axes,
                turn,
                place,
                real_arms,
                times,
                path,
                scenario.get("engines", {}).get("timestep_ms", 1.0) * 1e-3,
                blocks,
                layers_of(goal, radius, offset + aim) if bends else [],
                pushed,
                axes @ aim,
            )
            assert block["aim"] or np.abs(aim).max() < SAME_POINT_M, goal["name"]
            apart = np.abs(planned(case)[1] - target - aim).max()
            assert apart < SAME_POINT_M, (
                f"{goal['name']} {each['label']}: tip {apart} m off the target"
            )
            assert np.abs(path[-1] - case.target).max() < 1e-9, (
                "the motion ends elsewhere"
            )
            found.append((f"{goal['name']} {each['label']}", case, each["budget"]))
    return found


def beyond(
    sample: np.ndarray, moments: dict, source: str, bent: np.ndarray | None = None, drawn: float = np.inf
) -> tuple[float, float, float, float]:
    """How far moments are beyond their limits (more than 1 is beyond), and by how much they differ.

    `bent` is what of the sample is the needle's in tissue; `drawn` is how many draws the moments are of.
    """
    # The variance of the difference of two means is that of one by so many.
    count = 1.0 / (1.0 / len(sample) + 1.0 / drawn)
    mean = sample.mean(axis=0)
    off = sample - mean
    covariance = off.T @ off / (len(sample) - 1)
    products = off[:, :, None] * off[:, None, :]
    error = products.std(axis=0) / np.sqrt(count)
    sigma = np.sqrt(np.diag(covariance))
    claimed_bias, claimed = (
        np.array(moments["bias_m"]),
        np.array(moments["covariance_m2"]),
    )
    bias_limit = STANDARD_ERRORS * sigma / np.sqrt(count) + BIAS_LEFT_OUT_M
    left_out = COVARIANCE_SIMPLIFIED.get(source, COVARIANCE_LEFT_OUT)
    limit = (
        STANDARD_ERRORS * error + left_out * np.outer(sigma, sigma) + BIAS_LEFT_OUT_M**2
    )
    if bent is not None:
        bias_limit = bias_limit + BEND_BIAS * np.linalg.norm(bent.mean(axis=0))
        spread = bent.std(axis=0)
        limit = limit + BEND_COVARIANCE * np.outer(spread, spread)
    differs = np.linalg.norm(covariance - claimed) / max(np.linalg.norm(claimed), 1e-18)
    return (
        float((np.abs(mean - claimed_bias) / bias_limit).max()),
        float((np.abs(covariance - claimed) / limit).max()),
        float(np.abs(mean - claimed_bias).max()),
        float(differs),
    )


def radius_beyond(sample: np.ndarray, claimed: float) -> tuple[float, float]:
    """How far a distance that 95 % stay within is beyond its limits (more than 1 is beyond), and by how much it differs."""
    distances = np.sort(np.linalg.norm(sample, axis=1))
    count = len(distances)
    half = STANDARD_ERRORS * np.sqrt(0.95 * 0.05 / count)
    low, middle, high = (
        distances[min(int(count * share), count - 1)] for share in (0.95 - half, 0.95, 0.95 + half)
    )
    # What the budget's own moments leave out, and 0.2 % that it says the distance is known to.
    left_out = (COVARIANCE_LEFT_OUT / 2 + 0.002) * middle
    limit = (high - middle if claimed > middle else middle - low) + left_out
    return float(abs(claimed - middle) / limit), float(claimed / middle - 1.0)


def compare(
    scenario: dict, report: dict, results: Path, draws: int, seed: int = 1, of_needle: bool = False
) -> tuple[list[str], dict[str, list[float]], list[tuple[float, float]], int]:
    """Failures, the worst of each source, distances that 95 % are within, and how many configurations were compared.

    What the needle is part of, of one configuration of each goal; or all.
    """
    blocks = scenario["imperfections"]
    named = [key for key, value in blocks.items() if isinstance(value, dict)]
    unknown = [key for key in named if key not in SOURCES and key not in WITHOUT_REST]
    failures = [
        f"no model of its own for [imperfections.{key}]: write it into sources.py"
        for key in unknown
    ]
    settings = {name: defaults(SOURCES[name][0], blocks[name]) for name in SOURCES if name in named}
    in_tissue = settings.get("needle", {}).get("model") == "tissue"
    # The play of the guide is part of a needle in tissue, but lies in the bore as ever before that is inserted.
    chosen = [name for name in settings if not (in_tissue and name == "guide")]
    stages = {"all": chosen} | {
        stage: [name for name in settings if name in of] for stage, of in STAGES.items()
    }
    stages["before_insertion"] = [name for name in settings if name not in [*STAGES["in_tissue"], *STAGES["of_breath"]]]
    worst: dict[str, list[float]] = {}
    radii: list[tuple[float, float]] = []
    compared = cases(scenario, report, results, 1 if of_needle else None)
    if not compared:
        failures.append(
            "nothing to compare: no configuration with a budget and a recorded motion"
        )
    for number, (label, case, budget) in enumerate(compared):
        reported = {
            each["source"] or "all": each
            for each in [*budget["sources"], budget["total"]]
        }
        for stage in stages:
            if stage != "all":
                reported[stage] = {"at_target": {"analytic": budget[stage]}}
        for name in reported:
            if name not in [*chosen, *stages]:
                failures.append(
                    f"{label}: the report has a source `{name}` that was not drawn"
                )
        for k, name in enumerate([*chosen, *stages]):
            if name not in reported:
                failures.append(f"{label}: the report lacks the source `{name}`")
                continue
            random = np.random.default_rng([seed, number, k])
            of = stages.get(name, [name])
            if of_needle and "needle" not in of:
                continue
            bends = in_tissue and "needle" in of
            times = BEND_TIMES_AS_MANY if bends else TIMES_AS_MANY.get(name, 1)
            truth = as_planned(case, draws * times)
            for source in of:
                SOURCES[source][1](case, settings[source], random, truth)
            if name == "all":
                # A quantile takes more draws than a moment, but of a needle in tissue there are no more.
                many = as_planned(case, draws * (times if bends else RADIUS_TIMES_AS_MANY))
                for source in chosen:
                    SOURCES[source][1](case, settings[source], random, many)
                for sample, where in zip(
                    errors(case, many, random), ("at_skin", "at_target"), strict=True
                ):
                    claimed = reported[name][where]["radius_95_m"]
                    radii.append(radius_beyond(sample, claimed))
                    if radii[-1][0] > 1.0:
                        failures.append(
                            f"{label}, {where}: 95 % within {claimed * 1e3:.3f} mm, {radii[-1][1]:.2%} off the draws"
                        )
                    if radius_beyond(FOUND_OUT * sample, claimed)[0] < 1.0:
                        failures.append(
                            f"{label}, {where}: a distance wrong by 5 % would not be noticed"
                        )
            for place, (sample, where) in enumerate(
                zip(errors(case, truth, random), ("at_skin", "at_target"), strict=True)
            ):
                if where not in reported[name]:
                    continue
                bent = truth.bent[place] if bends else None
                said = reported[name][where]
                ways = {"analytic": np.inf}
                if bent is not None and said.get("monte_carlo"):
                    ways["monte_carlo"] = blocks.get("budget_samples", BUDGET_SAMPLES)
                for way, drawn in ways.items():
                    found = beyond(sample, said[way], name, bent, drawn)
                    key = name if way == "analytic" else f"{name}, drawn"
                    worst[key] = [max(a, b) for a, b in zip(worst.get(key, [0.0] * 4), found, strict=True)]
                    if max(found[:2]) > 1.0:
                        failures.append(
                            f"{label}, {key}, {where}: bias {found[2] * 1e6:.2f} um apart ({found[0]:.2f} of "
                            f"what is allowed), covariance {found[3]:.2%} ({found[1]:.2f})"
                        )
                if name == "all":
                    stretched = sample.mean(axis=0) + FOUND_OUT * (
                        sample - sample.mean(axis=0)
                    )
                    if beyond(stretched, said["analytic"], name, bent)[1] < 1.0:
                        failures.append(
                            f"{label}, {where}: a spread wrong by 5 % would not be noticed"
                        )
    return failures, worst, radii, len(compared)


def printed(worst: dict[str, list[float]], radii: list[tuple[float, float]]) -> None:
    """A line of each source."""
    print(
        "worst over configurations, at skin and target; in brackets the share of what is allowed"
    )
    for name, (bias, covariance, bias_m, differs) in worst.items():
        print(
            f"{name:>16}: bias {bias_m * 1e6:6.2f} um ({bias:.2f}), covariance {differs:6.2%} ({covariance:.2f})"
        )
    if radii:
        share, differs = (max(abs(each[k]) for each in radii) for k in (0, 1))
        print(f"    95 % within: {differs:6.2%} ({share:.2f})")


def main() -> int:
    """Compares, prints a line per source, and says whether all is within the limits."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--scenario", type=Path, required=True)
    arguments.add_argument("--results", type=Path, required=True)
    arguments.add_argument("--draws", type=int, default=DRAWS)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    began = time.monotonic()
    report = json.loads((given.results / "report.json").read_text())
    failures, worst, radii, count = compare(
        read_toml(given.scenario), report, given.results, given.draws, given.seed
    )
    print(
        f"{count} configurations, {given.draws} draws for each source and for all, NumPy {np.__version__}"
    )
    printed(worst, radii)
    if radii:
        print(f"figure radius_95_percent {max(abs(differs) for _, differs in radii) * 100:.3f}")
    of_one = [found for name, found in worst.items() if name in SOURCES]
    print(f"figure bias_of_one_um {max(found[2] for found in of_one) * 1e6:.3f}")
    print(f"figure covariance_of_one_percent {max(found[3] for found in of_one) * 100:.3f}")
    if "all" in worst:
        print(f"figure bias_of_all_um {worst['all'][2] * 1e6:.3f}")
        print(f"figure covariance_of_all_percent {worst['all'][3] * 100:.3f}")
    print(f"{time.monotonic() - began:.1f} s")
    for failure in failures:
        print(f"FAIL: {failure}")
    print("FAIL" if failures else "PASS")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
