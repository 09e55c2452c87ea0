"""Compiled kernels find a place where neither the package nor the home directory takes them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PACKAGES = ("decoders", "gateway", "monitor", "simulators")


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A copy of the program that takes no cache, whoever runs it: where the cache would go lies a file."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.hgt"))
        (tmp_path / package / "__pycache__").touch()
    (tmp_path / "tmp").mkdir()
    return tmp_path


def dump(installed: Path, before: str = "true") -> str:
    """What a verb that loads every kernel says of a recording that is not there."""
    places = {"HOME": "/proc", "XDG_CACHE_HOME": "/proc/no", "TMPDIR": str(installed / "tmp"), "NUMBA_CACHE_DIR": ""}
    command = f"{before} && {sys.executable} -m gateway dump no.mcap"
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=installed,
        env=os.environ | places,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    return done.stderr


def test_kernels_go_to_a_temporary_directory_of_this_user(installed: Path) -> None:
    assert dump(installed) == "shadebus: cannot read recording no.mcap: No such file or directory\n"
    (made,) = (installed / "tmp").iterdir()
    assert made.name == f"shadebus-{os.geteuid()}"
    assert made.stat().st_mode & 0o777 == 0o700


def test_a_directory_that_others_can_write_is_not_trusted_and_the_mend_works(installed: Path) -> None:
    planted = installed / "tmp" / f"shadebus-{os.geteuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    complaint = dump(installed)
    assert complaint.startswith("shadebus: no directory takes the compiled kernels: ")
    mend = complaint.rpartition(": ")[2].strip()
    assert "cannot read recording" in dump(installed, mend)
    assert not [*planted.iterdir()]
