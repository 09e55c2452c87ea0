"""ARINC 429 words as rows, in record batches of bounded size: what the Parquet and CSV tables of labels have in common.

A word without a value has none, whatever the reason: `status` says it. A label is octal as people write it.
"""

from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from decoders import arinc429
from decoders.arinc429 import Status
from decoders.definitions import Definitions
from gateway.link import SPOILT
from gateway.words import Block429, Item

ROWS = 65_536  # of a batch
SCHEMA = pa.schema(
    [
        ("utc_ns", pa.int64()),
        ("device_ns", pa.int64()),
        ("adapter", pa.string()),
        ("channel", pa.uint8()),
        ("label", pa.string()),
        ("name", pa.string()),
        ("value", pa.float64()),
        ("units", pa.string()),
        ("status", pa.string()),
        ("sdi", pa.uint8()),
        ("ssm", pa.uint8()),
        ("word", pa.uint32()),
        ("flags", pa.uint8()),
    ]
)
NO_DEFINITIONS, SPOILT_WORD = 7, 8  # behind the statuses of a decoded word
STATUSES = np.array([*(status.name for status in Status), "NO_DEFINITIONS", "SPOILT"], object)
OCTAL = np.array([f"{label:03o}" for label in range(256)], object)
Column = NDArray[np.generic] | NDArray[np.object_]


def batches(items: Iterable[Item]) -> Iterator[pa.RecordBatch]:
    """The rows of all ARINC 429 words among items, in order."""
    held: list[dict[str, Column]] = []
    count = 0
    for item in items:
        if isinstance(item, Block429) and len(item.words):
            held.append(_columns(item))
            count += len(item.words)
            if count >= ROWS:
                yield _batch(held)
                held, count = [], 0
    if held:
        yield _batch(held)


def _batch(held: list[dict[str, Column]]) -> pa.RecordBatch:
    whole = {name: np.concatenate([columns[name] for columns in held]) for name in held[0]}
    valued = whole.pop("valued")
    arrays = [pa.array(whole[one.name], one.type, mask=~valued if one.name == "value" else None) for one in SCHEMA]
    return pa.RecordBatch.from_arrays(arrays, schema=SCHEMA)


def _columns(block: Block429) -> dict[str, Column]:
    n = len(block.words)
    parts, values = arinc429.unpack(block.words, block.orientation), block.decoded()
    if values is None or block.reading is None:
        status = np.full(n, SPOILT_WORD if block.flags & SPOILT else NO_DEFINITIONS)
        value, names = np.zeros(n), np.full((2, n), None, object)
    else:
        status, value = values.status.astype(np.int64), values.value
        names = _names(block.reading.definitions)[:, values.label]
    return {
        "utc_ns": block.utc_ns,
        "device_ns": block.device_ns,
        "adapter": np.full(n, block.adapter, object),
        "channel": np.full(n, block.channel, np.uint8),
        "label": OCTAL[parts.label],
        "name": names[0],
        "value": value,
        "units": names[1],
        "status": STATUSES[status],
        "sdi": parts.sdi,
        "ssm": parts.ssm,
        "word": block.words,
        "flags": np.full(n, block.flags, np.uint8),
        "valued": status == Status.NORMAL,
    }


@cache
def _names(definitions: Definitions) -> NDArray[np.object_]:
    """Name and units of each label (2, 256); None for a label that the set does not have."""
    names = np.full((2, 256), None, object)
    for label, definition in definitions.labels.items():
        names[:, label] = definition.name, definition.units
    return names
