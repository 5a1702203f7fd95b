"""The command line, run in this process."""

import json
import re
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

from chilopod.cli import main


def run(*arguments) -> tuple[int, str, str]:
    """Exit code, stdout, stderr."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = main([str(each) for each in arguments])
    return code, out.getvalue(), err.getvalue()


def remarks(err: str) -> list[str]:
    """Lines on stderr without the progress that a slow machine, or the first of all runs, prints."""
    return [each for each in err.splitlines() if not re.fullmatch(r"[\w ]+: (\d+ s.*|compiling, once.*)", each)]


def printed(*arguments):
    """What a command that succeeds prints as JSON."""
    code, out, _ = run(*arguments)
    assert code == 0
    return json.loads(out)
