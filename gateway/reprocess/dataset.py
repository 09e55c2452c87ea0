"""The data set: below its directory `verdicts/` and `recordings/`, a Parquet file of each for every recording.

A file appears only when it is whole. The row of a recording carries the digest of all that its result depends on, so
it is known what is there already.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
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
        ("torn", pa.string()),
        ("failures", pa.list_(pa.string())),
        ("counters", pa.list_(pa.struct([("name", pa.string()), ("count", pa.int64())]))),
    ]
)
ANSWERS = ("ok", "alert", "unavailable")


class DataSet:
    """Results by the name of their recording."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def has(self, name: str, key: Callable[[], str]) -> bool:
        """Whether the result of a recording is there and still holds, which only then its key is asked for."""
        path = self._path("recordings", name)
        if not path.exists() or not self._path("verdicts", name).exists():
            return False
        found: list[str] = pq.read_table(path, columns=["key"])["key"].to_pylist()
        return found == [key()]

    def put(self, name: str, outcome: Outcome) -> None:
        """Keep a result, instead of an older one. Raises GatewayError if the disk does not take it."""
        self._write(pa.Table.from_pylist(outcome.verdicts, COLUMNS), self._path("verdicts", name))
        self._write(pa.Table.from_pylist([outcome.whole], RECORDINGS), self._path("recordings", name))

    def others(self, names: set[str]) -> list[str]:
        """Recordings that have results here and are none of these."""
        root = self._directory / "recordings"
        there = {path.relative_to(root).with_suffix("").as_posix() for path in root.rglob("*.parquet")}
        return sorted(there - names)

    def summary(self) -> list[dict[str, Any]]:
        """What the data set says, a row a recording: seconds, scans by verdict, and what is wrong with the file."""
        recordings = ds.dataset(self._directory / "recordings", RECORDINGS).to_table().sort_by("recording")
        verdicts = ds.dataset(self._directory / "verdicts").to_table(columns=["recording", "verdict"])
        counted = verdicts.group_by(["recording", "verdict"]).aggregate([([], "count_all")]).to_pylist()
        counts = {(row["recording"], row["verdict"]): row["count_all"] for row in counted}
        return [
            {**row, **{verdict: counts.get((row["recording"], verdict), 0) for verdict in ANSWERS}}
            for row in recordings.drop_columns(["counters"]).to_pylist()
        ]

    def _path(self, table: str, name: str) -> Path:
        return self._directory / table / f"{name}.parquet"

    def _write(self, table: pa.Table, path: Path) -> None:
        part = path.with_suffix(".part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            pq.write_table(table, part, use_dictionary=False)  # of so few rows it makes larger files, and later
            part.replace(path)
        except OSError as error:
            why = error.strerror or error
            raise GatewayError(f"cannot write {path}: {why}; choose another place with -o") from error
