# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""Chunks of a sweep made by the workers of a Dask cluster; this process writes what they send.

The work goes to every worker once, as a plugin, also to those that join later. Only a few chunks are under way for each
thread, so memory stays flat. A chunk whose worker is lost goes to another one.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent import futures
from contextlib import contextmanager, suppress
from functools import partial
from secrets import token_hex
from typing import Any

from distributed import Client, WorkerPlugin, as_completed, get_worker
from distributed.scheduler import KilledWorker

from hsdsl.analysis.sweep.dataset import TRIES, Run, Work, Write, refuse_deadly
from hsdsl.base.errors import UsageError

AHEAD = 3  # chunks under way for each thread
CONNECTION_TIMEOUT = 10  # seconds
PAUSE = 1.0  # seconds until a worker that died may be gone


class SweepPlugin(WorkerPlugin):
    """The work of a sweep at a worker, compiled before the first chunk comes."""

    def __init__(self, name: str, work: Any) -> None:
        self.name, self.work = name, work

    def setup(self, worker: Any) -> None:
        """Compile; the workers of a machine share what one of them has compiled."""
        self.work.prepare()


def _answer(name: str, chunk: int) -> bytes:
    plugins, until = get_worker().plugins, time.monotonic() + CONNECTION_TIMEOUT
    while name not in plugins and time.monotonic() < until:
        time.sleep(0.05)  # a worker that was restarted is still compiling
    return plugins[name].work(chunk)


@contextmanager
def connected(address: str) -> Iterator[Run]:
    """Connect to a scheduler: what makes chunks there.

    Raises UsageError: there is no scheduler at this address, it is lost, or chunks end workers.
    """
    try:
        client = Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        hint = "start one with `dask scheduler`, and workers with `dask worker ADDRESS --nworkers -1`"
        raise UsageError(f"--cluster {address}: no scheduler answers there ({type(error).__name__})", hint) from None
    try:
        yield partial(_run, client)
    except (OSError, TimeoutError, asyncio.CancelledError, futures.CancelledError) as error:
        reason = f"the cluster at {address} is lost ({type(error).__name__}); what was done is kept"
        raise UsageError(reason, "the same command continues") from None
    finally:
        client.close()


def _run(client: Any, work: Work, chunks: Sequence[int], write: Write) -> None:
    name = f"hsdsl-sweep-{token_hex(8)}"
    _register(client, SweepPlugin(name, work))
    try:
        waiting = iter(chunks)
        deaths, under_way = Counter[int](), {}
        done = as_completed([], loop=client.loop)

        def submit(chunk: int) -> None:
            future = client.submit(_answer, name, chunk, pure=False, retries=2)
            under_way[future.key] = chunk
            done.add(future)

        def fill() -> None:
            room = AHEAD * max(1, sum(client.nthreads().values()))
            while len(under_way) < room and (chunk := next(waiting, None)) is not None:
                submit(chunk)

        fill()
        for future in done:
            chunk = under_way.pop(future.key)
            try:
                content = future.result()
            except KilledWorker:
                deaths[chunk] += 1
                refuse_deadly(deaths)
                submit(chunk)
            else:
                write(chunk, content)
                fill()
    finally:
        with suppress(OSError, TimeoutError):
            client.unregister_worker_plugin(name)


def _register(client: Any, plugin: SweepPlugin) -> None:
    """Send the work to every worker; one that dies meanwhile gets it when it is back."""
    for left in reversed(range(TRIES)):
        try:
            client.register_plugin(plugin, name=plugin.name)
            return
        except (OSError, TimeoutError):
            if not left:
                raise
            time.sleep(PAUSE)
