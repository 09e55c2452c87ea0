"""Where one sweep ends and the next begins, and what is counted inside it."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from decoders.arinc708 import Radials, unpack
from monitor.scans import ANGLE_BIT, ANGLE_BITS, LONGEST_SWEEP, STUCK_NS, Scan, ScanBuilder, SweepWatch
from simulators import arinc708

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


def test_a_scan_tells_by_which_profile_its_words_were_read() -> None:
    builder = ScanBuilder()
    times = np.arange(20) * 20_000_000
    found = [*builder.feed(times, radials([*range(-10, 10)]), "one")]
    found += [*builder.feed(times + 400_000_000, radials([*range(9, -11, -1)], tilt_deg=3.0), "other")]
    found += [*builder.finish()]
    assert [scan.profile for scan in found] == ["one", "other"]


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


LSB = 360 / 4096
FULL = list(range(-60, 61, 3))
TO_AND_FRO = [*FULL, *FULL[-2::-1], *FULL[1:], *FULL[-2::-1]]


@pytest.mark.parametrize("step_codes", [1, 2, 6, 12])
def test_an_angle_that_trembles_by_one_code_neither_turns_nor_counts(step_codes: int) -> None:
    codes = np.arange(-300, 301, step_codes)
    tremble = np.where(np.arange(codes.size) % 3 == 1, -1, 0) if step_codes > 1 else 0
    scans = Sweeps().feed(radials(list((codes + tremble) * LSB))).finish()
    assert [(scan.scan_angle_deg.size, scan.missing) for scan in scans] == [(codes.size, 0)]


def test_a_backward_tremble_at_every_other_radial_of_the_smallest_step_is_one_sweep() -> None:
    codes = [code for k in range(100) for code in (k, k - 1)]
    assert len(Sweeps().feed(radials([code * LSB for code in codes])).finish()) == 1


@pytest.mark.parametrize("step_codes", [1.0, 2.0, 2.28, 2.4, 2.7, 5.69, 11.38, 34.13])
@pytest.mark.parametrize("lost", [0, 1, 3])
def test_a_step_that_is_no_whole_number_of_codes_has_no_more_missing_than_are_lost(
    step_codes: float, lost: int
) -> None:
    codes = np.rint(np.arange(-100, 101) * step_codes)
    (scan,) = Sweeps().feed(radials(list(np.delete(codes, slice(70, 70 + lost)) * LSB))).finish()
    assert scan.missing == lost


@pytest.mark.parametrize("angles", [[0, 3, 9], [0, 3, 9, 15, 18]])
def test_of_steps_half_of_which_are_twice_as_long_the_shorter_is_the_usual_one(angles: list[float]) -> None:
    (scan,) = Sweeps().feed(radials(angles)).finish()
    assert scan.missing == len(angles) // 2


@pytest.mark.parametrize("codes", [2, 3])
def test_a_retreat_of_more_than_one_code_is_a_turn(codes: int) -> None:
    scans = Sweeps().feed(radials([0, 1, 2, 3, 3 - codes * LSB, 3 - 2 * codes * LSB])).finish()
    assert [scan.scan_angle_deg.size for scan in scans] == [4, 2]


def test_a_stuck_scanner_that_trembles_is_told_like_one_that_does_not() -> None:
    rows = 2 * STUCK_NS // (STEP_MS * MS) + 30
    scans = Sweeps().feed(radials([12.0 + LSB * (k % 2) for k in range(rows)])).finish()
    per_scan = STUCK_NS // (STEP_MS * MS) + 1
    assert [scan.scan_angle_deg.size for scan in scans] == [per_scan, per_scan, 28]
    assert [scan.repeated for scan in scans[:2]] == [per_scan - 1] * 2


def test_a_scanner_that_sticks_in_mid_sweep_is_told_after_two_seconds_with_the_radials_it_stood_for() -> None:
    rest = STUCK_NS // (STEP_MS * MS)
    moving = list(np.arange(0.0, 30.0))
    first, second = Sweeps().feed(radials([*moving, *[29.0] * (rest + 20)])).finish()
    assert (first.scan_angle_deg.size, first.repeated) == (30 + rest, rest)
    assert (second.scan_angle_deg.size, second.repeated) == (20, 19)


@pytest.mark.parametrize(
    ("lost", "sizes"),
    [
        ([60], [41, 39, 40, 40]),  # 57 comes twice, the second a repeat
        ([57, 60], [40, 39, 40, 40]),
        ([60, 54], [40, 39, 40, 40]),
    ],
)
def test_radials_lost_at_the_turn_leave_the_turn_where_it_was(lost: list[int], sizes: list[int]) -> None:
    """The first time that each angle comes it is lost; 57 and 54 come again on the way back."""
    angles = list(TO_AND_FRO)
    for angle in lost:
        angles.remove(angle)
    scans = Sweeps().feed(radials(angles)).finish()
    assert [scan.scan_angle_deg.size for scan in scans] == sizes
    assert all(scan.sector_deg[0] in (-60, -57) for scan in scans)


def test_a_radial_twice_because_those_around_the_turn_are_lost_is_a_repeat() -> None:
    first, second = Sweeps().feed(radials([0, 3, 6, 9, 9, 6, 3, 0])).finish()
    assert (first.scan_angle_deg.tolist(), first.repeated) == ([0, 3, 6, 9, 9], 1)
    assert second.scan_angle_deg.tolist() == [6, 3, 0]


def test_whole_sweeps_of_a_steady_radar_lose_nothing_at_their_ends() -> None:
    for angles in (TO_AND_FRO * 2, FULL * 5, [*range(-120, 121, 3)] * 3):
        scans = Sweeps().feed(radials(angles)).finish()
        assert len(scans) > 2
        assert [scan.cut_off for scan in scans] == [0] * len(scans)


@pytest.mark.parametrize(("cut", "told"), [(0, 0), (1, 0), (2, 2), (7, 7)])
def test_coverage_lost_at_the_end_of_a_fly_back_sweep_is_counted_against_the_sweep_before(cut: int, told: int) -> None:
    end = len(FULL) - cut
    scans = Sweeps().feed(radials([*FULL, *FULL, *FULL[:end], *FULL, *FULL])).finish()
    assert [scan.cut_off for scan in scans] == [0, 0, told, 0, 0]
    scans = Sweeps().feed(radials([*FULL, *FULL, *FULL[cut:], *FULL, *FULL])).finish()
    assert [scan.cut_off for scan in scans] == [0, 0, told, 0, 0]


def test_coverage_lost_around_a_turn_is_counted_on_both_sides_of_it() -> None:
    back = FULL[-2::-1]
    angles = [*FULL, *back, *FULL[1:-5], *back[5:], *FULL[1:], *back]
    scans = Sweeps().feed(radials(angles)).finish()
    assert sectors(scans)[2:4] == [(-57, 45), (-60, 42)]
    # the fourth is compared with the third, which ended as early
    assert [scan.cut_off for scan in scans] == [0, 0, 4, 0, 0, 0]


def test_a_sector_that_narrows_is_told_once_and_one_that_widens_is_not() -> None:
    narrow = list(range(-30, 31, 3))
    scans = Sweeps().feed(radials(FULL * 2 + narrow * 3 + FULL * 2)).finish()
    assert [scan.cut_off for scan in scans] == [0, 0, 20, 0, 0, 0, 0]
    assert sectors(scans)[2:4] == [(-30, 30)] * 2


def test_a_sweep_cut_by_a_change_of_settings_or_a_silence_is_no_measure_for_its_ends() -> None:
    sweeps = Sweeps().feed(radials(FULL * 2))
    sweeps.feed(radials(FULL[:20])).feed(radials(FULL[20:], tilt_deg=5.0)).feed(radials(FULL * 2, tilt_deg=5.0))
    sweeps.feed(radials(FULL[:20], tilt_deg=5.0))
    sweeps.now_ms += 3000
    assert [scan.cut_off for scan in sweeps.feed(radials(FULL[20:] + FULL * 2)).finish()] == [0] * 10


def test_thirty_degrees_lost_in_mid_sweep_make_two_sweeps_whose_ends_tell() -> None:
    scans = Sweeps().feed(radials(FULL * 2 + [angle for angle in FULL if not 0 <= angle <= 30] + FULL)).finish()
    assert sectors(scans)[2:4] == [(-60, -3), (33, 60)]
    assert scans[2].cut_off == 21


def test_a_sweep_across_the_tail_has_its_ends_beyond_180() -> None:
    around = [170, 175, -180, -175, -170]
    scans = Sweeps().feed(radials([*around, *around[-2::-1], *around[1:]])).finish()
    assert sectors(scans) == [(170, 190), (-190, -175), (175, 190)]
    assert [scan.cut_off for scan in scans] == [0, 0, 0]


def test_a_radar_that_changes_its_tilt_with_each_sweep_has_its_ends_compared_all_the_same() -> None:
    sweeps = Sweeps()
    for k, angles in enumerate([FULL, FULL, FULL[:-4], FULL, FULL]):
        sweeps.feed(radials(angles, tilt_deg=float(k % 2)))
    assert [scan.cut_off for scan in sweeps.finish()] == [0, 0, 4, 0, 0]


STEPS_CODES = st.one_of(st.sampled_from([-6, 6]), st.integers(-8, 8), st.integers(-700, 700))
CODES = 1 << ANGLE_BITS


@given(st.lists(st.tuples(STEPS_CODES, st.sampled_from([STEP_MS, 400, 900, 1100]), st.booleans()), max_size=60))
@example([(6, STEP_MS, False), (-1, 400, False), (2, 900, False), (-1, 900, False), (2, 900, False)])
def test_a_radial_that_certainly_goes_on_never_ends_a_sweep(steps: list[tuple[int, int, bool]]) -> None:
    watch, builder, code, now_ns, tilt_deg = SweepWatch(), ScanBuilder(), 0, 0, -2.0
    for step, after_ms, tilts in steps:
        code, now_ns, tilt_deg = (code + step) % CODES, now_ns + after_ms * MS, -tilt_deg if tilts else tilt_deg
        angle_deg = (code * 360 / CODES + 180) % 360 - 180
        word = arinc708.encode(np.zeros(512, int), scan_angle_deg=angle_deg, tilt_deg=tilt_deg, range_nm=10.0)
        certain = watch.goes_on(now_ns, int.from_bytes(word[:8], "little", signed=True))
        ended = [*builder.feed(np.array([now_ns]), unpack(np.frombuffer(word, np.uint8)[None]))]
        assert not (certain and ended)


@pytest.mark.parametrize(
    ("before", "step", "certain"),
    [(6, 6, True), (6, -6, False), (6, 0, True), (2, 0, False), (0, 6, False), (2000, 6, True), (2000, 700, False)],
)
def test_what_certainly_goes_on(before: int, step: int, certain: bool) -> None:
    watch = SweepWatch()
    for k, code in enumerate((1000, 1000 + before)):
        watch.goes_on(k * MS, code << ANGLE_BIT)
    assert watch.goes_on(2 * MS, 1000 + before + step << ANGLE_BIT) is certain
