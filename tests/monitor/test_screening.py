"""Which shadows count, through the monitor from scan to verdict: what is left out, and what is said of it."""

from dataclasses import replace

import numpy as np

from monitor.scans import Scan
from monitor.settings import MonitorSettings
from monitor.shade import shadows
from monitor.terrain import Terrain
from tests.monitor.scanning import ANGLES, judge, moved


def test_first_against_first_has_one_pair_on_every_radial_with_shadows_in_both(
    white_mountains: Terrain, honest: Scan
) -> None:
    echoes = moved(honest, 2).bins
    begun = np.logical_or.accumulate(echoes > 0, axis=1)
    near = (np.arange(len(ANGLES))[:, None] % 2 == 0) & (np.arange(512) < 200)
    echoes[near & begun] = 3  # on half of the radials the radar does not see the first shadows
    scan = replace(honest, bins=echoes)
    verdict, comparison = judge(white_mountains, scan, settings=MonitorSettings(pairing="first"))
    first: list[dict[int, float]] = []
    for states, thread in ((comparison.radar_states, "radar"), (comparison.dem_states, "dem")):
        found = shadows(states, thread, 3)
        first.append({int(s["radial"]): float(s["centre"]) for s in found[~found["range_limited"]][::-1]})
    expected = [first[0][radial] - first[1][radial] for radial in sorted(first[0].keys() & first[1].keys())]
    assert comparison.disparities.tolist() == expected
    assert verdict.n_pairs == len(expected) > 30
    assert judge(white_mountains, scan)[1].disparities.tolist() != expected


def test_narrow_shadows_of_either_thread_do_not_count_and_are_told(white_mountains: Terrain, honest: Scan) -> None:
    """A shadow of a single radial, cut into lit ground, is seen and left out; all the wide ones stay as they were."""
    wide = MonitorSettings(minimum_width_deg=6.0)
    before, plain = judge(white_mountains, honest, settings=wide)
    assert before.n_pairs > 20
    (said,) = before.reasons
    assert said.endswith(" terrain shadows do not count: narrower than 6 degrees")

    at = next(
        (k, j)
        for k in range(1, len(ANGLES) - 1)
        for j in range(20, 500)
        if (honest.bins[k - 1 : k + 2, j : j + 8] > 0).all()
    )
    speckled = honest.bins.copy()
    speckled[at[0], at[1] + 2 : at[1] + 6] = 0
    after, comparison = judge(white_mountains, replace(honest, bins=speckled), settings=wide)
    assert comparison.disparities.tolist() == plain.disparities.tolist()
    assert (after.unmatched_radar, after.unmatched_dem) == (before.unmatched_radar, before.unmatched_dem)
    radar, terrain = (int(word) for word in said.split() if word.isdecimal() and word != "6")
    assert after.reasons == (f"{radar + 1} radar and {terrain} terrain shadows do not count: narrower than 6 degrees",)
    unscreened = judge(white_mountains, replace(honest, bins=speckled), settings=MonitorSettings(unmatched_size=4))[0]
    assert unscreened.unmatched_radar is not None and unscreened.unmatched_radar > 0
