"""What the comparison found, as a table and as JSON."""

from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray


@dataclass
class Worst:
    """Where a difference is largest."""

    value: float = 0.0
    where: str = ""

    def take(self, values: Array, name) -> None:
        """Keep the largest of values, named by its index."""
        if values.size and values.max() > self.value:
            index = int(values.argmax())
            self.value, self.where = float(values[index]), name(index)


@dataclass
class Tally:
    """What is known of one scenario."""

    name: str
    postures: int
    body_pairs: int
    solid_pairs: int
    placement_difference_m: float
    apart: int = 0
    penetrating: int = 0
    apart_difference_m: dict = field(default_factory=dict)
    penetrating_difference_m: dict = field(default_factory=dict)
    class_difference_m: dict = field(default_factory=dict)
    largest_above_coal: Worst = field(default_factory=Worst)
    largest_below_coal: Worst = field(default_factory=Worst)
    largest_above_upper_bound: Worst = field(default_factory=Worst)
    largest_unproved: Worst = field(default_factory=Worst)
    proved_by_search: int = 0
    coal_outside_shapes: Worst = field(default_factory=Worst)
    coal_wrong_apart: int = 0
    coal_wrong_sign: int = 0
    coal_too_deep: Worst = field(default_factory=Worst)
    coal_too_shallow: Worst = field(default_factory=Worst)
    coal_wrong: int = 0
    timing_s: dict = field(default_factory=dict)
    failures: list = field(default_factory=list)


def quantiles(values: Array) -> dict:
    """Quantiles and the largest."""
    if not values.size:
        return dict.fromkeys(("q50", "q75", "q99", "max"), 0.0)
    q50, q75, q99 = np.quantile(values, [0.5, 0.75, 0.99])
    return {"q50": float(q50), "q75": float(q75), "q99": float(q99), "max": float(values.max())}


def plain(value):
    """Dataclasses as dictionaries, for JSON."""
    return value.__dict__ if hasattr(value, "__dict__") else value.item()


def text_of(tallies: list[Tally], meshes: list[dict]) -> str:
    """The report as a table."""
    lines = ["clearances of whole cells against Coal and Pinocchio (differences in um)", ""]
    form = "{:<20} {:>8} {:>6} {:>8} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10} {:>9}"
    lines.append(
        form.format(
            "scenario", "postures", "pairs", "solids", "distances", "apart q99", "max",
            "deep q99", "max", "above*", "unproved**", "Coal off",
        )
    )  # fmt: skip
    um = 1e6
    for each in tallies:
        lines.append(
            form.format(
                each.name,
                each.postures,
                each.body_pairs,
                each.solid_pairs,
                each.apart + each.penetrating,
                f"{each.apart_difference_m['q99'] * um:.1e}",
                f"{each.apart_difference_m['max'] * um:.1e}",
                f"{each.penetrating_difference_m['q99'] * um:.1e}",
                f"{each.penetrating_difference_m['max'] * um:.1e}",
                f"{each.largest_above_upper_bound.value * um:.1e}",
                f"{each.largest_unproved.value * um:.1e}",
                each.coal_wrong,
            )
        )
    lines += [
        "*  most that needlebench is above the distance of two points of the shapes (Coal's)",
        "** most that needlebench is above the gap along its own normal, which is a lower bound, or",
        "   along a better direction where a search finds one",
        "Coal off: answers of Coal that differ by more than 1 um and that a search over directions,",
        "  or two points of the shapes, shows to be wrong; not in the columns before",
        "",
    ]
    for each in tallies:
        deep, shallow = each.coal_too_deep, each.coal_too_shallow
        lines.append(
            f"{each.name}: Coal off {each.coal_wrong} times, {each.coal_wrong_apart} of them apart, "
            f"{each.coal_wrong_sign} with the wrong sign; too deep by up to {deep.value * 1e3:.2f} mm"
            f" ({deep.where}), too shallow by up to {shallow.value * 1e3:.2f} mm ({shallow.where})"
        )
        for kind, row in each.class_difference_m.items():
            lines.append(
                f"  {kind:<16} minima differ by up to {row['max'] * um:.1e} um, "
                f"least {row['least_m'] * 1e3:9.3f} mm"
            )
    lines += ["", "time of a posture with forward kinematics (us, one thread, same postures)"]
    form = "{:<20} {:>16} {:>12} {:>20} {:>8} {:>8}"
    heads = ["scenario", "Coal+Pinocchio", "all pairs", "minimum per class", "times", "times"]
    lines.append(form.format(*heads))
    for each in tallies:
        row = each.timing_s
        lines.append(
            form.format(
                each.name,
                f"{row['coal_pinocchio'] * um:.1f}",
                f"{row['needlebench_all_pairs'] * um:.1f}",
                f"{row['needlebench_minimum_per_class'] * um:.1f}",
                f"{row['times_faster_all_pairs']:.1f}",
                f"{row['times_faster_minimum_per_class']:.1f}",
            )
        )
    lines += ["", "against a triangle mesh (us; Coal: BVHModelOBBRSS)"]
    form = "{:<10} {:>10} {:>12} {:>12} {:>12} {:>12} {:>14}"
    heads = ["shape", "triangles", "Coal median", "ours", "Coal worst", "ours", "difference um"]
    lines.append(form.format(*heads))
    for row in meshes:
        lines.append(
            form.format(
                row["name"],
                row["triangles"],
                f"{row['coal_median_s'] * um:.1f}",
                f"{row['needlebench_median_s'] * um:.1f}",
                f"{row['coal_worst_s'] * um:.1f}",
                f"{row['needlebench_worst_s'] * um:.1f}",
                f"{row['difference_m']['max'] * um:.1e}",
            )
        )
    return "\n".join(lines)
