"""Parquet and CSV, read back by duckdb and pandas."""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pandas as pd
import pytest

from decoders import formats as f
from gateway.exports.parquet import RADIALS, ROWS, Table
from gateway.words import STEP_NS
from simulators import arinc708, racklink
from tests.decoders.bus import word429
from tests.gateway.exports.recorded import Flown, To, record
from tests.gateway.live import replayed
from tests.gateway.made import GNSS, RACK, RADAR, Bridge, radial, raw
from tests.gateway.recording.disks import fill, needs_mount, small_disk

PAGE = Path(__file__).parents[3] / "docs" / "formats.md"
TEXT = {"label": str, "adapter": str, "name": str, "units": str, "status": str}


def query(sql: str) -> Any:
    """What duckdb answers."""
    return duckdb.sql(sql)


def table(path: Path, name: str) -> list[dict[str, Any]]:
    """All rows of a table in order, read by duckdb."""
    found = query(f"select * from '{path / name}.parquet'")
    return [dict(zip(found.columns, row, strict=True)) for row in found.fetchall()]


def test_every_word_is_a_row_with_its_time_and_its_value(flown: Flown, to: To) -> None:
    path, said = to(flown.path, "parquet")
    rows = table(path, "labels")
    assert said[0].startswith(f"{path}: {len(flown.words)} labels, {len(flown.radar)} radials, ")
    found = [(row["channel"], row["device_ns"], row["word"]) for row in rows]
    assert found == [(one.channel, one.time_ns, one.word) for one in flown.words]
    (ahead_ns,) = {row["utc_ns"] - row["device_ns"] for row in rows}
    assert 0 <= ahead_ns - flown.least_delay_ns <= STEP_NS
    headings = [row["value"] for row in rows if (row["channel"], row["label"]) == (1, "314")]
    assert np.abs(np.array(headings) - (flown.scenario.flight.heading_deg - 360)).max() < 1  # turbulence is 0.3 deg
    assert {row["units"] for row in rows if row["label"] == "314"} == {"deg"}


def test_a_word_without_a_value_has_none_and_says_why(tmp_path: Path, to: To) -> None:
    bridge = Bridge()
    good = word429(0o110, {9: (2**19, 20)}, ssm=3)
    sent = [
        bridge.hello(),
        bridge.words(GNSS, 1.0, [good, good ^ 1 << 31, word429(0o110, {}, ssm=1), word429(0o222, {}, ssm=3)]),
        bridge.words(GNSS, 1.1, [good], f.FLAG_SYNC),
        bridge.words(9, 1.2, [good]),
    ]
    path, _ = to(record(tmp_path / "r.mcap", RACK, [raw(0, 2.0, b"".join(sent))]), "parquet", without_terrain=True)
    found = [(row["label"], row["status"], row["value"], row["name"]) for row in table(path, "labels")]
    assert found == [
        ("110", "NORMAL", 90.0, "GNSS latitude"),
        ("110", "BAD_PARITY", None, "GNSS latitude"),
        ("110", "NO_COMPUTED_DATA", None, "GNSS latitude"),
        ("222", "UNKNOWN_LABEL", None, None),
        ("110", "SPOILT", None, None),
        ("110", "NO_DEFINITIONS", None, None),
    ]


@needs_mount
def test_a_disk_that_fills_up_between_two_row_groups_is_what_is_told(tmp_path: Path) -> None:
    noise = np.random.default_rng(1)  # which nothing makes smaller
    with small_disk(tmp_path / "disk", 1) as disk:
        fill(disk, 4096)
        with pytest.raises(OSError, match="No space left on device"), Table(disk / "radials.parquet", RADIALS) as table:
            for _ in range(ROWS + 1):
                table.add({"bins": noise.bytes(512)})


def test_csv_read_by_pandas_equals_the_parquet_table(flown: Flown, to: To) -> None:
    path, said = to(flown.path, "csv")
    assert said == [f"{path}: {len(flown.words)} ARINC 429 words; radar words have no place in it"]
    read = pd.read_csv(path, dtype=TEXT, keep_default_na=False, na_values={"value": [""]})
    parquet = pd.read_parquet(to(flown.path, "parquet", name="tables")[0] / "labels.parquet")
    assert [*read.columns] == [*parquet.columns]
    for name in read.columns:
        ours = parquet[name].astype(object).where(parquet[name].notna(), "" if name in TEXT else np.nan)
        assert np.array_equal(
            read[name].to_numpy(), ours.to_numpy(dtype=read[name].to_numpy().dtype), equal_nan=name == "value"
        ), name


def test_radials_have_the_fields_of_their_header_and_their_bins(tmp_path: Path, to: To) -> None:
    bridge, bins = Bridge(), np.arange(512) % 5
    whole = arinc708.encode(bins, scan_angle_deg=-90.0, tilt_deg=-3.25, range_nm=40.0)
    short = bridge.packet(f.WORD_708, RADAR, 1.2, racklink.word_708(whole[:50], 397), f.FLAG_WORD_LENGTH)
    sent = [bridge.hello(), bridge.radar(1.0, whole), bridge.radar(1.1, whole, f.FLAG_CODING), short]
    path, _ = to(record(tmp_path / "r.mcap", RACK, [raw(0, 2.0, b"".join(sent))]), "parquet", without_terrain=True)
    first, spoilt, cut = table(path, "radials")
    said = {"scan_angle_deg": -90.0, "tilt_deg": -3.25, "range_nm": 40.0, "mode_name": "map", "label": "055"}
    assert said.items() <= first.items()
    assert (first["device_ns"], first["bit_count"]) == (1_000_000_000, 1600)
    assert first["bins"] == bytes(bins.tolist())
    assert (spoilt["scan_angle_deg"], spoilt["bins"], spoilt["flags"]) == (None, None, f.FLAG_CODING)
    assert (cut["scan_angle_deg"], cut["bins"], cut["bit_count"]) == (-90.0, None, 397)


def test_verdicts_are_the_events_of_a_replay_and_disparities_make_their_statistic(flown: Flown, to: To) -> None:
    path, _ = to(flown.path, "parquet")
    events = [event for event in map(json.loads, replayed(flown.path)) if event["type"] == "integrity"]
    rows = table(path, "verdicts")
    assert len(rows) == 3
    for row, event in zip(rows, events, strict=True):
        assert row == {**{name: event[name] for name in row if name != "utc_ns"}, "utc_ns": event["time_ns"]}
    pairs = table(path, "disparities")
    for event in events:
        mine = [row for row in pairs if row["scan"] == event["scan"]]
        assert len(mine) == event["n_pairs"]
        d = [row["disparity_bins"] for row in mine]
        assert np.mean(np.square(d)) == pytest.approx(event["t_bins2"], rel=1e-12)
        assert d == [row["radar_centre_bin"] - row["terrain_centre_bin"] for row in mine]


def test_the_queries_of_the_page_run(flown: Flown, to: To, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    to(flown.path, "parquet", name="flight")
    monkeypatch.chdir(tmp_path)
    queries = re.findall(r"```sql\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(queries) == 2, "the page has two"
    for sql in queries:
        assert query(sql).fetchall()


def test_a_long_recording_becomes_row_groups_of_bounded_size(tmp_path: Path, to: To) -> None:
    bridge, word = Bridge(), word429(0o110, {}, ssm=3)
    chunk = bridge.hello() + b"".join(bridge.words(GNSS, 0.001 * k, [word] * 256) for k in range(300))
    chunk += b"".join(bridge.radar(0.001 * k, radial(0.0)) for k in range(4100))
    path, _ = to(record(tmp_path / "r.mcap", RACK, [raw(0, 9.0, chunk)]), "parquet", without_terrain=True)
    groups: Counter[str] = Counter()
    for name, most in (("labels", 65_536 + 255), ("radials", 4096)):
        meta = f"select distinct row_group_id, row_group_num_rows from parquet_metadata('{path / name}.parquet')"
        sizes = [rows for _, rows in query(meta).fetchall()]
        groups[name] = len(sizes)
        assert max(sizes) <= most
    assert groups == {"labels": 2, "radials": 2}
