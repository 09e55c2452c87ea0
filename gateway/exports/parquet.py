"""Parquet: a directory of tables, labels, radials, disparities and verdicts, in row groups of bounded size."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from decoders import arinc708
from decoders import formats as f
from gateway.events import IntegrityEvent
from gateway.exports import Job
from gateway.exports.labels import SCHEMA, batches
from gateway.exports.scans import Judged, judged, monitor_of
from gateway.link import SPOILT
from gateway.verdict_columns import VERDICTS
from gateway.words import Word708

ROWS = 4096  # of a row group whose rows are gathered one by one
RADIALS = pa.schema(
    [
        ("utc_ns", pa.int64()),
        ("device_ns", pa.int64()),
        ("adapter", pa.string()),
        ("channel", pa.uint8()),
        ("flags", pa.uint8()),
        ("bit_count", pa.uint16()),
        ("label", pa.string()),
        ("control_accept", pa.uint8()),
        ("slave", pa.bool_()),
        ("annunciations", pa.uint8()),
        ("faults", pa.uint8()),
        ("stabilised", pa.bool_()),
        ("mode", pa.uint8()),
        ("mode_name", pa.string()),
        ("tilt_deg", pa.float64()),
        ("gain_db", pa.float64()),
        ("gain_calibrated", pa.bool_()),
        ("range_nm", pa.float64()),
        ("data_accept", pa.uint8()),
        ("scan_angle_deg", pa.float64()),
        ("unusual", pa.uint8()),
        ("bins", pa.binary()),
    ]
)
DISPARITIES = pa.schema(
    [
        ("utc_ns", pa.int64()),
        ("scan", pa.int64()),
        ("scan_angle_deg", pa.float64()),
        ("radar_centre_bin", pa.float64()),
        ("terrain_centre_bin", pa.float64()),
        ("disparity_bins", pa.float64()),
    ]
)


class Table:
    """A table that is written as its rows come, a row group at a time."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self.rows = 0
        self._schema = schema
        self._writer = pq.ParquetWriter(path, schema, compression="zstd")
        self._held: list[dict[str, Any]] = []

    def __enter__(self) -> "Table":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._flush()
            self._writer.close()
            return
        with suppress(OSError, pa.ArrowException):  # which would hide the error under way
            self._writer.close()

    def add(self, row: dict[str, Any]) -> None:
        """Add a row; a column that it does not name is null."""
        self._held.append(row)
        if len(self._held) == ROWS:
            self._flush()

    def add_batch(self, batch: pa.RecordBatch) -> None:
        """Add rows as a row group of their own."""
        self._writer.write_batch(batch)
        self.rows += batch.num_rows

    def _flush(self) -> None:
        if self._held:
            self.add_batch(pa.RecordBatch.from_pylist(self._held, self._schema))
            self._held.clear()


def export(job: Job, path: Path) -> str:
    """Write the four tables; the recording is read once for the words and once for the verdicts."""
    monitor = monitor_of(job)
    path.mkdir()
    with Table(path / "labels.parquet", SCHEMA) as labels, Table(path / "radials.parquet", RADIALS) as radials:

        def words() -> Any:
            for item in job.words():
                if isinstance(item, Word708):
                    radials.add(radial_row(item))
                yield item

        for batch in batches(words()):
            labels.add_batch(batch)
    with Table(path / "disparities.parquet", DISPARITIES) as pairs, Table(path / "verdicts.parquet", VERDICTS) as said:
        for item in judged(job, monitor):
            if isinstance(item, IntegrityEvent):
                fields = vars(item)
                said.add({"utc_ns": item.time_ns, **{name: fields[name] for name in VERDICTS.names if name in fields}})
            else:
                for row in disparity_rows(item):
                    pairs.add(row)
    return f"{labels.rows} labels, {radials.rows} radials, {pairs.rows} disparities, {said.rows} verdicts"


def radial_row(word: Word708) -> dict[str, Any]:
    """A radar word as a row: header fields where it has a header, bins (a byte each) where it is whole."""
    row: dict[str, Any] = {
        name: getattr(word, name) for name in ("utc_ns", "device_ns", "adapter", "channel", "flags", "bit_count")
    }
    readable = word.bit_count >= 8 * f.HEADER_708_BYTES and not word.flags & SPOILT & ~f.FLAG_WORD_LENGTH
    if not word.reading or not readable:
        return row
    profile, array = word.reading.profile, np.frombuffer(word.data, np.uint8)[np.newaxis]
    header = arinc708.headers(array, profile)
    row |= {name: column[0].item() for name, column in header._asdict().items()}
    row["label"] = f"{row['label']:03o}"
    row["mode_name"] = profile.modes[row["mode"]]
    row["gain_calibrated"] = bool(np.isnan(row["gain_db"]))
    row["gain_db"] = None if row["gain_calibrated"] else row["gain_db"]
    if word.bit_count == profile.word_bits:
        radial = arinc708.unpack(array, profile)
        row |= {"unusual": int(radial.unusual[0]), "bins": radial.bins[0].tobytes()}
    return row


def disparity_rows(item: Judged) -> list[dict[str, Any]]:
    """The pairs of shadows of a scan."""
    compared = item.comparison
    if compared is None:
        return []
    columns = (
        compared.scan_angle_deg[compared.seen["radial"]],
        compared.seen["centre"],
        compared.predicted["centre"],
        compared.disparities,
    )
    here = int(item.utc_ns.max()), item.scan.number
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [dict(zip(DISPARITIES.names, (*here, *values), strict=True)) for values in rows]
