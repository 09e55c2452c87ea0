"""The robust fit on disparities whose distribution is known, and the file that carries it."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, norm

from monitor.calibration import CLIP_FACTOR, Calibration, fit, load_calibration, uncalibrated

Scans = list[NDArray[np.float64]]
RNG_SEED = 6
MEDIAN, SPREAD = 0.5, 2.0


def normal_scans(scans: int, n: int = 50, common: float = 0.0) -> Scans:
    """Independent normal disparities, and an error that all disparities of a scan have in common."""
    rng = np.random.default_rng(RNG_SEED)
    return list(rng.normal(MEDIAN, SPREAD, (scans, n)) + rng.normal(0, common, (scans, 1)))


def fitted(scans: Scans, check: Scans | None = None, p_fas: tuple[float, ...] = ()) -> Calibration:
    return fit(scans, check or [], p_fas, 16, name="made", provenance="drawn", bins=512, range_nm=10.0)


def test_normal_disparities_give_back_their_parameters() -> None:
    """Their median and spread, the rms of a normal clipped at two sigma, and a variance factor near 1.

    With u = 2: E[clip(z)^2] = erf part (1 - 2 phi-tail) - 2 u pdf(u) + 2 u^2 sf(u). Each within four standard errors
    of 50,000 draws, the spread's being 1.17 sigma / sqrt(n).
    """
    found = fitted(normal_scans(1000))
    draws = 50_000
    assert found.median_bins == pytest.approx(MEDIAN, abs=4 * 1.2533 * SPREAD / np.sqrt(draws))
    assert found.spread_bins == pytest.approx(SPREAD, abs=4 * 1.17 * SPREAD / np.sqrt(draws))
    u = CLIP_FACTOR
    clipped_variance = (norm.cdf(u) - norm.cdf(-u)) - 2 * u * norm.pdf(u) + 2 * u**2 * norm.sf(u)
    assert found.sigma_bins == pytest.approx(SPREAD * np.sqrt(clipped_variance), rel=0.02)
    assert found.rms_bins == pytest.approx(np.hypot(MEDIAN, SPREAD), rel=0.02)
    assert found.clip_bins == 2 * found.spread_bins
    assert 1.0 <= found.variance_factor < 1.05


def test_an_error_common_to_a_scan_raises_the_variance_factor() -> None:
    """Clipping leaves Q of a normal a variance below chi-square's, so that the factor begins at its floor of 1."""
    alone, some, much = (fitted(normal_scans(1000, common=c)).variance_factor for c in (0.0, 1.0, 1.5))
    assert alone == 1.0
    assert 1.5 < some < much


def test_the_variance_factor_is_the_scatter_of_q_about_n_over_twice_n() -> None:
    """c = E[(Q - N)^2] / E[2 N], over scans of different size."""
    scans = normal_scans(300, 40, common=1.5) + normal_scans(200, 60, common=1.5)
    found = fitted(scans)
    clip = 2 * found.spread_bins
    scatter = [
        (sum(max(-clip, min(clip, d - found.median_bins)) ** 2 for d in scan) / found.sigma_bins**2 - len(scan)) ** 2
        for scan in (scan.tolist() for scan in scans)
    ]
    assert found.variance_factor == pytest.approx(sum(scatter) / (2 * (300 * 40 + 200 * 60)), rel=1e-9)
    assert found.variance_factor > 2


def test_heavy_tails_move_the_rms_but_hardly_the_robust_numbers() -> None:
    """Every twentieth disparity is a wrong pairing, forty bins off."""
    scans = normal_scans(1000)
    for scan in scans:
        scan[::20] += 40
    clean, found = fitted(normal_scans(1000)), fitted(scans)
    assert found.rms_bins > 3 * clean.rms_bins
    assert found.spread_bins == pytest.approx(clean.spread_bins, rel=0.15)
    assert found.sigma_bins == pytest.approx(clean.sigma_bins, rel=0.25)


def test_wrong_pairings_that_gather_in_some_scans_raise_the_variance_factor() -> None:
    scans = normal_scans(1000)
    for scan in scans[::5]:
        scan[:15] += 40
    assert fitted(scans).variance_factor > 1.2


def test_the_checked_rates_are_those_of_scans_that_the_fit_did_not_see() -> None:
    scans = normal_scans(4000)
    found = fitted(scans[:2000], scans[2000:], (0.1, 0.01))
    assert [(rate.p_fa, rate.scans) for rate in found.checked] == [(0.1, 2000), (0.01, 2000)]
    # Clipping a normal leaves Q less variance than chi-square has: fewer alerts than configured, never more.
    for rate in found.checked:
        assert rate.alerts <= binom.ppf(0.995, rate.scans, rate.p_fa)
    shifted = [scan + 6 for scan in scans[2000:]]
    assert [rate.alerts for rate in fitted(scans[:2000], shifted, (0.01,)).checked] == [2000]


def test_scans_with_too_few_pairs_take_no_part() -> None:
    poor = [np.full(15, 1000.0)] * 500
    scans = normal_scans(100)
    found = fitted(scans + poor, scans[:10] + poor, (0.1,))
    assert found.model_copy(update={"checked": ()}) == fitted(scans)
    assert found.checked[0].scans == 10
    with pytest.raises(ValueError, match=r"only 1 scans have 16 pairs.*fly longer"):
        fitted([*poor, scans[0]])


def test_disparities_without_a_spread_are_refused() -> None:
    with pytest.raises(ValueError, match="half of the disparities are equal"):
        fitted([np.r_[np.zeros(30), np.arange(10.0)]] * 3)


def test_a_calibration_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    scans = normal_scans(40)
    made = fitted(scans[:20], scans[20:], (0.1,))
    path = tmp_path / "radar.json"
    path.write_text(made.model_dump_json(indent=2))
    assert load_calibration(path) == made


STORED = Calibration(
    name="none",
    provenance="made up",
    median_bins=0.0,
    spread_bins=2.0,
    sigma_bins=2.2,
    rms_bins=6.0,
    variance_factor=1.4,
)


def damaged(tmp_path: Path, old: str, new: str) -> Path:
    text = STORED.model_dump_json()
    assert old in text
    path = tmp_path / "radar.json"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ('"spread_bins":2.0', '"spread_bins":-2.0', "spread_bins"),
        ('"sigma_bins":2.2', '"sigma_bins":"wide"', "sigma_bins"),
        ('"sigma_bins":2.2', '"sigma_bins":Infinity', "sigma_bins"),
        ('"median_bins":0.0', '"median_bins":NaN', "median_bins"),
        ('"variance_factor":1.4', '"variance_factor":0.9', "variance_factor"),
        ('"name":"none",', "", "name"),
        ('"name":"none"', '"name":"none","colour":"blue"', "colour"),
        ('"checked":[]', '"checked":[{"p_fa":0.1,"scans":3}]', r"checked\.0\.alerts"),
    ],
)
def test_a_fault_in_the_file_names_the_file_and_the_field(tmp_path: Path, old: str, new: str, field: str) -> None:
    with pytest.raises(ValueError, match=rf"radar\.json: {field}: "):
        load_calibration(damaged(tmp_path, old, new))


def test_a_file_that_is_missing_or_no_json_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"lost\.json cannot be read: No such file"):
        load_calibration(tmp_path / "lost.json")
    for content in (b"{", b"\xff\xfe\x00"):
        (tmp_path / "torn.json").write_bytes(content)
        with pytest.raises(ValueError, match=r"torn\.json: the file: Invalid JSON"):
            load_calibration(tmp_path / "torn.json")


def test_a_calibration_says_for_which_radar_it_holds() -> None:
    made = fitted(normal_scans(20))
    assert made.mismatch(512, 10.0) is None
    assert "made is for 512 range bins, the radar sends 256" in str(made.mismatch(256, 10.0))
    assert "range of 10 NM, the radar is set to 20 NM" in str(made.mismatch(512, 20.0))


def test_the_stated_defaults_are_the_same_share_of_the_range_setting_for_any_number_of_bins() -> None:
    fine, coarse = uncalibrated(512), uncalibrated(256)
    assert coarse.mismatch(256, 20.0) is None
    for name in ("spread_bins", "sigma_bins", "rms_bins", "clip_bins"):
        assert getattr(fine, name) == 2 * getattr(coarse, name)
    assert fine.variance_factor == coarse.variance_factor
