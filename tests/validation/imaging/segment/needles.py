"""Where proposed needles really go, in chests that the program has not seen: voxel by voxel, against the truth.

    target/segment/bin/python tests/validation/imaging/segment/needles.py --program target/release/needlebench

Chests are drawn at random (chests.py): with and without contrast, arms beside the body, reconstruction circles that
cut it, one lung ill, pacemakers; a third come with a label map of some structures under the names of other programs.
`ct build` and `ct routes` are run on each. Of every direction that is called admissible, the path from the target to
the skin is walked through the truth, and the room before the skin. Also how well bone is found (Dice).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import chests
import nibabel as nib
import numpy as np

Array = np.ndarray

# Nothing of these may be passed. Where there is neither contrast nor a label map, vessels within the lungs are seen by
# their density alone, and what is thinner than the rule's 3 mm is not avoided.
NEVER = ("bone", "heart", "vessel", "airway", "metal", "arm", "couch")
# Cartilage is hardly denser than muscle: by the usual rules so few needles may graze it, where its absence is not said.
GRAZE_CARTILAGE = 0.01
NO_CARTILAGE = "hardly any costal cartilage found"
# Not of the trunk.
BESIDE = ("arm", "couch", "foam")
# Shorter ways through a tissue are within what a voxel's truth leaves open, mm; through an arm or a couch, whose edges
# are partly beyond a circle, those within one voxel.
GRAZED_MM = 1.0
STEP_MM = 0.25
# Of the room before the skin, mm: needle, hub and guide.
OUTSIDE_MM = 60.0
# Of an entry from the true skin, and between an entry and a cut, mm.
SKIN_MM = 3.0
CUT_MM = 4.0
# The rules of the default, and the least that a user may ask for.
RULES = {
    "usual": "",
    "least": "margin_mm = 0\ntip_sd_mm = 0\nbelow_rib_mm = 0\nlung_vessel_mm = 0\nmax_skin_angle_deg = 80\n",
}
# Label maps: names of other programs, and which solids each label has.
MAPS: tuple[dict[str, tuple[str, ...]], ...] = (
    {"vertebrae_T5": ("vertebra_1",)},
    {"lung": ("lung_left", "lung_right", "nodule", "lung_vessel"), "lung_nodules": ("nodule",)},
    {"heart": ("heart",), "aorta": ("aorta",), "superior_vena_cava": ("superior_vena_cava",)},
    {"body": ("all",)},
    {"rib_left_3": (), "sternum": ("sternum",), "my own region": ("muscle",)},
    {
        "lung_upper_lobe_left": ("lung_left",), "lung_upper_lobe_right": ("lung_right",),
        "lung_vessels": ("lung_vessel",), "costal_cartilages": ("costal_cartilages",), "liver": ("liver",),
        "stomach": ("stomach",), "scapula_left": ("scapula_left",), "clavicula_right": ("clavicula_right",),
    },
    {"Vertebrae": tuple(f"vertebra_{level}" for level in range(-9, 10)), "Background": ("couch",)},
)  # fmt: skip


BONES = re.compile("bone|vertebra|rib_|sternum|scapula|clavicula", re.IGNORECASE)


def save(path: Path, values: Array, chest: chests.Chest) -> None:
    """A NIfTI file: its world is right, anterior, superior."""
    affine = np.diag([-chest.spacing[0], -chest.spacing[1], chest.spacing[2], 1.0])
    affine[:3, 3] = chest.first * [-1, -1, 1]
    nib.save(nib.Nifti1Image(values.transpose(2, 1, 0), affine), path)


def label_map(number: int, chest: chests.Chest, folder: Path) -> list[str]:
    """Every third chest has one; its arguments."""
    if number % 3:
        return []
    kinds = MAPS[number // 3 % len(MAPS)]
    values = np.zeros(chest.truth.shape, np.uint8)
    for index, solids in enumerate(kinds.values()):
        for solid in solids:
            there = (chest.truth > 0) & ~np.isin(chest.truth, [chests.LABEL[name] for name in BESIDE])
            values[there if solid == "all" else chest.named.get(solid, np.zeros_like(there))] = index + 1
    save(folder / "labels.nii.gz", values, chest)
    (folder / "names.json").write_text(json.dumps({str(i + 1): name for i, name in enumerate(kinds)}))
    chest.words.append(f"label map: {', '.join(kinds)}")
    return ["--labels", str(folder / "labels.nii.gz"), "--label-names", str(folder / "names.json")]


def truth_at(chest: chests.Chest, points: Array) -> Array:
    """Labels at points of the scan's frame, mm; 255 outside the scan."""
    index = np.rint((points - chest.first) / chest.spacing).astype(int)
    inside = ((index >= 0) & (index < chest.truth.shape[::-1])).all(-1)
    i, j, k = np.where(inside[..., None], index, 0).transpose(2, 0, 1)
    return np.where(inside, chest.truth[k, j, i], 255)


def walk(chest: chests.Chest, target: Array, ways: Array, depths: Array) -> Counter[str]:
    """What is passed by needles from a target along unit vectors, and what stands before their entries."""
    found: Counter[str] = Counter()
    body = [label for name, label in chests.LABEL.items() if name not in BESIDE]
    for start in range(0, len(ways), 500):
        way, depth = ways[start : start + 500], depths[start : start + 500]
        s = np.arange(0.0, depths.max() + OUTSIDE_MM, STEP_MM)
        seen = truth_at(chest, target + s[None, :, None] * way[:, None, :])
        within = s[None, :] < depth[:, None]
        before = (s[None, :] > depth[:, None] + 2.0) & (s[None, :] < depth[:, None] + OUTSIDE_MM)
        for name in chests.TISSUES:
            there = seen == chests.LABEL[name]
            if name in ("arm", "couch"):
                length = STEP_MM * (there & (within | before)).sum(1)
                found[name] += int((length > np.linalg.norm(chest.spacing)).sum())
            else:
                found[name] += int((STEP_MM * (there & within).sum(1) > GRAZED_MM).sum())
        # The last of the body that the ray passes before it is in the open for good.
        is_body = np.isin(seen, body)
        skin = s[len(s) - 1 - is_body[:, ::-1].argmax(1)]
        entry = target + depth[:, None] * way
        # Off the skin, and not along a needle that leaves it flat.
        normal = entry[:, :2] / np.square(chest.half)
        slope = np.abs((normal * way[:, :2]).sum(1)) / np.linalg.norm(normal, axis=1)
        found["skin missed"] += int((np.abs(skin - depth) * slope > SKIN_MM).sum())
        if chest.circle:
            x, y, radius = chest.circle
            found["cut circle"] += int((np.hypot(entry[:, 0] - x, entry[:, 1] - y) > radius - CUT_MM).sum())
        top = chest.first[2] + chest.spacing[2] * (len(chest.truth) - 1)
        found["cut end"] += int(((entry[:, 2] < chest.first[2]) | (entry[:, 2] > top)).sum())
    return found


def bone_dice(chest: chests.Chest, folder: Path) -> float:
    """How well the bones of the trunk are found."""
    names = json.loads((folder / "labels.json").read_text())
    image = nib.load(folder / "labels.nii.gz")
    values = np.asarray(image.dataobj).transpose(2, 1, 0)
    bone = [int(entry["label"]) for entry in names["labels"] if BONES.search(entry["name"])]
    found = np.isin(values, bone)
    true = np.isin(chest.truth, [chests.LABEL["bone"]])
    # Arms have bones of their own, and metal is neither.
    asked = ~np.isin(chest.truth, [chests.LABEL[name] for name in ("arm", "metal", "cartilage")])
    if chest.circle:
        asked &= chest.hu > -1000
    return float(2 * (found & true & asked).sum() / ((found & asked).sum() + (true & asked).sum()))


def look(program: str, number: int, keep: str | None) -> tuple[str, list[str], int, Counter[str]]:
    """One chest: a line to print, what is wrong, how many directions were walked and what they passed."""
    chest = chests.scan(number)
    wrong: list[str] = []
    passed: Counter[str] = Counter()
    walked = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(keep or temporary) / f"chest_{number}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        save(folder / "ct.nii.gz", chest.hu, chest)
        labels = label_map(number, chest, folder)
        built = folder / "built"
        command = [program, "ct", "build", str(folder / "ct.nii.gz"), "--out", str(built), *labels]
        for index, (x, y, z, _) in enumerate(chest.nodules):
            command += ["--lesion", f"nodule_{index}={x:.3f},{y:.3f},{z:.3f}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        head = f"{number:3} {', '.join(chest.words) or 'plain'}"
        # A lesion that cannot be told from what is around it fails; all else is there.
        if not (built / "scenario.toml").exists():
            return head, [f"ct build: {done.stderr.strip()}"], 0, passed
        dice = bone_dice(chest, built)
        scenario = (built / "scenario.toml").read_text().replace("needle_length_mm = 200.0", "needle_length_mm = 280.0")
        is_said = NO_CARTILAGE in (built / "report.json").read_text()
        counts = []
        for kind, rules in RULES.items():
            # After each goal, what was asked of its needles.
            goals = scenario.replace("standoff_mm = 15.0\n", f"standoff_mm = 15.0\n[goals.route]\n{rules}")
            (built / "scenario.toml").write_text(goals)
            command = [program, "ct", "routes", str(built), "--no-robot", "--no-pictures"]
            path = built / "routes.json"
            path.unlink(missing_ok=True)
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if not path.exists():
                wrong.append(f"ct routes: {done.stderr.strip()}")
                continue
            free = 0
            for goal in json.loads(path.read_text())["targets"]:
                target = 1e3 * (np.array(goal["target_in_phantom_m"]) + goal["phantom_origin_in_ct_m"])
                table = goal["map"]
                admissible = np.array([rule is None or rule < 0 for rule in table["rule"]])
                azimuth, elevation = (np.deg2rad(np.array(table[f"{name}_deg"])[admissible]) for name in ("azimuth", "elevation"))
                depths = 1e3 * np.array([d for d, a in zip(table["depth_m"], admissible, strict=True) if a], float)
                flat = np.cos(elevation)
                ways = np.stack([flat * np.sin(azimuth), -flat * np.cos(azimuth), np.sin(elevation)], axis=1)
                free += len(ways)
                if len(ways):
                    found = walk(chest, target, ways, depths)
                    passed.update({f"{kind}: {name}": count for name, count in found.items()})
                    for name in (*NEVER, "skin missed", "cut circle", "cut end"):
                        if found[name]:
                            wrong.append(f"{kind} rules, {goal['goal']}: {found[name]} of {len(ways)} {name}")
            cartilage = passed[f"{kind}: cartilage"]
            if cartilage > GRAZE_CARTILAGE * free and kind == "usual" and not is_said:
                wrong.append(f"{kind} rules: {cartilage} of {free} cartilage")
            walked += free
            counts.append(f"{free} {kind}")
        head += f"; {' and '.join(counts)} directions; bone Dice {dice:.3f}"
        passed["dice"] = dice  # type: ignore[assignment]
    return head, wrong, walked, passed


def main() -> None:
    """Looks at all chests that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--chests", type=int, default=40)
    parser.add_argument("--only", type=int, nargs="*", help="these chests alone, by their numbers")
    parser.add_argument("--keep", help="folder in which what was built stays")
    options = parser.parse_args()
    numbers = options.only or range(options.chests)
    total: Counter[str] = Counter()
    dices, walked, bad = [], 0, False
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        asked = [pool.submit(look, options.program, number, options.keep) for number in numbers]
        for each in asked:
            line, wrong, count, passed = each.result()
            print(line, *wrong, sep="\n    WRONG: ", flush=True)
            bad |= bool(wrong)
            walked += count
            dices.append(passed.pop("dice", 0.0))
            total.update(passed)
    for name, count in sorted(total.items()):
        print(f"{name:24} {count}")
    print(f"{walked} directions walked in {len(dices)} chests; bone Dice {np.mean(dices):.3f}, least {min(dices):.3f}")
    sys.exit(bad)


if __name__ == "__main__":
    main()
