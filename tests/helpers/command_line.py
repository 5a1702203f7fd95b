"""The command line, run in this process."""

import json
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

from chilopod.cli import main


def run(*arguments) -> tuple[int, str, str]:
    """Exit code, stdout, stderr."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = main([str(each) for each in arguments])
    return code, out.getvalue(), err.getvalue()


def printed(*arguments):
    """What a command that succeeds prints as JSON."""
    code, out, _ = run(*arguments)
    assert code == 0
    return json.loads(out)
