"""Where compiled kernels are kept between starts; decided before numba is imported, which fails without a place."""

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
MEND = f"export {VARIABLE}=$(mktemp -d)"


def choose() -> None:
    """Name a directory in the temporary one to numba, if none of those that it looks at by itself can be written."""
    if place() is None:
        with contextlib.suppress(OSError):
            os.environ[VARIABLE] = str(_temporary())


def place() -> Path | None:
    """The first directory of numba's own list that can be written."""
    return next((path for path in _places() if _takes(path)), None)


def _places() -> Iterator[Path]:
    if os.environ.get(VARIABLE):
        yield Path(os.environ[VARIABLE])
    yield Path(__file__).parent.parent / "monitor" / "__pycache__"
    with contextlib.suppress(RuntimeError):  # a user without a home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"


def _takes(path: Path) -> bool:
    try:
        path.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError:
        return False
    return True


def _temporary() -> Path:
    """This user's own, since numba runs what it finds there. Raises OSError if somebody else has made it."""
    path = Path(tempfile.gettempdir()) / f"shadebus-{os.geteuid()}"
    path.mkdir(mode=0o700, exist_ok=True)
    seen = path.lstat()
    if not stat.S_ISDIR(seen.st_mode) or seen.st_uid != os.geteuid() or seen.st_mode & 0o022:
        raise PermissionError(f"{path} belongs to somebody else")
    return path
