"""Ports at which the page can listen."""

from __future__ import annotations

import errno
import socket

from chilopod.errors import ParameterError


def check_port(port: int) -> None:
    """Refuse a number that is not a port with a ParameterError."""
    if not 0 <= port < 65536:
        raise ParameterError("must be a port", field="port", value=port, allowed="1 to 65535, or 0 for any free port")


def free_port(host: str, port: int) -> int:
    """Make sure that the page can listen at a port, and nowhere else."""
    check_port(port)
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
            return int(trial.getsockname()[1])
    except (OSError, UnicodeError) as error:
        if not isinstance(error, OSError) or isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
            problem, allowed = "must be an address of this machine", "an address or a name of it, or 0.0.0.0 for all"
            raise ParameterError(problem, field="host", value=host, allowed=allowed) from error
        problem = f"cannot be listened at: {error.strerror}"
        raise ParameterError(problem, field="port", value=port, allowed="another --port, or 0") from error
