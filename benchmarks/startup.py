"""Start-up of the command and of the import, warm: a fresh process each time, files in the system's cache.

Run by `make bench`; rewrites its table in README.md.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from _timing import duration, machine, median_seconds, table, write_section

COMMAND = Path(sys.executable).with_name("chilopod")
CALLS = {
    "`chilopod --help`": ([str(COMMAND), "--help"], "0.3 s"),
    '`python -c "import chilopod"`': ([sys.executable, "-c", "import chilopod"], "0.5 s"),
    '`python -c "import chilopod.analysis"`': ([sys.executable, "-c", "import chilopod.analysis"], "0.6 s"),
    '`python -c "import numpy"`, for comparison': ([sys.executable, "-c", "import numpy"], ""),
    '`python -c "pass"`, for comparison': ([sys.executable, "-c", "pass"], ""),
}


def main() -> None:
    rows = []
    for name, (command, allowed) in CALLS.items():
        try:
            seconds = median_seconds(lambda c=command: subprocess.run(c, check=True, capture_output=True), 4.0, 9)
        except (OSError, subprocess.CalledProcessError) as problem:
            rows.append([name, f"does not run ({type(problem).__name__})", allowed])
        else:
            rows.append([name, duration(seconds), allowed])
    write_section("startup", f"{machine()}\n\n{table(['what', 'median', 'allowed'], rows)}")


if __name__ == "__main__":
    main()
