"""Recompresses a wheel: `python recompress.py WHEEL`. The same wheel gives the same bytes."""

import sys
import zipfile
from pathlib import Path

import zopfli.zlib


class _Deflate:
    """The interface of a compressor for `zipfile`."""

    def __init__(self) -> None:
        self._data = bytearray()

    def compress(self, data: bytes) -> bytes:
        self._data += data
        return b""

    def flush(self) -> bytes:
        # Between the two bytes that zlib begins with and its checksum.
        return zopfli.zlib.compress(bytes(self._data), numiterations=2)[2:-4]


def main() -> None:
    """Replaces the wheel."""
    wheel = Path(sys.argv[1])
    smaller = wheel.with_suffix(".smaller")
    zipfile._get_compressor = lambda *_: _Deflate()  # type: ignore[attr-defined]
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(smaller, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            new.writestr(entry, old.read(entry), zipfile.ZIP_DEFLATED)
    smaller.replace(wheel)


if __name__ == "__main__":
    main()
