"""Preprocessor of the book: what a link to a file outside of the guide becomes where there is no checkout around it.

In a checkout such links lead to the file. In a rendered book they would lead nowhere, so the file is named instead.
"""

import json
import re
import sys
from pathlib import PurePosixPath

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]+)(#[^)\s]*)?\)")


def rewrite(text: str, chapter: PurePosixPath) -> str:
    """The chapter with links out of the guide as words and the file's place in the repository."""

    def replace(match: re.Match[str]) -> str:
        words, target = match[1], match[2]
        # The guide's sources are two folders below the repository's top.
        parts: list[str] = ["guide", "src", *chapter.parent.parts]
        for part in PurePosixPath(target).parts:
            if part == "..":
                parts.pop()
            else:
                parts.append(part)
        if parts[:2] == ["guide", "src"]:
            return match[0]
        place = "/".join(parts)
        named = words.strip("`") == place
        return f"`{place}`" if named else f"{words} (`{place}`)"

    return LINK.sub(replace, text)


def visit(item: dict) -> None:
    chapter = item.get("Chapter")
    if chapter and chapter.get("path"):
        chapter["content"] = rewrite(chapter["content"], PurePosixPath(chapter["path"]))
        for each in chapter["sub_items"]:
            visit(each)


def main() -> None:
    if sys.argv[1:2] == ["supports"]:
        return
    _, book = json.load(sys.stdin)
    for item in book.get("items", book.get("sections", [])):
        if isinstance(item, dict):
            visit(item)
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
