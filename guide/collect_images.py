"""Takes the guide's figures from results: ``collect_images.py RESULTS IMAGES [--check]``.

Charts are kept as they are; pictures are made smaller. With ``--check`` nothing is written, and a figure that is not
what the results have is an error.
"""

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image, ImageChops

WIDTH_PX = 1568
COLOURS = 128
# Of 255: what the last bits of a renderer may make of a pixel.
MOST_DIFFERENT = 0.3

FIGURES = {
    "configurations.png": "table3/pose.png",
    "room.png": "table3/pose/Right-Up-Fold.room.png",
    "ranking.svg": "table3/pose.ranking.svg",
    "budget.svg": "imperfect/right_pleural_lateral.budget.svg",
    "atlas.svg": "supine_suite/right_upper_anterior.atlas.svg",
    "press.svg": "contact/right_pleural_lateral/Right-Up-Fold.press-1.svg",
    "iso9283.svg": "iso9283/attained.rapier.svg",
    "replay.svg": "ur3e_rad_20211005/replay.svg",
    "servo.svg": "table3/servo/wrist_1.svg",
    "ct_overview.png": "patient/slices/overview.png",
    "ct_slice.png": "patient/slices/lesion_nodule_axial.png",
    "ct_routes.png": "patient/nodule.routes.png",
}


def small(path: Path) -> bytes:
    """A picture of at most ``WIDTH_PX`` and ``COLOURS``."""
    image = Image.open(path).convert("RGB")
    if image.width > WIDTH_PX:
        height = round(image.height * WIDTH_PX / image.width)
        image = image.resize((WIDTH_PX, height), Image.Resampling.LANCZOS)
    quantized = image.quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    out = BytesIO()
    quantized.save(out, "PNG", optimize=True)
    return out.getvalue()


def same_picture(a: bytes, b: bytes) -> bool:
    first, second = (Image.open(BytesIO(data)).convert("RGB") for data in (a, b))
    if first.size != second.size:
        return False
    histogram = ImageChops.difference(first, second).convert("L").histogram()
    mean = sum(level * count for level, count in enumerate(histogram)) / sum(histogram)
    return mean < MOST_DIFFERENT


def main() -> None:
    results, images = (Path(word) for word in sys.argv[1:3])
    check = "--check" in sys.argv[3:]
    stale = []
    for name, source in FIGURES.items():
        is_picture = name.endswith(".png")
        made = small(results / source) if is_picture else (results / source).read_bytes()
        kept = images / name
        if not check:
            kept.write_bytes(made)
            print(f"{name}: {len(made) / 1000:.0f} kB")
        elif not kept.exists():
            stale.append(name)
        elif kept.read_bytes() != made and not (is_picture and same_picture(made, kept.read_bytes())):
            stale.append(name)
    if stale:
        sys.exit(f"figures that are not what the program makes: {', '.join(stale)}; see guide/make_images")


if __name__ == "__main__":
    main()
