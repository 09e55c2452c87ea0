"""The data set: below its directory `verdicts/` and `recordings/`, a Parquet file of each for every recording.

A file appears only when it is whole, and one that cannot be read counts as none. The row of a recording carries the
digest of all that its result depends on, so it is known what is there already.
"""

import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from gateway.errors import GatewayError
from gateway.reprocess.job import Outcome
from gateway.verdict_columns import VERDICTS

OF_THE_SCAN = ("radials", pa.int64()), ("range_nm", pa.float64()), ("tilt_deg", pa.float64())
COLUMNS = pa.schema([("recording", pa.string()), *OF_THE_SCAN, *VERDICTS])
RECORDINGS = pa.schema(
    [
        ("recording", pa.string()),
        ("key", pa.string()),
        ("begins_utc_ns", pa.int64()),
        ("seconds", pa.float64()),
        ("records", pa.int64()),
        ("damaged", pa.int64()),
        ("missing", pa.int64()),
        ("torn", pa.string()),
        ("failures", pa.list_(pa.string())),
        ("counters", pa.list_(pa.struct([("name", pa.string()), ("count", pa.int64())]))),
    ]
)
ANSWERS = ("ok", "alert", "unavailable")
TABLES = ("recordings", "verdicts")
SAID = ["key", "seconds", "damaged", "missing", "torn", "failures"]  # of a recording, in the summary


class DataSet:
    """Results by the name of their recording."""

    def __init__(self, directory: Path) -> None:
        """Raises GatewayError if there can be no such directory."""
        self._directory = directory
        for table in TABLES:
            try:
                (directory / table).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise _refused(directory, error) from error

    def has(self, name: str, key: Callable[[], str]) -> bool:
        """Whether the result of a recording is there and still holds, which only then its key is asked for."""
        row = self._row(name)
        return row is not None and row["key"] == key()

    def put(self, name: str, outcome: Outcome) -> None:
        """Keep a result, instead of an older one. Raises GatewayError if the disk does not take it."""
        self._write(pa.Table.from_pylist(outcome.verdicts, COLUMNS), self._path("verdicts", name))
        self._write(pa.Table.from_pylist([outcome.whole], RECORDINGS), self._path("recordings", name))

    def names(self) -> list[str]:
        """Recordings that have results here, whether or not they can be read."""
        tables = [self._directory / table for table in TABLES]
        files = [(path, table) for table in tables for path in table.rglob("*.parquet") if path.is_file()]
        return sorted({path.relative_to(table).with_suffix("").as_posix() for path, table in files})

    def summary(self) -> tuple[list[dict[str, Any]], list[str]]:
        """What the data set says, and the recordings whose results cannot be read.

        A row a recording: seconds, scans by verdict, and what is wrong with the file.
        """
        rows = {name: self._row(name) for name in self.names()}
        return [row for row in rows.values() if row], [name for name, row in rows.items() if not row]

    def _row(self, name: str) -> dict[str, Any] | None:
        """What is said of a recording and its verdicts, counted; or None if not all of it is there and can be read."""
        try:
            (said,) = _read(self._path("recordings", name), SAID).to_pylist()
            verdicts = Counter(_read(self._path("verdicts", name), ["verdict"])["verdict"].to_pylist())
        except (OSError, LookupError, ValueError, pa.ArrowException):
            return None
        return {"recording": name, **said, **{verdict: verdicts[verdict] for verdict in ANSWERS}}

    def _path(self, table: str, name: str) -> Path:
        return self._directory / table / f"{name}.parquet"

    def _write(self, table: pa.Table, path: Path) -> None:
        part = path.with_suffix(".part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("wb") as file:
                # Of so few rows a dictionary makes larger files, and later.
                pq.write_table(table, file, use_dictionary=False, write_page_checksum=True)
                file.flush()
                os.fsync(file.fileno())  # or after a power cut the name is there and the content is not
            part.replace(path)
        except OSError as error:
            raise _refused(path, error) from error


def _read(path: Path, columns: list[str]) -> pa.Table:
    # Not by `read_table`, which imports pandas and takes half a second for it.
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        return file.read(columns).select(columns)  # `read` alone passes over a column that is not there


def _refused(path: Path, error: OSError) -> GatewayError:
    return GatewayError(f"cannot write {path}: {error.strerror or error}; choose another place with -o")
