"""The command line: ``needlebench`` and ``python -m needlebench``."""

import sys

from . import _native


def main() -> int:
    """Runs the program with the arguments of this process."""
    return _native.main(["needlebench", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
