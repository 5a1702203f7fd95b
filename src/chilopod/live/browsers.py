"""Ways to reach the browsers of a page from other threads than its server's."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import viser


def at_server(server: viser.ViserServer, do: Callable[[], None]) -> None:
    """Let the thread of the server do something, and wait for it.

    viser wakes those who send to browsers by an event of asyncio, which no other thread may touch: with two browsers it
    fails now and then.
    """

    async def done() -> None:
        do()

    asyncio.run_coroutine_threadsafe(done(), server.get_event_loop()).result()


def notify(server: viser.ViserServer, sentence: str, seconds: float | None = 8.0) -> None:
    """Show a sentence to all browsers, for some seconds or until it is closed by hand (None)."""

    def show() -> None:
        for client in server.get_clients().values():
            client.add_notification("chilopod", sentence, auto_close_seconds=seconds)

    at_server(server, show)
