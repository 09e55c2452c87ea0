"""Work on all cores of this machine."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

Result = TypeVar("Result")


def on_all_cores(work: Callable[..., Result], *arguments: Iterable[Any]) -> Iterator[Result]:
    """What `map` gives, in order, from processes of their own. Raises what the work raised."""
    context = get_context("forkserver")
    context.set_forkserver_preload([work.__module__])  # so that it is imported once
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), context) as pool:
        try:
            yield from pool.map(work, *arguments)
        finally:
            pool.shutdown(cancel_futures=True)
