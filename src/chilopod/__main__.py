"""``python -m chilopod`` is the command ``chilopod``."""

import sys

from chilopod.cli import main

if __name__ == "__main__":
    sys.exit(main())
