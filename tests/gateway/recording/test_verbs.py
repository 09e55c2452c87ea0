"""verify, recover, cut and merge: what they say, what they write, and that it replays."""

import subprocess
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gateway.errors import GatewayError
from gateway.imports.plan import Wish
from gateway.imports.run import import_files
from gateway.metadata import recorded_config
from gateway.recording import Recorder, Recording
from gateway.recording.cutting import cut, moment
from gateway.recording.merging import merge
from gateway.recording.recover import recover
from gateway.recording.verify import verify
from gateway.records import Note, Raw, Record, Stamp, Status
from tests.gateway.live import replayed
from tests.gateway.made import UTC_NS, raw, stamp, status, tick
from tests.gateway.recording.disks import break_down, breaking_disk, fill, needs_mount, small_disk
from tests.gateway.recording.written import made
from tests.gateway.shell import WIDE, shadebus, within
from tests.gateway.vendor_files import rdr4b
from tests.golden.make import HERE

GOLDEN = HERE / "format2.mcap"


def test_a_sound_recording_is_called_so_and_its_notes_are_told() -> None:
    done = within("verify", GOLDEN)
    assert done.returncode == 0
    assert done.stdout.splitlines() == [
        "  record 170 says: UTC of the host stepped by +0.250 s",
        f"{GOLDEN}: 284 records in 1 files: sound",
    ]


def test_a_damaged_place_a_torn_end_and_a_gap_are_each_told(tmp_path: Path) -> None:
    data = bytearray(GOLDEN.read_bytes()[:70_000])
    data[40_000] ^= 1
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    found = verify(Recording(damaged))
    place, gap, torn = sorted(found.problems, key=lambda text: ("missing" in text, "ends" in text))
    assert "bytes from 39" in place or "bytes from 40" in place
    assert "the CRC of a raw chunk is wrong" in place
    assert "are missing" in torn or "are missing" in gap
    assert (found.count, found.missing) == (3, 1)
    done = within("verify", damaged, GOLDEN)
    assert done.returncode == 1
    assert "NOT sound: 3 problems, 1 records missing" in done.stdout
    assert done.stdout.splitlines()[-1] == f"{GOLDEN}: 284 records in 1 files: sound"


@pytest.mark.parametrize(
    ("records", "problem"),
    [
        ([tick(1, 0)], "records 0 to 0 are missing"),
        ([tick(0, 0), tick(5, 1)], "records 1 to 4 are missing"),
        ([tick(0, 0), tick(1, 1), tick(1, 2)], "record 1 comes where 2 is due"),
        ([tick(0, 5), tick(1, 1)], "the time of record 1 lies before"),
    ],
)
def test_sequences_and_times_are_looked_at(tmp_path: Path, records: list[Record], problem: str) -> None:
    found = verify(Recording(made(tmp_path / "a.mcap", records)))
    assert found.count == 1 and problem in found.problems[0]


def test_an_index_that_counts_wrong_is_told(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {})
    recorder.append([tick(0, 0)])
    recorder._writer._Writer__statistics.message_count = 7  # type: ignore[attr-defined] # as a defect might
    recorder.close()
    assert verify(Recording(recorder.path)).problems == [f"{recorder.path}: its index says 7 records, and there are 1"]


def test_a_torn_recording_is_recovered_with_its_metadata_and_a_note_and_never_over_another(tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(GOLDEN.read_bytes()[:60_000])
    before = list(Recording(torn))
    done = within("recover", torn)
    assert done.returncode == 0
    assert "written to" in done.stdout and "ends without its index" in done.stdout
    whole = Recording(tmp_path / "torn.recovered.mcap")
    *records, note = list(whole)
    assert records == before
    assert isinstance(note, Note) and note.sequence == records[-1].sequence + 1
    assert "its last" in note.text and "bytes are no whole record" in note.text
    assert not whole.torn and verify(whole).problems == []
    assert {key: whole.metadata[key] for key in Recording(GOLDEN).metadata} == Recording(GOLDEN).metadata
    again = within("recover", torn)
    assert again.returncode == 1
    assert "is there already: name another file with -o" in again.stderr


def test_what_damage_cost_is_in_the_note(tmp_path: Path) -> None:
    data = bytearray(GOLDEN.read_bytes())
    data[40_000] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    recording = Recording(tmp_path / "a.mcap")
    said = recover(recording, iter(recording), tmp_path / "b.mcap")
    assert "recovered 283 records from a.mcap; " in said
    assert "of a.mcap: the CRC of a raw chunk is wrong; 1 records are missing before or between others" in said


def test_records_that_come_again_are_recovered_once_and_the_result_is_sound(tmp_path: Path) -> None:
    once = [raw(k, k, b"x") if k % 2 else tick(k, k) for k in range(8)]
    recording = Recording(made(tmp_path / "a.mcap", [*once[:6], *once[2:6], *once[6:]]))
    said = recover(recording, iter(recording), tmp_path / "b.mcap")
    assert "recovered 8 records from a.mcap; 4 records came again or too late and are left out" in said
    whole = Recording(tmp_path / "b.mcap")
    assert list(whole)[:-1] == once
    assert verify(whole).problems == []


def test_a_sequence_that_nothing_vouches_for_leaves_no_record_out(tmp_path: Path) -> None:
    recording = Recording(made(tmp_path / "a.mcap", [raw(0, 0, b"x"), tick(900, 1), raw(2, 2, b"y")]))
    recover(recording, iter(recording), tmp_path / "b.mcap")
    assert [record.sequence for record in Recording(tmp_path / "b.mcap")][:3] == [0, 900, 2]


def test_of_several_recordings_each_is_verified_whatever_the_others_are(tmp_path: Path) -> None:
    good = made(tmp_path / "a.mcap", [tick(0, 0)])
    done = within("verify", tmp_path / "none.mcap", good)
    assert done.returncode == 1
    assert f"{tmp_path / 'none.mcap'}: NOT sound: cannot read" in done.stdout
    assert f"{good}: 1 records in 1 files: sound" in done.stdout


@needs_mount
def test_what_cannot_be_read_in_the_middle_does_not_keep_others_from_being_verified(tmp_path: Path) -> None:
    one, other = (made(tmp_path / name, [tick(0, 0)]) for name in ("a.mcap", "c.mcap"))
    (tmp_path / "a.0002.mcap").mkdir()
    with breaking_disk(tmp_path / "disk") as disk:
        broken = made(disk / "b.mcap", [raw(k, k, bytes(10_000)) for k in range(100)])
        subprocess.run(["sync", "-f", disk], check=True)
        Path("/proc/sys/vm/drop_caches").write_text("1")
        break_down(disk)
        done = within("verify", one, broken, other)
    assert (done.returncode, done.stderr) == (1, "")
    first, second, third = done.stdout.splitlines()
    assert first.startswith(f"{one}: NOT sound: cannot read recording {tmp_path / 'a.0002.mcap'}")
    assert second.startswith(f"{broken}: NOT sound: cannot read recording {broken}") and "Input/output error" in second
    assert third == f"{other}: 1 records in 1 files: sound"


def test_a_file_without_a_configuration_is_named_with_the_mend_and_one_without_a_record_is_not_recovered(
    tmp_path: Path,
) -> None:
    for name, records in (("empty.mcap", []), ("bare.mcap", [tick(0, 0)])):
        recorder = Recorder(tmp_path / name, {})
        recorder.append(records)
        recorder.close()
    bare = tmp_path / "bare.mcap"
    for command in (("replay", bare), ("simulate", "--from", bare), ("merge", bare, "-o", tmp_path / "new.mcap")):
        done = within(*command)
        assert done.returncode == 1
        told = "holds no configuration that this version understands: look for another copy, or update shadebus if"
        assert f"{bare} {told}" in done.stderr
    recording = Recording(tmp_path / "empty.mcap")
    with pytest.raises(GatewayError, match=r"empty\.mcap holds no whole record to recover: look for another copy"):
        recover(recording, iter(recording), tmp_path / "new.mcap")
    assert not (tmp_path / "new.mcap").exists()
    recover(Recording(bare), iter(Recording(bare)), tmp_path / "new.mcap")
    assert [record.sequence for record in Recording(tmp_path / "new.mcap")] == [0, 1]


def test_half_a_recording_is_not_left_behind(tmp_path: Path) -> None:
    def stopped() -> Callable[[], None]:
        raise SystemExit(130)

    recording = Recording(GOLDEN)
    with pytest.raises(SystemExit):
        recover(recording, (stopped() if k > 5 else record for k, record in enumerate(recording)), tmp_path / "b.mcap")  # type: ignore[misc] # it never gives that
    assert [*tmp_path.iterdir()] == []


@needs_mount
def test_a_disk_that_is_full_from_the_beginning_is_left_as_it_was_and_the_name_stays_free(tmp_path: Path) -> None:
    path = made(tmp_path / "a.mcap", [tick(0, 0), tick(1, 1)])
    (tmp_path / "in.bin").write_bytes(rdr4b((0, 0, bytes(200))))
    recording = Recording(path)
    work: list[Callable[[Path], object]] = [
        lambda out: recover(recording, iter(recording), out),
        lambda out: cut(recording, recording, None, 1.0, out),
        lambda out: merge([recording], out),
        lambda out: import_files(Wish([tmp_path / "in.bin"], "rdr4b"), out, iter),
    ]
    with small_disk(tmp_path / "disk", 1) as disk:
        for write in work:
            ballast = fill(disk, 0)
            with pytest.raises(GatewayError, match="new: No space left on device"):
                write(disk / "new")
            assert [*disk.iterdir()] == [ballast]
            ballast.unlink()
            write(disk / "new")
            assert verify(Recording(disk / "new")).problems == []
            (disk / "new").unlink()


def test_a_link_to_nothing_is_a_name_that_is_taken(tmp_path: Path) -> None:
    (tmp_path / "new").symlink_to(tmp_path / "nothing")
    with pytest.raises(GatewayError, match="new is there already: name another file with -o"):
        merge([Recording(GOLDEN)], tmp_path / "new")


BOTH = [
    ("2", "4.5", 2.0, 4.5),
    (None, "1", 0.0, 1.0),
    ("9", None, 9.0, 99.0),
    ("2026-05-28T20:26:42", "2026-05-28T22:26:44.5+02:00", 2.0, 4.5),
]


@pytest.mark.parametrize(("start", "stop", "from_s", "to_s"), BOTH)
def test_a_cut_holds_the_records_of_its_time_with_their_sequences(
    tmp_path: Path, start: str | None, stop: str | None, from_s: float, to_s: float
) -> None:
    recording = Recording(GOLDEN)
    begin, end = (moment(text) if text else None for text in (start, stop))
    count = cut(recording, recording, begin, end, tmp_path / "cut.mcap")
    begin_ns = next(iter(recording)).stamp.monotonic_ns
    wanted = [r for r in recording if from_s * 1e9 <= r.stamp.monotonic_ns - begin_ns <= to_s * 1e9]
    found = Recording(tmp_path / "cut.mcap")
    assert list(found) == wanted and len(wanted) == count
    assert verify(found).problems == []
    assert "of format2.mcap" in found.metadata["cut"]


def test_a_cut_by_utc_follows_its_steps(tmp_path: Path) -> None:
    back = Stamp(3_000_000_000, UTC_NS + 500_000_000)
    path = made(tmp_path / "a.mcap", [tick(0, 0), tick(1, 1), tick(2, 2), raw(3, 0, b"")._replace(stamp=back)])
    start = datetime.fromtimestamp(UTC_NS / 1e9, UTC)
    cut(Recording(path), Recording(path), start, start + timedelta(seconds=0.7), tmp_path / "b.mcap")
    assert [record.sequence for record in Recording(tmp_path / "b.mcap")] == [0, 3]


def test_cuts_that_are_wrong_name_the_mend_and_leave_no_file(tmp_path: Path) -> None:
    for more, words in (
        (("--start", "noon"), "'noon' is no time: write seconds, or UTC as"),
        (("--start", "99"), "has nothing from 99.0 to the end: `shadebus info` tells its times"),
    ):
        done = within("cut", GOLDEN, *more, "-o", tmp_path / "b.mcap")
        assert done.returncode == 1 and words in done.stderr
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    "text", ["nan", "inf", "-inf", "1e300", "9999-12-31T23:59:59-12:00", "0001-01-01T00:00:00+12:00"]
)
def test_what_no_clock_can_show_is_no_time(text: str) -> None:
    with pytest.raises(GatewayError, match="is no time: write seconds, or UTC as"):
        moment(text)


@pytest.mark.parametrize(
    ("start", "stop"), [("20", "10"), ("10", "10"), ("2026-05-28T20:26:45", "2026-05-28T20:26:44"), ("0", "-1")]
)
def test_a_stop_that_does_not_come_after_the_start_is_refused_by_name(tmp_path: Path, start: str, stop: str) -> None:
    with pytest.raises(GatewayError, match=r"--stop .* does not come after --start .*: give a later --stop"):
        cut(Recording(GOLDEN), Recording(GOLDEN), moment(start), moment(stop), tmp_path / "b.mcap")
    assert [*tmp_path.iterdir()] == []


def test_names_that_are_not_utf_8_are_written_so_that_all_can_read_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(WIDE, "PYTHONIOENCODING", "utf-8")  # as in most locales: standard output is strict
    path = tmp_path / "z\udcff.mcap"
    path.write_bytes(GOLDEN.read_bytes()[:60_000])
    for command, key in ((("recover",), "recovered"), (("cut", "--stop", "2"), "cut"), (("merge",), "merged")):
        verb, *more = command
        done = shadebus(verb, path, *more, "-o", tmp_path / f"{verb}\udcff.mcap")
        assert (done.returncode, f"{verb}\\udcff.mcap" in done.stdout) == (0, True), done.stderr
        made_of = Recording(tmp_path / f"{verb}\udcff.mcap")
        assert "z\\xff.mcap" in made_of.metadata[key]
        assert recorded_config(made_of.metadata).adapters
    assert [r.text for r in Recording(tmp_path / "recover\udcff.mcap") if isinstance(r, Note)][-1].isprintable()
    for verb in ("verify", "info"):
        done = shadebus(verb, path)
        assert "z\\udcff.mcap" in done.stdout and "Traceback" not in done.stderr


def test_a_name_that_a_library_cannot_take_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "z\udcff.tif").touch()
    for arguments in (
        ("replay", GOLDEN, "--dem", tmp_path / "z\udcff.tif"),
        ("export", GOLDEN, "--to", "csv", "-o", tmp_path / "z\udcff.csv"),
    ):
        done = shadebus(*arguments)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert "z\\xff." in done.stderr and done.stderr.endswith("take: rename it\n")


def test_a_cut_from_the_beginning_replays_to_the_first_events(tmp_path: Path) -> None:
    assert shadebus("cut", GOLDEN, "--stop", "5", "-o", tmp_path / "b.mcap").returncode == 0
    done = shadebus("replay", tmp_path / "b.mcap", "--json", cwd=HERE.parent.parent)
    golden = GOLDEN.with_suffix(".jsonl").read_text().splitlines()
    lines = done.stdout.splitlines()
    fed = [line for line in lines if '"type":"integrity"' in line or '"type":"state"' in line]
    assert len(fed) == 7 and fed[-1] not in golden, "the sweep that is open at the end of the cut is judged there"
    assert lines[:12] == golden[:12]
    assert any('"verdict":"ok"' in line for line in golden[:12])


def test_recordings_one_after_the_other_keep_their_adapter(tmp_path: Path) -> None:
    first = made(tmp_path / "a.mcap", [status(0, 0, "UP"), raw(1, 1, b"one")])
    second = made(tmp_path / "b.mcap", [status(0, 10, "UP"), raw(1, 11, b"two")])
    told = merge([Recording(second), Recording(first)], tmp_path / "c.mcap")
    assert told == ["4 records"]
    found = list(Recording(tmp_path / "c.mcap"))
    assert [record.sequence for record in found] == [0, 1, 2, 3]
    assert [record.data for record in found if isinstance(record, Raw)] == [b"one", b"two"]
    assert {record.adapter for record in found if isinstance(record, Raw | Status)} == {"bridge"}
    assert verify(Recording(tmp_path / "c.mcap")).problems == []


def test_racks_that_flew_together_are_laid_beside_each_other_by_utc_and_clashing_names_are_told(tmp_path: Path) -> None:
    first = made(tmp_path / "a.mcap", [raw(0, 1, b"1"), raw(1, 3, b"3")])
    later = [Stamp(s.monotonic_ns + 7_000_000_000, s.utc_ns) for s in (stamp(2), stamp(4))]
    second = made(
        tmp_path / "b.mcap",
        [Raw(k, when, "bridge", data) for k, (when, data) in enumerate(zip(later, (b"2", b"4"), strict=True))],
        adapters=[{"name": "bridge", "source": "udp:127.0.0.1:1"}],
    )
    told = merge([Recording(first), Recording(second)], tmp_path / "c.mcap")
    assert told == ["4 records", "adapter bridge of b.mcap is bridge-2 now: another one has its name"]
    merged = Recording(tmp_path / "c.mcap")
    found = [record for record in merged if isinstance(record, Raw)]
    assert [(r.adapter, r.data) for r in found] == [
        ("bridge", b"1"),
        ("bridge-2", b"2"),
        ("bridge", b"3"),
        ("bridge-2", b"4"),
    ]
    assert [r.stamp for r in found] == [stamp(k) for k in (1, 2, 3, 4)]
    config = recorded_config(merged.metadata)
    assert [(a.name, a.source) for a in config.adapters] == [("bridge", "serial:x"), ("bridge-2", "udp:127.0.0.1:1")]
    assert '"bridge-2.chunks":2' in replayed(tmp_path / "c.mcap")[-1]


def test_a_host_that_was_started_earlier_has_no_time_before_zero(tmp_path: Path) -> None:
    early = Stamp(50_000_000_000, UTC_NS - 100_000_000_000)
    first = made(tmp_path / "a.mcap", [raw(0, 1, b"1")])
    second = made(
        tmp_path / "b.mcap", [Raw(0, early, "other", b"0")], adapters=[{"name": "other", "source": "serial:y"}]
    )
    merge([Recording(first), Recording(second)], tmp_path / "c.mcap")
    found = list(Recording(tmp_path / "c.mcap"))
    assert [record.stamp.monotonic_ns for record in found] == [0, 101_000_000_000]


def test_configurations_that_contradict_each_other_are_named(tmp_path: Path) -> None:
    first = made(tmp_path / "a.mcap", [tick(0, 0)], monitor={"p_fa": 1e-3})
    second = made(tmp_path / "b.mcap", [tick(0, 1)], monitor={"p_fa": 1e-5})
    with pytest.raises(GatewayError, match=r"a\.mcap and b\.mcap were recorded with a different monitor"):
        merge([Recording(first), Recording(second)], tmp_path / "c.mcap")
    assert not (tmp_path / "c.mcap").exists()


def test_the_rack_with_terrain_gives_the_merged_recording_its_terrain(tmp_path: Path) -> None:
    plain = made(tmp_path / "a.mcap", [raw(0, 0, b"x")])
    assert shadebus("merge", plain, GOLDEN, "-o", tmp_path / "c.mcap").returncode == 0
    merged = Recording(tmp_path / "c.mcap")
    assert merged.metadata["terrain_checksum"] == Recording(GOLDEN).metadata["terrain_checksum"]
    done = shadebus("replay", tmp_path / "c.mcap", "--json", cwd=HERE.parent.parent)
    assert done.returncode == 0 and done.stdout.count('"verdict":"ok"') == 2


def test_info_tells_files_format_damage_and_how_the_disk_did(tmp_path: Path) -> None:
    data = bytearray(GOLDEN.read_bytes())
    data[40_000] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    text = within("info", tmp_path / "a.mcap").stdout
    rows = {row.split("│")[1].strip(): row.split("│")[2].strip() for row in text.splitlines() if row.startswith("│")}
    assert (rows["files"], rows["format"], rows["records"]) == (
        "a.mcap",
        "2",
        "283 whole, 1 damaged place, 1 missing record",
    )
    assert "of a.mcap: the CRC of a raw chunk is wrong" in rows["damage"]
    assert rows["disk"] == "nothing told"
