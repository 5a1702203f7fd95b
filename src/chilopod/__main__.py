"""``chilopod`` and ``python -m chilopod``: the command line as a process of its own."""

import os
import sys
import warnings


def main() -> int:
    """Run the command line on the arguments of this process; its exit code is that of :func:`chilopod.cli.main`."""
    try:
        return _run()
    except KeyboardInterrupt:  # before the command line has begun
        print("error: interrupted", file=sys.stderr)
        return 130


def _run() -> int:
    from chilopod import process

    stdout = process.hold_streams()  # before anything is opened that could take the place of a closed stream
    process.answer_interrupts()
    # Figures go into files, so a window backend is neither needed nor used.
    os.environ["MPLBACKEND"] = "agg"
    # Matrices are small: threads of linear algebra would mostly wait for each other, and take other work's time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Numba would go on without a variable that it cannot read, after many lines about it.
    warnings.filterwarnings("error", "Environment variable 'NUMBA_", RuntimeWarning)
    warnings.showwarning = lambda message, *_: print(f"warning: {message}", file=sys.stderr)
    from chilopod.cli import USAGE_ERROR
    from chilopod.cli import main as run

    code = run()
    lost = process.unwritten(stdout)
    if code == process.INTERRUPTED:
        return process.exit_code()
    process.ignore_interrupts()
    if code == 0 and lost:
        print(f"error: stdout cannot be written ({lost})", file=sys.stderr)
        return USAGE_ERROR
    return code


if __name__ == "__main__":
    sys.exit(main())
