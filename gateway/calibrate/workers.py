"""Work on all cores of this machine."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, TypeVar

from gateway.errors import GatewayError

Result = TypeVar("Result")


def on_all_cores(work: Callable[..., Result], *arguments: Iterable[Any]) -> Iterator[Result]:
    """What `map` gives, in order, from processes of their own.

    Raises what the work raised, and GatewayError if one of them dies.
    """
    context = get_context("forkserver")
    context.set_forkserver_preload([work.__module__])  # so that it is imported once
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), context) as pool:
        try:
            yield from pool.map(work, *arguments)
        except BrokenProcessPool as error:
            raise GatewayError("a process of ours was killed in its work: is the memory full?") from error
        finally:
            pool.shutdown(cancel_futures=True)
