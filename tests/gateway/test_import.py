"""Files of other recorders: their bytes are kept, and replay gives the words, times and verdicts that were in them."""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from gateway.adapters import make_adapter
from gateway.cli import app
from gateway.config import AdapterConfig, load_config
from gateway.errors import GatewayError
from gateway.events import Event, IntegrityEvent, ScanEvent, StateEvent, SummaryEvent
from gateway.imports.plan import Wish, channels_of, flags_of, utc_ns
from gateway.imports.records import Clock
from gateway.imports.run import import_files
from gateway.metadata import recorded_config
from gateway.recording import Recording
from gateway.records import Raw, Record, Tick
from tests.gateway.conftest import TERRAIN
from tests.gateway.importing import events, imported, notes, passing, pitch_word, summary
from tests.gateway.live import raw_records, recorded_bytes, records
from tests.gateway.made import only
from tests.gateway.shell import shadebus
from tests.gateway.vendor_files import Word, mxf, rdr4b, seqrecord, words_of
from tests.golden.make import HERE

CHANNELS = ("0=arinc708", "1=arinc429:iru_704", "2=arinc429:gnss_743a", "3=arinc429:ra_707")
START = "2026-05-28T12:00:00Z"
START_NS = 1_779_969_600_000_000_000
RACK = f"""
terrain = ["{TERRAIN}"]
[[adapters]]
name = "bridge"
source = "serial:/dev/x"
"""
PITCH_LSB = 180 / 2**14  # of label 324: 14 bits and sign, of +-180 degrees
FRAME = b"(1780000000.000100) can0 1601008B#8B800C6060E31600\n"
GOLDEN = HERE / "format2.mcap"
RADIAL = (0, 0, bytes(200))
GOOD = {"seqrecord": seqrecord(RADIAL) * 2, "mxf": mxf(RADIAL), "rdr4b": rdr4b(RADIAL), "candump": FRAME}


@pytest.fixture(scope="session")
def words(flight: list[tuple[int, bytes]]) -> list[Word]:
    return [*words_of(frame for _, frame in flight)]


@pytest.fixture
def rack(tmp_path: Path) -> Path:
    (tmp_path / "rack.toml").write_text(RACK)
    return tmp_path / "rack.toml"


def figures(found: list[Event]) -> list[tuple[object, ...]]:
    """What scans and verdicts say, apart from when and from reasons."""
    scans = [(e.scan, e.radials, e.sector, e.range_nm, e.tilt_deg, e.gaps) for e in only(ScanEvent, found)]
    verdicts = [(e.scan, e.n_pairs, e.t_bins2, e.q, e.verdict, e.threshold) for e in only(IntegrityEvent, found)]
    return [*scans, *verdicts]


def test_ballard_and_max_technologies_files_give_the_same_verdicts(
    words: list[Word], rack: Path, tmp_path: Path
) -> None:
    in_order = sorted(words, key=lambda word: word[1])
    channels = channels_of(CHANNELS)
    records_of_1_ns = b"".join(seqrecord((channel, 1000 * time_ns, data)) for channel, time_ns, data in in_order)
    wish = {"channels": channels, "rack": rack}
    ballard = imported(tmp_path, "seqrecord", records_of_1_ns, vendor={"tick_ns": 1}, **wish)
    first = events(ballard)
    ballard.unlink()
    files = [b"".join(mxf(word) for word in in_order if word[0] == channel) for channel in channels]
    second = events(imported(tmp_path, "mxf", *files, **wish))
    assert figures(first) == figures(second)
    told = only(IntegrityEvent, first)
    assert len(told) == 3
    assert min(verdict.n_pairs for verdict in told[:2]) > 20
    assert [scan.gaps for scan in only(ScanEvent, first)[:2]] == [0, 0]
    assert only(StateEvent, first)[-1].validity["latitude_deg"] == "NORMAL"


def test_what_was_in_the_file_is_in_the_recording_byte_for_byte(words: list[Word], tmp_path: Path) -> None:
    content = b"\x63" * 7 + b"".join(map(seqrecord, words[:500])) + b"\1\1\x0a\0torn"
    out = imported(tmp_path, "seqrecord", content)
    assert recorded_bytes(out, "seqrecord") == content
    assert notes(out)[-1] == f"imported file0.bin: {len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()}"


def test_times_of_the_card_become_stamps_and_values_come_at_them(tmp_path: Path) -> None:
    hour_us = 3600 * 10**6 + 2**32  # the clock of the card has passed 32 bits
    stream = b"".join(seqrecord((4, 50_000_000 * k, pitch_word(k * PITCH_LSB)), hour_us) for k in range(61))
    wish = {"channels": channels_of(["4=429:iru_704"]), "start_utc_ns": utc_ns(START)}
    out = imported(tmp_path, "seqrecord", stream, **wish)
    raw = raw_records(out)
    assert [record.stamp.monotonic_ns for record in raw] == [50_000_000 * k for k in range(61)]
    assert [record.stamp.utc_ns for record in raw] == [START_NS + 50_000_000 * k for k in range(61)]
    assert [record.data for record in raw] == [stream[at : at + 20] for at in range(0, len(stream), 20)]
    ticks = [record for record in records(out) if isinstance(record, Tick)]
    assert [tick.stamp.monotonic_ns for tick in ticks] == [10**9, 2 * 10**9, 3 * 10**9]
    states = only(StateEvent, events(out))
    assert [state.time_ns for state in states] == [START_NS + k * 10**9 for k in (1, 2, 3)]
    assert [state.values["pitch_deg"] for state in states] == pytest.approx([k * PITCH_LSB for k in (20, 40, 60)])


def test_a_tick_of_ones_own_is_taken(tmp_path: Path) -> None:
    stream = b"".join(seqrecord((4, k * 10**9, pitch_word(1.0))) for k in range(2))
    out = imported(tmp_path, "seqrecord", stream, vendor={"tick_ns": 16_000})
    assert [record.stamp.monotonic_ns for record in raw_records(out)] == [0, 16 * 10**9]


def test_a_pause_has_ticks_for_ten_seconds_and_none_thereafter(tmp_path: Path) -> None:
    stream = b"".join(seqrecord((4, k * 3600 * 10**9, pitch_word(1.0))) for k in range(2))
    ticks = [r.stamp.monotonic_ns for r in records(imported(tmp_path, "seqrecord", stream)) if isinstance(r, Tick)]
    assert ticks == [k * 10**9 for k in range(1, 11)]


def test_stamps_never_go_back_whatever_the_card_s_clock_does(tmp_path: Path) -> None:
    times_us = [5_000_000, 5_500_000, 5_300_000, 5_600_000, 0, 100_000, 2**63, 200_000]
    stream = b"".join(seqrecord((4, 0, pitch_word(1.0)), time_us) for time_us in times_us)
    out = imported(tmp_path, "seqrecord", stream, channels=channels_of(["4=arinc429:iru_704"]))
    stamps_us = [record.stamp.monotonic_ns // 1000 for record in raw_records(out)]
    # 5.3 s waits for 5.5 s; the clock begins anew at 0, leaps to the end of time and comes back; what comes behind a
    # pause is a chunk of its own
    assert stamps_us == [0, 500_000, 500_000, 600_000, 600_000, 700_000, 700_000]
    assert recorded_bytes(out, "seqrecord") == stream
    assert summary(out)["clock_restarts"] > 0


@given(st.lists(st.integers(0, 2**64 - 1) | st.integers(0, 10**10), max_size=30))
def test_no_times_take_the_stamps_out_of_order_or_range(times_ns: list[int]) -> None:
    clock, before = Clock(), 0
    for time_ns in times_ns:
        clock.advance(time_ns)
        assert before <= clock.elapsed_ns <= 2**62
        before = clock.elapsed_ns


def test_an_rdr_4b_s_words_are_said_to_be_timed_by_their_number(words: list[Word], tmp_path: Path) -> None:
    radar = b"".join(rdr4b(word) for word in words if len(word[2]) == 200)
    out = imported(tmp_path, "rdr4b", radar + b"torn", radar)
    count = 2 * len(radar) // 218
    assert notes(out)[0] == "assumed of rdr4b: the file has no times: 190 words a second, as if none were missing"
    found = summary(out)
    assert (found["rdr4b.words_708"], found["rdr4b.timed_by_count"]) == (count, count)
    assert found["rdr4b.skipped"] == 4
    last = raw_records(out)[-1].stamp.monotonic_ns
    assert last == round(1e9 * (count - 1) / 190)
    assert recorded_bytes(out, "rdr4b") == radar + b"torn" + radar


def test_a_byte_that_an_rdr_4b_s_file_lacks_shows_in_labels_that_no_radar_sends(
    words: list[Word], tmp_path: Path
) -> None:
    whole = [rdr4b(word) for word in words if len(word[2]) == 200]
    assert all(record[18] == 0b10110100 for record in whole), "octal 055, its most significant bit first on the wire"
    assert summary(imported(tmp_path, "rdr4b", b"".join(whole)))["rdr4b.words_of_unknown_label"] == 0
    missing = b"".join(whole[:5]) + b"".join(whole[5:])[1:]
    (tmp_path / "cut").mkdir()
    found = summary(imported(tmp_path / "cut", "rdr4b", missing))
    assert found["rdr4b.words_of_unknown_label"] > (len(whole) - 6) * 0.9


def test_another_rate_is_taken_and_said(tmp_path: Path) -> None:
    out = imported(tmp_path, "rdr4b", rdr4b((0, 0, bytes(200))) * 3, vendor={"words_per_s": 80.0})
    assert "80 words a second" in notes(out)[0]
    assert raw_records(out)[-1].stamp.monotonic_ns == 25_000_000


def test_errors_that_the_card_saw_are_counted_and_its_words_not_used(tmp_path: Path) -> None:
    good, bad = seqrecord((0, 0, bytes(200))), bytearray(seqrecord((0, 5 * 10**6, bytes(200))))
    bad[8] |= 0x10  # Manchester
    found = summary(imported(tmp_path, "seqrecord", good + bad))
    assert (found["seqrecord.words_708"], found["seqrecord.coding_error"], found["seqrecord.words_708_unused"]) == (
        2,
        1,
        1,
    )


@pytest.mark.parametrize("layout", ["seqrecord", "mxf", "rdr4b", "candump"])
@given(garbage=st.binary(min_size=1, max_size=3000))
def test_garbage_is_kept_counted_and_never_a_crash(
    layout: str, garbage: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Behind a good record, as garbage alone is refused."""
    content = GOOD[layout] + garbage
    channels = channels_of(["0=arinc708"])
    out = imported(tmp_path_factory.mktemp("garbage"), layout, content, channels=channels)
    assert only(SummaryEvent, events(out))
    if layout != "candump":
        assert b"".join(record.data for record in raw_records(out)) == content


def test_a_file_larger_than_a_block_is_cut_between_records(tmp_path: Path) -> None:
    stream = b"".join(seqrecord((4, k * 1000, pitch_word(1.0))) for k in range(60_000))  # 1.2 MB
    out = imported(tmp_path, "seqrecord", stream)
    assert recorded_bytes(out, "seqrecord") == stream
    assert max(len(record.data) for record in raw_records(out)) <= 2**16 + 252
    found = summary(out)
    assert (found["seqrecord.words_429"], found["seqrecord.skipped"]) == (60_000, 0)


def test_channels_and_masks_of_the_rack_file_are_taken_and_options_go_first(tmp_path: Path) -> None:
    rack = tmp_path / "rack.toml"
    rack.write_text(
        """
[[adapters]]
name = "bridge"
source = "serial:/dev/x"
[adapters.channels.1]
kind = "arinc429"
definitions = "gnss_743"
sdi = 1
[adapters.channels.2]
kind = "arinc708"
[adapters.vendor]
tick_ns = 16000
"""
    )
    wish = {"channels": channels_of(["1=arinc429:iru_704:label_swapped"]), "vendor": flags_of(["708.sync=0x80"])}
    out = imported(tmp_path, "seqrecord", seqrecord((1, 0, b"abcd")), rack=rack, **wish)
    (adapter,) = recorded_config(Recording(out).metadata).adapters
    assert (adapter.source, adapter.framing) == ("file:file0.bin", "seqrecord")
    assert [*adapter.channels] == [1, 2]
    first = adapter.channels[1]
    assert (first.definitions, first.orientation, first.sdi) == ("iru_704", "label_swapped", 1)
    assert (adapter.vendor.tick_ns, adapter.vendor.flags_708) == (16_000, {"sync": 0x80})


Arguments = list[str | Path]
Case = Callable[[Path], Arguments]


def file(directory: Path, content: bytes = b"x") -> Path:
    (directory / "in.bin").write_bytes(content)
    return directory / "in.bin"


MISTAKES: dict[str, tuple[Case, str]] = {
    "layout": (lambda d: [file(d), "--from", "tin"], "--from tin: use one of seqrecord, mxf, rdr4b, candump"),
    "no file": (lambda d: [d / "no.bin", "--from", "mxf"], "no.bin: No such file"),
    "directory": (lambda d: [d, "--from", "rdr4b"], "is not a file: write the data to one"),
    "empty": (lambda d: [file(d, b""), "--from", "rdr4b"], "in.bin is empty: look for another copy"),
    "no frames": (lambda d: [file(d), "--from", "candump"], "in.bin: no line is a frame, such as (1780000000.123456)"),
    "mxf channels": (
        lambda d: [file(d), "--from", "mxf"],
        "give a --channel for each file, in the same order (1 files",
    ),
    "channel": (lambda d: [file(d), "--from", "rdr4b", "--channel", "x"], "--channel x: write N=arinc429:SET"),
    "set": (lambda d: [file(d), "--from", "rdr4b", "--channel", "1=429:gps"], "no definitions 'gps'"),
    "twice": (
        lambda d: [file(d), "--from", "rdr4b", "--channel", "1=708", "--channel", "1=429"],
        "channel 1 is said twice",
    ),
    "rate": (lambda d: [file(d), "--from", "rdr4b", "--words-per-s", "1e-300"], "words_per_s: Input should be greater"),
    "tick": (lambda d: [file(d), "--from", "rdr4b", "--tick-ns", "5"], "--tick-ns: rdr4b has no use for it"),
    "flag": (lambda d: [file(d), "--from", "seqrecord", "--flag", "sync"], "--flag sync: write 429.NAME=MASK"),
    "flag twice": (
        lambda d: [file(d), "--from", "mxf", "--flag", "708.coding=1", "--flag", "708.coding=2"],
        "--flag 708.coding=2: 708.coding is said twice: leave one out",
    ),
    "random bytes": (
        lambda d: [file(d, b"\x9c" * 5000), "--from", "seqrecord"],
        "in.bin: no word could be read as seqrecord: the file begins with 9c 9c 9c 9c 9c 9c 9c 9c: name its own layout",
    ),
    "zeros": (
        lambda d: [file(d, bytes(5000)), "--from", "seqrecord"],
        "the file begins with zeros: look for another copy",
    ),
    "three bytes": (lambda d: [file(d, b"\1\2\3"), "--from", "rdr4b"], "as rdr4b: the file begins with 01 02 03: name"),
    "a recording": (
        lambda d: [GOLDEN, "--from", "seqrecord"],
        "is an MCAP file, as recordings are: `shadebus replay` takes it as it is",
    ),
    "a log": (
        lambda d: [file(d, FRAME * 9), "--from", "seqrecord"],
        "the file is a log of candump: import it --from candump",
    ),
    "one of two": (
        lambda d: [file(d), GOLDEN, "--from", "mxf", "--channel", "0=708", "--channel", "1=429"],
        "in.bin: no word could be read as mxf: the file begins with 78: name its own layout with --from",
    ),
    "flag name": (lambda d: [file(d), "--from", "seqrecord", "--flag", "429.odd=1"], "flags_429"),
    "utc": (lambda d: [file(d), "--from", "rdr4b", "--start-utc", "noon"], "--start-utc noon: write it as 2026"),
    "early": (lambda d: [file(d), "--from", "rdr4b", "--start-utc", "1960-01-01"], "name a time from 1970 to 2099"),
    "rack": (lambda d: [file(d), "--from", "rdr4b", "-c", d / "no.toml"], "no.toml: No such file"),
}


@pytest.mark.usefixtures("signals_left_alone")
@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_named_and_leaves_no_recording(case: str, tmp_path: Path) -> None:
    """In this process, as starting one for each would take long."""
    arguments, complaint = MISTAKES[case]
    command = ["import", *map(str, arguments(tmp_path)), "-o", str(tmp_path / "out.mcap")]
    error = CliRunner().invoke(app, command).exception
    assert isinstance(error, GatewayError)
    assert complaint in str(error)
    assert "\n" not in str(error)
    assert not (tmp_path / "out.mcap").exists()


def test_the_command_tells_what_it_found_and_overwrites_nothing(tmp_path: Path) -> None:
    content = seqrecord((4, 10**9, pitch_word(1.0))) * 2 + seqrecord((4, 0, pitch_word(1.0))) + b"torn"
    command: Arguments = ["import", file(tmp_path, content), "--from", "seqrecord", "-o", tmp_path / "out.mcap"]
    done = shadebus(*command)
    assert done.returncode == 0, done.stderr
    told = dict(line.split(" ") for line in done.stdout.splitlines())
    assert told == {
        "steps_back_in_time": "1",
        "seqrecord.received": "64",
        "seqrecord.framed": "60",
        "seqrecord.skipped": "4",
        "seqrecord.bad_records": "1",
        "seqrecord.words_429": "3",
    }
    before = (tmp_path / "out.mcap").read_bytes()
    again = shadebus(*command)
    assert again.returncode == 1
    assert "out.mcap is there already: name another file with -o" in again.stderr
    assert (tmp_path / "out.mcap").read_bytes() == before


def test_what_was_imported_is_no_line_to_listen_to() -> None:
    with pytest.raises(GatewayError, match="'file:x' is a file that was imported, no line: `shadebus replay` plays it"):
        make_adapter(AdapterConfig(name="a", source="file:x", framing="rdr4b"))


@pytest.mark.parametrize(("source", "framing"), [("file:x", "racklink"), ("serial:x", "rdr4b"), ("file:x", "bare708")])
def test_a_framing_that_the_source_cannot_have_is_refused(source: str, framing: str, tmp_path: Path) -> None:
    (tmp_path / "rack.toml").write_text(f'[[adapters]]\nname = "a"\nsource = "{source}"\nframing = "{framing}"\n')
    with pytest.raises(GatewayError, match=r"adapters\.0: "):
        load_config(tmp_path / "rack.toml")


def test_a_disk_that_is_full_is_named_and_nothing_half_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gateway.recording.whole.Recorder.append", full)
    with pytest.raises(GatewayError, match=r"cannot write .*out\.mcap: No space left on device; make room"):
        imported(tmp_path, "rdr4b", bytes(218))
    assert not (tmp_path / "out.mcap").exists()


def test_a_file_whose_name_is_not_utf_8_is_imported_under_one_that_is(tmp_path: Path) -> None:
    (tmp_path / "z\udcff.bin").write_bytes(rdr4b((0, 0, bytes(200))))
    import_files(Wish([tmp_path / "z\udcff.bin"], "rdr4b"), tmp_path / "out.mcap", passing)
    (adapter,) = recorded_config(Recording(tmp_path / "out.mcap").metadata).adapters
    assert adapter.source == "file:z\\xff.bin"
    assert notes(tmp_path / "out.mcap")[-1].startswith("imported z\\xff.bin: 218 bytes")


def test_an_import_that_is_stopped_leaves_nothing(tmp_path: Path) -> None:
    def stopped(items: Iterable[Record]) -> Iterator[Record]:
        yield next(iter(items))
        raise SystemExit(130)

    (tmp_path / "in.bin").write_bytes(bytes(218))
    with pytest.raises(SystemExit):
        import_files(Wish([tmp_path / "in.bin"], "rdr4b"), tmp_path / "out.mcap", stopped)
    assert [path.name for path in tmp_path.iterdir()] == ["in.bin"]


def test_an_imported_recording_is_raw_records_statuses_ticks_and_notes_in_order(
    words: list[Word], tmp_path: Path
) -> None:
    found = records(imported(tmp_path, "seqrecord", b"".join(map(seqrecord, sorted(words, key=lambda w: w[1])))))
    assert [record.sequence for record in found] == [*range(len(found))]
    stamps = [record.stamp.monotonic_ns for record in found]
    assert stamps == sorted(stamps)
    assert sum(isinstance(record, Raw) for record in found) > 100
