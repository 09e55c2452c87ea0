"""Real file systems that can be filled, broken and forbidden, each mounted for one test."""

import fcntl
import os
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

EXT4_IOC_SHUTDOWN, NO_LOG_FLUSH = 0x8004587D, 2
needs_mount = pytest.mark.skipif(os.geteuid() != 0, reason="mounting a file system needs root")


def _run(*command: str | Path) -> None:
    subprocess.run([str(part) for part in command], check=True, capture_output=True)


def _mount(*arguments: str | Path) -> None:
    """Mount, or skip the test in a container that may not."""
    done = subprocess.run(["mount", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"nothing can be mounted here: {done.stderr.strip()}")


@contextmanager
def small_disk(place: Path, size_mib: int) -> Iterator[Path]:
    """A file system in memory of this size."""
    place.mkdir()
    _mount("-t", "tmpfs", "-o", f"size={size_mib}m", "none", place)
    try:
        yield place
    finally:
        _run("umount", "-l", place)


@contextmanager
def breaking_disk(place: Path) -> Iterator[Path]:
    """An ext4 on a loop device, for `break_down`."""
    image = place.with_suffix(".img")
    with image.open("wb") as file:
        file.truncate(8 << 20)
    _run("mkfs.ext4", "-q", image)
    place.mkdir()
    _mount("-o", "loop", image, place)
    try:
        yield place
    finally:
        _run("umount", "-l", place)


def break_down(disk: Path) -> None:
    """From now on the file system answers everything with an input/output error."""
    directory = os.open(disk, os.O_RDONLY)
    fcntl.ioctl(directory, EXT4_IOC_SHUTDOWN, struct.pack("I", NO_LOG_FLUSH))
    os.close(directory)


@contextmanager
def read_only(directory: Path) -> Iterator[None]:
    """Nothing can be made in this directory; what is open stays open."""
    _mount("--bind", directory, directory)
    _mount("-o", "remount,ro,bind", directory)
    try:
        yield
    finally:
        _run("umount", "-l", directory)


def fill(disk: Path, leave_bytes: int) -> Path:
    """Fill a disk with one file up to so much room."""
    ballast = disk / "ballast"
    free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, free - leave_bytes)
    return ballast
