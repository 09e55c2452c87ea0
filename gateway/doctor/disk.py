"""Whether the disk takes a recording."""

import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import IO

from gateway.doctor.finding import Finding

MIB = 1 << 20
FREE_BYTES = 10 << 30  # hours of a full rack
SLOWEST_SYNC_S = 0.5
SUSTAINED_MIB = 8
SLOWEST_MIB_S = 4.0  # thirty radar buses without a pause


def room(directory: Path) -> Finding:
    """Free room where recordings are to go, which need not exist yet."""
    place = _nearest(directory)
    free = shutil.disk_usage(place).free
    return Finding("disk room", free >= FREE_BYTES, f"{free / 2**30:.1f} GiB free at {place}", "make 10 GiB of room")


def writes(directory: Path) -> Finding:
    """How long a small block takes to be safe on the disk, and what the disk takes in the long run."""
    place = _nearest(directory)
    try:
        with tempfile.NamedTemporaryFile(dir=place) as file:
            sync_s = _seconds(file, 1)
            rate_mib_s = SUSTAINED_MIB / _seconds(file, SUSTAINED_MIB)
    except OSError as error:
        return Finding("disk writes", False, f"{place}: {error.strerror}", "choose a directory you can write")
    good = sync_s < SLOWEST_SYNC_S and rate_mib_s > SLOWEST_MIB_S
    seen = f"1 MiB synchronised in {sync_s * 1e3:.1f} ms, {SUSTAINED_MIB} MiB at {rate_mib_s:.0f} MiB/s"
    return Finding("disk writes", good, seen, "record to a faster disk, with `directory` under [recording] or --record")


def _nearest(directory: Path) -> Path:
    return next(place for place in (directory.absolute(), *directory.absolute().parents) if place.exists())


def _seconds(file: IO[bytes], mib: int) -> float:
    block = os.urandom(MIB)  # which no file system can make smaller
    began = time.monotonic()
    for _ in range(mib):
        file.write(block)
    file.flush()
    os.fdatasync(file.fileno())
    return time.monotonic() - began
