"""Hand the recordings out to workers and keep what comes back; a worker that dies costs time and nothing else."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple

import dask
from distributed import Client, LocalCluster, as_completed

from gateway.errors import GatewayError
from gateway.reprocess.dataset import DataSet
from gateway.reprocess.job import Job, Outcome
from gateway.reprocess.workers import get_ready

LOCAL: Final = {
    "processes": True,
    "threads_per_worker": 1,
    "dashboard_address": None,
    "host": "127.0.0.1",
    "scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"},  # or a second run is told that the port is taken
}
SETTINGS: Final = {
    "distributed.worker.multiprocessing-method": "forkserver",
    "distributed.worker.profile.enabled": False,  # it looks at the stacks a hundred times a second
    "distributed.admin.tick.interval": "1s",  # instead of fifty times a second, in every process
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "1s",
}


class Done(NamedTuple):
    """How many results held already, which were made, and by recording why some could not be."""

    kept: int
    made: list[str]
    failed: dict[str, str]


def reprocess(jobs: Sequence[Job], data: DataSet, scheduler: str | None, progress: Callable[[int, int], None]) -> Done:
    """Bring the data set up to date. `progress` hears how many of how many jobs are done.

    Raises GatewayError if there is no scheduler at the address, or the disk does not take a result.
    """
    failed: dict[str, str] = {}
    due = [job for job in jobs if not _holds(job, data, failed)]
    kept, made = len(jobs) - len(due) - len(failed), list[str]()
    progress(len(jobs) - len(due), len(jobs))
    if not due:
        return Done(kept, made, failed)
    with _client(scheduler, len(due)) as client:
        of = {client.submit(attempt, job, pure=False): job for job in due}
        for future in as_completed(of):
            job = of[future]
            try:
                outcome = future.result()
            except Exception as error:  # noqa: BLE001 # such as a recording that ends every worker
                outcome = f"{type(error).__name__}: {error}"
            if isinstance(outcome, str):
                failed[job.name] = outcome
            else:
                data.put(job.name, outcome)
                made.append(job.name)
            future.release()
            progress(len(jobs) - len(due) + len(made) + len(failed), len(jobs))
    return Done(kept, sorted(made), failed)


def attempt(job: Job) -> Outcome | str:
    """The outcome of a job, or why there is none: whatever one recording brings up must not cost the others."""
    from gateway.reprocess.work import work  # noqa: PLC0415 # only a worker needs it, and has it already

    try:
        return work(job)
    except GatewayError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001
        return f"{type(error).__name__}: {error}"


def _holds(job: Job, data: DataSet, failed: dict[str, str]) -> bool:
    """Whether there is nothing to do for a job: its result holds, or it cannot be worked out."""

    def key_now() -> str:
        from gateway.reprocess.work import key  # noqa: PLC0415 # as above

        return key(job)

    try:
        return data.has(job.name, key_now)
    except GatewayError as error:
        failed[job.name] = str(error)
        return True


@contextmanager
def _client(scheduler: str | None, most: int) -> Iterator[Client]:
    """The cluster's client, or that of worker processes on all cores of this machine."""
    if scheduler:
        try:
            client = Client(scheduler, timeout="10s")
        except (OSError, TypeError, ValueError) as error:
            raise GatewayError(
                f"no Dask scheduler answers at {scheduler}: {error}; start dask scheduler and give the address that it "
                "prints, such as tcp://127.0.0.1:8786"
            ) from error
        with client:
            yield client
    else:
        get_ready()
        with dask.config.set(SETTINGS), LocalCluster(**LOCAL) as cluster:
            cluster.scale(min(most, len(cluster.workers)))
            with Client(cluster) as client:
                yield client
