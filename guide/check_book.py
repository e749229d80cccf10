"""The guide as a book: ``python3 guide/check_book.py``, without mdBook.

Every chapter is in the summary and every entry of the summary is a chapter; every picture is shown; and the preprocessor,
run as mdBook runs it, leaves no link that would lead out of the rendered book.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

GUIDE = Path(__file__).resolve().parent
SOURCES = GUIDE / "src"
LINK = re.compile(r"!?\[[^\]]*\]\(([^)#\s]+)(?:#[^)\s]*)?\)")


def targets(path: Path) -> list[str]:
    return [target for target in LINK.findall(path.read_text()) if "://" not in target]


def preprocessed(chapters: list[Path]) -> dict[str, str]:
    """What mdBook would render, by chapter."""
    items = [
        {"Chapter": {"path": str(path.relative_to(SOURCES)), "content": path.read_text(), "sub_items": []}}
        for path in chapters
    ]
    command = [sys.executable, GUIDE / "outside_links.py"]
    done = subprocess.run(command, input=json.dumps([{}, {"items": items}]), capture_output=True, text=True, check=True)
    return {each["Chapter"]["path"]: each["Chapter"]["content"] for each in json.loads(done.stdout)["items"]}


def main() -> int:
    chapters = sorted(path for path in SOURCES.rglob("*.md") if path.name != "SUMMARY.md")
    listed = {(SOURCES / target).resolve() for target in targets(SOURCES / "SUMMARY.md")}
    wrong = [f"{path} is not in the summary" for path in chapters if path not in listed]
    wrong += [f"{path} is in the summary and not there" for path in sorted(listed) if not path.is_file()]
    documents = [*chapters, GUIDE.parent / "README.md"]
    shown = {Path(target).name for path in documents for target in targets(path)}
    wrong += [f"nobody shows {path}" for path in sorted((SOURCES / "images").iterdir()) if path.name not in shown]
    for name, text in preprocessed(chapters).items():
        for target in LINK.findall(text):
            inside = "://" in target or (SOURCES / name).parent.joinpath(target).resolve().is_relative_to(SOURCES)
            if not inside:
                wrong.append(f"{name}: a reader of the book cannot follow {target}")
    for each in wrong:
        print(f"error: {each}", file=sys.stderr)
    print(f"{len(chapters)} chapters, {len(shown)} targets")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
