"""Where one sweep ends and the next begins, and what is counted inside it."""

from collections.abc import Sequence

import numpy as np
import pytest

from decoders.arinc708 import Radials
from monitor.scans import LONGEST_SWEEP, STUCK_NS, Scan, ScanBuilder

MS = 1_000_000
STEP_MS = 20
BEYOND_LIMITS = 0b10000  # header bit 17, the last of the five annunciations from bit 13


def radials(
    angles: Sequence[float], *, tilt_deg: float = -2.0, range_nm: float = 10.0, mode: int = 3, bins: int = 4
) -> Radials:
    n = len(angles)
    flags = np.zeros(n, np.uint8)
    return Radials(
        label=flags + 0o055,
        control_accept=flags,
        slave=flags.astype(bool),
        annunciations=flags,
        faults=flags,
        stabilised=flags.astype(bool) | True,
        mode=flags + np.uint8(mode),
        tilt_deg=np.full(n, tilt_deg),
        gain_db=np.zeros(n),
        range_nm=np.full(n, range_nm),
        data_accept=flags,
        scan_angle_deg=np.array(angles, float),
        bins=np.tile(np.arange(n, dtype=np.uint8)[:, None], bins),
        unusual=flags,
    )


class Sweeps:
    """Feeds a builder one radial every 20 ms and collects its scans."""

    def __init__(self) -> None:
        self.builder = ScanBuilder()
        self.now_ms = 0
        self.scans: list[Scan] = []

    def feed(self, some: Radials) -> "Sweeps":
        times = self.now_ms + STEP_MS * np.arange(len(some.scan_angle_deg), dtype=np.int64)
        self.now_ms = int(times[-1]) + STEP_MS
        self.scans += self.builder.feed(times * MS, some)
        return self

    def finish(self) -> list[Scan]:
        self.scans += self.builder.finish()
        return self.scans


def sectors(scans: Sequence[Scan]) -> list[tuple[float, float]]:
    return [scan.sector_deg for scan in scans]


def test_a_one_directional_radar_gives_a_scan_for_each_fly_back() -> None:
    sweep = list(range(-90, 91, 3))
    scans = Sweeps().feed(radials(sweep * 3)).finish()
    assert [scan.scan_angle_deg.tolist() for scan in scans] == [sweep] * 3
    assert [scan.number for scan in scans] == [0, 1, 2]
    assert [(scan.missing, scan.repeated) for scan in scans] == [(0, 0)] * 3


def test_a_fly_back_over_more_than_half_a_turn_is_seen_though_it_wraps_to_the_same_direction() -> None:
    sweep = list(range(-120, 121, 3))
    assert sectors(Sweeps().feed(radials(sweep * 2)).finish()) == [(-120, 120)] * 2


def test_a_jump_of_more_than_30_degrees_ends_the_sweep_and_a_smaller_one_is_missing_radials() -> None:
    first, second = Sweeps().feed(radials([0, 3, 6, 9, 39, 42, 73, 76])).finish()
    assert (first.sector_deg, first.missing) == ((0, 42), 9)
    assert (second.sector_deg, second.missing) == ((73, 76), 0)


def test_a_to_and_fro_radar_gives_a_scan_for_each_direction() -> None:
    there = list(range(-60, 61, 3))
    scans = Sweeps().feed(radials(there + there[-2::-1] + there[1:])).finish()
    assert sectors(scans) == [(-60, 60), (-60, 57), (-57, 60)]
    assert [(scan.missing, scan.repeated) for scan in scans] == [(0, 0)] * 3


def test_a_radial_sent_again_at_the_turn_is_a_repeat_and_no_scan() -> None:
    there = list(range(-30, 31, 3))
    scans = Sweeps().feed(radials(there + there[::-1])).finish()
    assert [scan.repeated for scan in scans] == [1, 0]


def test_a_sweep_across_the_tail_is_one_scan() -> None:
    scans = Sweeps().feed(radials([170, 175, -180, -175, -170])).finish()
    assert [scan.scan_angle_deg.size for scan in scans] == [5]
    assert scans[0].missing == 0


def test_missing_and_repeated_radials_are_counted_from_the_usual_step() -> None:
    angles = [0.0, 0.5, 1.0, 2.5, 3.0, 3.0, 3.0, 3.5, 4.5, 5.0]
    (scan,) = Sweeps().feed(radials(angles)).finish()
    assert (scan.missing, scan.repeated) == (3, 2)


@pytest.mark.parametrize(
    "other",
    [
        radials([6, 9], tilt_deg=-3.0),
        radials([6, 9], range_nm=20.0),
        radials([6, 9], mode=1),
        radials([6, 9])._replace(stabilised=np.zeros(2, bool)),
        radials([6, 9], bins=8),
    ],
)
def test_a_change_of_the_radar_s_settings_ends_the_sweep(other: Radials) -> None:
    scans = Sweeps().feed(radials([0, 3])).feed(other).finish()
    assert sectors(scans) == [(0, 3), (6, 9)]


def test_a_scan_carries_the_settings_that_its_radials_had() -> None:
    sweeps = Sweeps().feed(radials([0, 3], tilt_deg=-2.25, range_nm=40.0, mode=3, bins=6))
    first, second = sweeps.feed(radials([6, 9], tilt_deg=1.0, mode=1)).finish()
    assert (first.tilt_deg, first.range_nm, first.mode, first.bins.shape) == (-2.25, 40.0, 3, (2, 6))
    assert (second.tilt_deg, second.mode, second.stabilised) == (1.0, 1, True)
    assert first.time_ns.tolist() == [0, 20 * MS]
    assert second.time_ns.tolist() == [40 * MS, 60 * MS]


def test_each_radial_keeps_its_bins_and_its_beyond_limits_bit() -> None:
    some = radials([0, 3, 6])
    some.annunciations[:] = [0b01111, BEYOND_LIMITS, 0]
    (scan,) = Sweeps().feed(some).finish()
    assert scan.beyond_limits.tolist() == [False, True, False]
    assert scan.bins[:, 0].tolist() == [0, 1, 2]


def test_a_silence_ends_the_sweep() -> None:
    sweeps = Sweeps().feed(radials([0, 3]))
    sweeps.now_ms += 2000
    assert sectors(sweeps.feed(radials([6, 9])).finish()) == [(0, 3), (6, 9)]


def test_a_clock_that_steps_back_ends_the_sweep() -> None:
    sweeps = Sweeps().feed(radials([0, 3]))
    sweeps.now_ms = 0
    assert sectors(sweeps.feed(radials([6, 9])).finish()) == [(0, 3), (6, 9)]


def test_nothing_fed_is_no_scan() -> None:
    assert not list(ScanBuilder().finish())


def test_blocks_of_any_size_give_the_same_scans() -> None:
    angles = [*range(-30, 31, 3), *range(27, -31, -3), *range(-30, 31, 3)]
    whole = Sweeps().feed(radials(angles)).finish()
    one_by_one = Sweeps()
    for angle in angles:
        one_by_one.feed(radials([angle]))
    assert sectors(one_by_one.finish()) == sectors(whole)
    assert [scan.time_ns.tolist() for scan in one_by_one.scans] == [scan.time_ns.tolist() for scan in whole]


def test_a_stuck_scanner_gives_a_scan_every_two_seconds_that_says_so() -> None:
    rows = 2 * STUCK_NS // (STEP_MS * MS) + 30
    scans = Sweeps().feed(radials([12.0] * rows)).finish()
    per_scan = STUCK_NS // (STEP_MS * MS) + 1
    assert [scan.scan_angle_deg.size for scan in scans] == [per_scan, per_scan, 28]
    assert all(scan.repeated == scan.scan_angle_deg.size - 1 for scan in scans)


def test_a_rest_where_the_antenna_turns_back_is_no_stuck_scanner() -> None:
    rest = [60.0] * (STUCK_NS // (STEP_MS * MS) // 2)
    scans = Sweeps().feed(radials([*np.arange(0.0, 60.0), *rest, *np.arange(59.0, 0.0, -1)])).finish()
    assert len(scans) == 2


def test_an_antenna_that_spins_gives_scans_of_bounded_length() -> None:
    angles = np.arange(2 * LONGEST_SWEEP) * 0.5
    scans = Sweeps().feed(radials(list((angles + 180) % 360 - 180))).finish()
    assert [scan.scan_angle_deg.size for scan in scans] == [LONGEST_SWEEP] * 2


def test_a_scan_that_never_came_has_a_number_of_its_own() -> None:
    sweeps = Sweeps().feed(radials([0, 1, 2]))
    (first,) = sweeps.finish()
    assert sweeps.builder.skip() == first.number + 1
    sweeps.feed(radials([0, 1, 2]))
    assert [scan.number for scan in sweeps.finish()] == [0, 2]
