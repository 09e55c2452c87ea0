"""Both state machines against independent oracles, the conventions of shadows, and pairs against brute force."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.shade import dem_states, pair, pair_first, radar_states, shadows, unmatched_share

Dark = tuple[int, int, int, bool]  # radial, first dark bin, last dark bin, range-limited
BINS = 24
LIT = st.lists(st.lists(st.booleans(), min_size=12, max_size=12), min_size=1, max_size=4)
TWO_THREADS = st.integers(1, 4).flatmap(
    lambda n: st.tuples(*[st.lists(st.lists(st.booleans(), min_size=12, max_size=12), min_size=n, max_size=n)] * 2)
)


def states(lit: list[list[bool]]) -> NDArray[np.int8]:
    return radar_states(np.array(lit, np.uint8))


def levels(drawn: str) -> NDArray[np.uint8]:
    return np.array([*drawn], np.uint8)


def radar_oracle(levels: list[int]) -> list[int]:
    """Dark before the first echo is not known to be shadow."""
    first = next((j for j, level in enumerate(levels) if level), len(levels))
    return [1 if level else (-3 if j < first else 0) for j, level in enumerate(levels)]


def dem_oracle(delta: list[float], dmin: float, dmax: float) -> list[int]:
    """Line of sight from its definition: each bin looks back at every bin before it."""
    states: list[int] = []
    for j, d in enumerate(delta):
        earlier, later = delta[:j], delta[j + 1 :]
        rises_above_all = all(d > e for e in earlier)
        beside_lit_equal = j > 0 and states[-1] > 0 and delta[j - 1] == d
        if dmin < d <= dmax and (rises_above_all or beside_lit_equal):
            peak = bool(later) and (later[0] < d or later[0] > dmax)
            states.append(2 if peak else 1)
        else:
            states.append(-3 if all(e <= dmin for e in [*earlier, d]) else 0)
    return states


def tied_radial(rng: np.random.Generator) -> tuple[list[float], float, float]:
    delta = rng.integers(-6, 7, BINS) / 4
    dmin, dmax = np.sort(rng.choice(np.arange(-7, 8), 2, replace=False)) / 4
    return delta.tolist(), float(dmin), float(dmax)


def slow_radial(rng: np.random.Generator) -> tuple[list[float], float, float]:
    """Steps of -1, 0 or 1: plateaus, and ridges that return to exactly their height."""
    delta = np.cumsum(rng.integers(-1, 2, BINS)) / 8
    dmin, dmax = np.sort(rng.choice(np.arange(-8, 9), 2, replace=False)) / 8
    return delta.tolist(), float(dmin), float(dmax)


def smooth_radial(rng: np.random.Generator) -> tuple[list[float], float, float]:
    delta = rng.normal(-0.1, 0.1, BINS)
    delta[: rng.integers(0, 4)] = -np.inf  # nearer than the ground below
    return delta.tolist(), -0.15, 0.1


@pytest.mark.parametrize("draw", [tied_radial, slow_radial, smooth_radial])
def test_the_terrain_thread_equals_a_line_of_sight_oracle_on_random_radials(
    draw: Callable[[np.random.Generator], tuple[list[float], float, float]],
) -> None:
    rng = np.random.default_rng(1)
    radials = [draw(rng) for _ in range(3400)]
    delta, dmin, dmax = (np.array(column) for column in zip(*radials, strict=True))
    found = dem_states(delta, dmin, dmax)
    assert {-3, 0, 1, 2} == set(found.ravel().tolist())
    for row, radial in zip(found.tolist(), radials, strict=True):
        assert row == dem_oracle(*radial), radial


def test_the_radar_thread_equals_its_oracle_on_random_radials() -> None:
    rng = np.random.default_rng(2)
    levels = rng.integers(0, 8, (10_000, BINS)) * (rng.random((10_000, BINS)) < rng.random((10_000, 1)))
    assert not levels[:, 0].all()
    for row, radial in zip(radar_states(levels.astype(np.uint8)).tolist(), levels.tolist(), strict=True):
        assert row == radar_oracle(radial)


def test_one_radial_and_scalar_limits_are_taken_too() -> None:
    assert radar_states(np.array([0, 3, 0, 7], np.uint8)).tolist() == [[-3, 1, 0, 1]]
    assert dem_states(np.array([-2.0, -1.0, -1.5, -0.5]), -1.75, 0.0).tolist() == [[-3, 2, 0, 1]]


def test_a_bin_above_the_beam_hides_everything_behind_it() -> None:
    delta = np.array([-0.5, 0.5, -0.25, 0.0, 0.2])
    assert dem_states(delta, -1.0, 0.25).tolist() == [[2, 0, 0, 0, 0]]
    assert dem_states(delta[1:], -1.0, 0.25).tolist() == [[0, 0, 0, 0]]


def test_figure_2_has_no_echo_in_bins_9_through_16() -> None:
    """The paper's Figure 2 gives only the bins; the heights are ours: a hill whose top lies in bin 8.

    Antenna at 1000 m, bins of 100 m, R_j = j dR as the paper writes. From the top at 600 m the line of sight falls to
    1000 - 50 j metres in bin j, so that 200 m in bin 16 is grazed exactly and stays hidden, and 250 m in bin 17 is lit.
    """
    heights = [0, 0, 0, 0, 0, 200, 400, 600, 0, 0, 0, 0, 0, 0, 100, 200, 250, 300, 350, 400]
    delta = np.array([-(1000 - h) / (100 * j) for j, h in enumerate(heights, 1)])
    terrain = dem_states(delta, -1.5, 0.0)
    assert terrain.tolist() == [[-3] * 5 + [1, 1, 2] + [0] * 8 + [1] * 4]
    echoes = radar_states(np.array([0] * 5 + [1, 2, 3] + [0] * 8 + [1, 2, 1, 1], np.uint8))
    for found in (shadows(terrain, "dem"), shadows(echoes, "radar")):
        assert found.tolist() == [(0, 8, 17, 12.5, 8, False)]


def test_edges_have_the_domain_that_the_paper_states_after_table_5() -> None:
    """5 NMI limit with 64 bins and shadows of 3 bins and more: all possible shadows, one on each radial."""
    spans = [(f, b) for f in range(1, 65) for b in range(f + 1, 65)]
    lit = np.array([[not f < j < b for j in range(1, 65)] for f, b in spans], np.uint8)
    found = shadows(radar_states(lit), "radar", min_size=3)
    assert len(found) == sum(b - f - 1 >= 3 for f, b in spans)
    assert not found["range_limited"].any()
    for edge, domain in (("front", (1, 60)), ("back", (5, 64)), ("centre", (3, 62))):
        assert (found[edge].min(), found[edge].max()) == domain
        assert found[edge].max() - found[edge].min() == 59


def test_a_centre_keeps_its_half() -> None:
    found = shadows(states([[True, False, False, True], [True, False, True, True]]), "radar")
    assert found["centre"].tolist() == [2.5, 2.0]


def test_a_shadow_that_runs_to_the_last_bin_ends_there_and_is_flagged() -> None:
    found = shadows(states([[True, True, False, False, False]]), "radar")
    assert found.tolist() == [(0, 2, 5, 3.5, 3, True)]


def test_darkness_without_a_front_edge_is_no_shadow() -> None:
    assert not len(shadows(states([[False] * 5, [False, False, True, True, True]]), "radar"))
    assert not len(shadows(dem_states(np.array([0.5, -0.5, -0.5]), -1.0, 0.25), "dem"))


def test_the_size_limits_include_both_ends() -> None:
    lit = [[True] + [False] * n + [True] * (9 - n) for n in range(1, 9)]
    assert shadows(states(lit), "radar", 3, 5)["size"].tolist() == [3, 4, 5]


def test_a_thread_has_one_of_two_names() -> None:
    with pytest.raises(ValueError, match="sonar"):
        shadows(states([[True]]), "sonar")


@given(LIT)
def test_front_edges_shadows_and_lit_bins_partition_every_radial(lit: list[list[bool]]) -> None:
    found = shadows(states(lit), "radar")
    for i, radial in enumerate(lit):
        dark = [j for s in found[found["radial"] == i] for j in range(s["front"] + 1, s["front"] + s["size"] + 1)]
        first = radial.index(True) if any(radial) else len(radial)
        assert dark == [j + 1 for j, on in enumerate(radial) if not on and j > first]
        for s in found[found["radial"] == i]:
            assert radial[s["front"] - 1]
            assert radial[s["back"] - 1] is not bool(s["range_limited"])


def dark_runs(lit: list[list[bool]]) -> Iterator[Dark]:
    """Runs of dark bins behind a lit one, without the code under test."""
    for i, radial in enumerate(lit):
        text = "".join(" #"[on] for on in radial)
        start = 1
        for run in text.lstrip().split("#")[1:]:
            start += 1
            if run:
                first = len(text) - len(text.lstrip()) + start
                yield i, first, first + len(run) - 1, first + len(run) - 1 == len(text)
            start += len(run)


def common(one: Dark, other: Dark) -> int:
    return len(set(range(one[1], one[2] + 1)) & set(range(other[1], other[2] + 1)))


@given(TWO_THREADS)
def test_each_radial_gives_the_pair_that_brute_force_ranks_first(threads: tuple[list[list[bool]], ...]) -> None:
    radar, dem = (list(dark_runs(lit)) for lit in threads)
    found = pair(shadows(states(threads[0]), "radar"), shadows(states(threads[1]), "dem"))
    assert len(set(found["radial"].tolist())) == len(found)
    for i in range(len(threads[0])):
        ranks = {
            (r, d): (
                common(radar[r], dem[d]),
                radar[r][2] - radar[r][1] + dem[d][2] - dem[d][1],
                -min(radar[r][1], dem[d][1]),
            )
            for r in range(len(radar))
            for d in range(len(dem))
            if radar[r][0] == dem[d][0] == i and radar[r][3] == dem[d][3] and common(radar[r], dem[d])
        }
        chosen = found[found["radial"] == i]
        assert len(chosen) == bool(ranks)
        for p in chosen:
            rank = ranks[p["radar"], p["dem"]]
            assert rank == max(ranks.values())
            assert p["overlap"] == rank[0] > 0


def test_of_two_equal_pairs_the_nearer_is_taken() -> None:
    twice = [[True, False, False, True, True, False, False, True]]
    found = pair(shadows(states(twice), "radar"), shadows(states(twice), "dem"))
    assert found.tolist() == [(0, 0, 0, 2)]


def test_of_two_equal_overlaps_the_longer_pair_is_taken_though_it_is_farther() -> None:
    radar = [[True, False, False, True, False, False, False, True]]
    dem = [[True, False, False, True, False, False, True, True]]
    found = pair(shadows(states(radar), "radar"), shadows(states(dem), "dem"))
    assert found.tolist() == [(0, 1, 1, 2)]


def test_a_flagged_shadow_pairs_only_with_a_flagged_one() -> None:
    to_the_end, with_a_back = [[True] + [False] * 5], [[True] + [False] * 4 + [True]]
    for radar, dem, pairs in ((to_the_end, with_a_back, 0), (with_a_back, to_the_end, 0), (to_the_end, to_the_end, 1)):
        assert len(pair(shadows(states(radar), "radar"), shadows(states(dem), "dem"))) == pairs


def share(mine: list[list[bool]], other: list[list[bool]]) -> tuple[int, int]:
    other_states = states(other)
    return unmatched_share(shadows(states(mine), "radar"), shadows(other_states, "dem"), other_states)


@given(TWO_THREADS)
def test_the_unmatched_share_equals_a_count_by_sets_of_bins(threads: tuple[list[list[bool]], ...]) -> None:
    mine, others = (list(dark_runs(lit)) for lit in threads)
    eligible = unmatched = 0
    for m in mine:
        other = threads[1][m[0]]
        first_lit = other.index(True) + 1 if any(other) else BINS
        tail = min([o[1] - 1 for o in others if o[0] == m[0] and o[3]], default=BINS)
        if m[3] or m[1] <= first_lit or m[2] > tail:
            continue
        eligible += 1
        sizes = {o: m[2] - m[1] + o[2] - o[1] + 2 - common(m, o) for o in others if o[0] == m[0]}
        unmatched += not any(2 * common(m, o) >= union for o, union in sizes.items())
    assert share(*threads) == (unmatched, eligible)


def test_half_of_the_union_is_a_match_and_less_is_none() -> None:
    six = [[True] + [False] * 6 + [True]]
    three, two = [[True] + [False] * 3 + [True] * 4], [[True] + [False] * 2 + [True] * 5]
    assert share(three, six) == (0, 1)
    assert share(two, six) == (1, 1)


def test_shadows_before_the_first_echo_or_in_the_unseen_tail_of_the_other_thread_are_not_eligible() -> None:
    mine = [[True, False, True, False, True, False, True]]
    assert share(mine, [[False, False, True, True, True, True, True]]) == (2, 2)
    assert share(mine, [[False, False, True, True, True, False, False]]) == (1, 1)
    assert share(mine, [[False] * 7]) == (0, 0)


def test_first_against_first_pairs_what_lies_apart_and_passes_over_a_larger_overlap() -> None:
    """Radial 0: first ones apart, later ones alike. Radial 1: no radar shadow. Radial 2: they share bins 4 and 5."""
    radar = shadows(radar_states(np.array([*map(levels, ("1011110001", "1111111111", "1100011011"))])), "radar")
    dem = shadows(radar_states(np.array([*map(levels, ("1110110001", "1011111111", "1110001101"))])), "dem")
    assert pair_first(radar, dem).tolist() == [(0, 0, 0, 0), (2, 2, 3, 2)]
    assert pair(radar, dem).tolist() == [(0, 1, 1, 3), (2, 2, 3, 2)]


def test_first_against_first_of_no_shadows_is_no_pair() -> None:
    none = shadows(states([[True] * 4]), "radar")
    assert not pair_first(none, none).size
