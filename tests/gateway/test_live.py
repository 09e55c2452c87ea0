"""Whatever comes down a real line, it is recorded as it came, and its replay says the same as the live run.

The comparison is made whenever a `Live` block ends.
"""

import random
import socket
import threading
from itertools import takewhile
from pathlib import Path

import pytest

from gateway import hearing
from monitor.calibration import uncalibrated
from simulators.outlets import PtyOutlet
from simulators.player import play
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live, raw_records, recorded_bytes, replayed, wait_until
from tests.gateway.made import Bridge
from tests.gateway.rfc2217_server import Server

FAST = 20.0


def test_a_flight_through_a_pseudo_terminal_is_recorded_whole_and_judged(
    flight: list[tuple[int, bytes]], stream: bytes, make_rack: MakeRack
) -> None:
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN])) as live:
        live.wait_for("status", state="UP")
        play(flight, line, FAST)
        live.wait_for_bytes(len(stream))
    assert recorded_bytes(live.path) == stream
    assert len(live.events("scan")) == 3
    assert [event["n_pairs"] > 0 for event in live.events("integrity")] == [True, True, True]
    assert [event["scan"] for event in live.events("integrity")] == [0, 1, 2]
    (summary,) = live.events("summary")
    assert summary["counters"]["bridge.packets"] == len(flight)
    assert summary["counters"]["bridge.packets_lost"] == 0
    assert summary["counters"]["bridge.skipped"] == 0
    assert live.service.failures == []


def test_a_calibration_for_another_radar_makes_every_verdict_unavailable_and_is_named(
    stream: bytes, make_rack: MakeRack, tmp_path: Path
) -> None:
    other = uncalibrated(256, 10.0, "arinc708").model_copy(update={"name": "another radar"})
    (tmp_path / "calibration.json").write_text(other.model_dump_json())
    with PtyOutlet() as line:
        rack = make_rack(f"serial:{line.path}", terrain=[TERRAIN], calibration=tmp_path / "calibration.json")
        with Live(rack) as live:
            live.wait_for("status", state="UP")
            line.write(stream)
            live.wait_for("integrity", count=2)
    for verdict in live.events("integrity"):
        assert (verdict["verdict"], verdict["calibration"]) == ("unavailable", "another radar")
        mend = "load one that was made for it, or none"
        assert f"calibration another radar is for 256 range bins, the radar sends 512: {mend}" in verdict["reasons"]


def test_every_event_has_type_time_and_the_sequence_of_its_record(stream: bytes, make_rack: MakeRack) -> None:
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}")) as live:
        live.wait_for("status", state="UP")
        line.write(stream)
        live.wait_for("state")
    known = {record.sequence: record.stamp.utc_ns for record in raw_records(live.path)}
    scans = live.events("scan")
    assert scans
    for scan in scans[:-1]:
        assert known[scan["sequence"]] == scan["time_ns"]
    sequences = [event["sequence"] for kind in ("status", "scan", "state") for event in live.events(kind)]
    assert set(sequences) <= set(range(max(sequences) + 1))


def test_garbage_between_packets_costs_no_packet_and_replays_the_same(
    flight: list[tuple[int, bytes]], make_rack: MakeRack
) -> None:
    noise = random.Random(3)
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN])) as live:
        live.wait_for("status", state="UP")
        sent = bytearray()
        for _, packet in flight:
            garbage = noise.randbytes(noise.randrange(60)).replace(b"\0", b"") if noise.random() < 0.3 else b""
            sent += garbage + b"\0" * bool(garbage) + packet
        line.write(bytes(sent))
        live.wait_for_bytes(len(sent))
    assert recorded_bytes(live.path) == sent
    counters = live.events("summary")[0]["counters"]
    assert counters["bridge.skipped"] > 1000
    assert counters["bridge.packets"] == len(flight)
    assert counters["bridge.packets_lost"] == 0


def test_a_line_that_is_cut_inside_a_packet_comes_back_and_the_loss_is_told(
    flight: list[tuple[int, bytes]], stream: bytes, make_rack: MakeRack, tmp_path: Path
) -> None:
    name, cut = tmp_path / "line", len(stream) // 2
    with PtyOutlet() as first, PtyOutlet() as second:
        name.symlink_to(first.path)
        with Live(make_rack(f"serial:{name}", terrain=[TERRAIN])) as live:
            live.wait_for("status", state="UP")
            first.write(stream[:cut])
            (tmp_path / "next").symlink_to(second.path)
            (tmp_path / "next").rename(name)
            first.close()
            live.wait_for("status", state="LOST")
            live.wait_for("status", count=2, state="UP")
            second.write(stream[cut + 300 :])
            live.wait_for_bytes(len(stream) - 300)
    assert recorded_bytes(live.path) == stream[:cut] + stream[cut + 300 :]
    states = [event["state"] for event in live.events("status", adapter="bridge")]
    assert states == ["OPENING", "UP", "LOST", "OPENING", "UP", "LOSS", "CLOSED"]
    assert live.events("summary")[0]["counters"]["bridge.packets_lost"] > 0
    reasons = [reason for event in live.events("integrity") for reason in event["reasons"]]
    assert sum("degraded: bridge LOST" in reason for reason in reasons) == 1
    assert sum("packets lost" in reason for reason in reasons) == 1


def test_a_server_that_hangs_up_and_comes_back_loses_no_byte_that_it_sent(stream: bytes, make_rack: MakeRack) -> None:
    pieces = [stream[k : k + 10_007] for k in range(0, 30_000, 10_007)]
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"serial:socket://127.0.0.1:{server.getsockname()[1]}"
        with Live(make_rack(address)) as live:
            for piece in pieces:
                client, _ = server.accept()
                client.sendall(piece)
                client.close()
            live.wait_for("status", count=3, state="LOST")
    assert recorded_bytes(live.path) == b"".join(pieces)


@pytest.mark.filterwarnings("ignore:set:DeprecationWarning")  # pyserial's own
def test_a_remote_line_is_recorded_like_a_near_one(stream: bytes, make_rack: MakeRack) -> None:
    with Server() as remote, Live(make_rack(f"serial:{remote.url}")) as live:
        remote.send(stream[:10_000])
        live.wait_for_bytes(10_000)
    assert recorded_bytes(live.path) == stream[:10_000]


def test_a_source_that_falls_quiet_is_told_and_heard_again(
    stream: bytes, make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hearing, "QUIET_NS", 1_200_000_000)
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN])) as live:
        live.wait_for("status", state="UP")
        line.write(stream)
        live.wait_for("status", state="QUIET", adapter="bridge")
        live.wait_for("status", state="QUIET", adapter="radar")
        line.write(stream)
        live.wait_for("status", state="HEARD", adapter="radar")
        live.wait_for_bytes(2 * len(stream))
    silent = [event for event in live.events("integrity") if any("no words" in reason for reason in event["reasons"])]
    assert [event["verdict"] for event in silent] == ["unavailable"]


def test_two_bridges_are_kept_apart(stream: bytes, make_rack: MakeRack) -> None:
    other = b"".join(Bridge().heartbeat(k) for k in range(500))
    with PtyOutlet() as left, PtyOutlet() as right:
        adapters = [{"name": f"{name}", "source": f"serial:{line.path}"} for name, line in (("l", left), ("r", right))]
        with Live(make_rack(adapters=adapters)) as live:
            live.wait_for("status", count=2, state="UP")
            writers = [
                threading.Thread(target=left.write, args=(stream,)),
                threading.Thread(target=right.write, args=(other,)),
            ]
            for writer in writers:
                writer.start()
            wait_until(lambda: recorded_bytes(live.path, "l") == stream, "left recorded")
            wait_until(lambda: recorded_bytes(live.path, "r") == other, "right recorded")
            for writer in writers:
                writer.join(10)
    counters = live.events("summary")[0]["counters"]
    assert counters["r.packets"] == 500


def test_a_device_that_is_not_there_yet_is_waited_for(stream: bytes, make_rack: MakeRack, tmp_path: Path) -> None:
    name = tmp_path / "line"
    with PtyOutlet() as line, Live(make_rack(f"serial:{name}", wait_for_devices=True)) as live:
        live.wait_for("status", state="LOST")
        name.symlink_to(line.path)
        live.wait_for("status", state="UP")
        line.write(stream)
        live.wait_for_bytes(len(stream))
    assert recorded_bytes(live.path) == stream


def test_a_torn_recording_replays_to_a_beginning_of_the_live_events(stream: bytes, make_rack: MakeRack) -> None:
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}", terrain=[TERRAIN])) as live:
        live.wait_for("status", state="UP")
        step = len(stream) // 8 + 1
        for start in range(0, len(stream), step):  # in pieces, so that cuts fall between records
            line.write(stream[start : start + step])
            live.wait_for_bytes(min(start + step, len(stream)))
    whole = live.path.read_bytes()
    torn = live.path.with_name("torn.mcap")
    cuts = sorted(random.Random(4).sample(range(3000, len(whole) - 3000), 6))
    lengths = []
    for cut in cuts:
        torn.write_bytes(whole[:cut])
        lines = replayed(torn)
        before_end = [text for text in lines if '"type":"summary"' not in text]
        common = list(takewhile(lambda pair: pair[0] == pair[1], zip(before_end, live.lines, strict=False)))
        assert len(common) >= len(before_end) - 2  # the open sweep ends where the file does: a scan and its verdict
        lengths.append(len(common))
    assert lengths == sorted(lengths)
    assert lengths[-1] > lengths[0]
