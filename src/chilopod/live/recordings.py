"""Recordings of the page, each handed out with a replay of it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import viser
import xarray as xr

from chilopod.errors import ChilopodError
from chilopod.live.gate import at_server, notify
from chilopod.netcdf import netcdf


class Recordings:
    """Recordings for a function, if there is one, and for the browser in ``wanted_by``, or for all if that is gone.

    ``undelivered`` has names and files of those that nobody took.
    """

    def __init__(self, server: viser.ViserServer, kept: Callable[[str, bytes, str], None] | None) -> None:
        self._server, self._kept = server, kept
        self.undelivered: list[tuple[str, bytes, str]] = []
        self.wanted_by: viser.ClientHandle | None = None
        self.over = False  #: True where no browser is waited for any more
        self._count = 0
        # Drawing a replay of minutes takes a moment, and the walk goes on.
        self._drawing = ThreadPoolExecutor(1, thread_name_prefix="chilopod recordings")

    def add(self, record: xr.Dataset) -> None:
        """Hand a record out, when its replay is drawn."""
        self._count += 1
        self._drawing.submit(self._hand_out, f"chilopod-live-{self._count}", record, self.wanted_by)

    def close(self) -> None:
        """Hand out what has been added."""
        self._drawing.shutdown()

    async def greet(self, client: viser.ClientHandle) -> None:
        """Give a browser the recordings that ended while none was connected."""
        while self.undelivered and not self.over:
            self._send(*self.undelivered.pop(0), client)

    def _hand_out(self, name: str, record: xr.Dataset, to: viser.ClientHandle | None) -> None:
        from chilopod.show import replay

        content = netcdf(record)
        page = replay(record, titles=["the robot"], heading="A walk recorded at the live page").html
        if self._kept is not None:
            try:
                self._kept(name, content, page)
            except ChilopodError as error:
                notify(self._server, str(error))
        elif self.over or not self._server.get_clients():
            self.undelivered.append((name, content, page))
        at_server(self._server, partial(self._send, name, content, page, to))

    def _send(self, name: str, content: bytes, page: str, to: viser.ClientHandle | None) -> None:
        clients = self._server.get_clients()
        if to is not None and to.client_id in clients:
            clients = {to.client_id: to}
        for client in clients.values():
            client.send_file_download(f"{name}.nc", content, save_immediately=True)
            client.send_file_download(f"{name}.html", page.encode(), save_immediately=True)
