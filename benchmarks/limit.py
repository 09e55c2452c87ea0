"""The rival where a benchmark names a limit instead of a program."""

import time


def spin(seconds: float) -> None:
    """Last as long as the work may, more exactly than a sleep does."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass
