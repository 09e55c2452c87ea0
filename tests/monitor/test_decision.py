"""The tests of a sample, each against what it may reach."""

import numpy as np
import pytest
from scipy.stats import betabinom, binom, chi2

from monitor.calibration import Calibration, EdgeModel, Limits, ShiftModel, UnmatchedModel
from monitor.decision import DEM_SHARE, RADAR_SHARE, examine, pairs_for_verdict, unmatched_threshold, untested
from monitor.sample import ScanSample, Unmatched
from monitor.settings import MonitorSettings

MODEL = UnmatchedModel(mean=0.3, overdispersion=0.02, least_size=8)
EDGE = EdgeModel(median_bins=0.0, clip_bins=4.0)
SHIFT = ShiftModel(front=EDGE, back=EDGE, sigma_bins=2.0, place_bins=0.5, stretch=0.0)
CALIBRATION = Calibration(
    name="made",
    provenance="made up",
    bins=512,
    range_nm=10.0,
    radar_profile="arinc708",
    median_bins=0.0,
    spread_bins=2.0,
    sigma_bins=2.0,
    rms_bins=4.0,
    variance_factor=1.0,
    shift=SHIFT,
    unmatched_radar=MODEL,
    unmatched_dem=MODEL,
    level=Limits(lowest=1.0, highest=3.0),
    height_m=Limits(lowest=100.0, highest=900.0),
    options=MonitorSettings().shaping,
)
BARE = CALIBRATION.model_copy(update={"shift": None, "unmatched_radar": None, "unmatched_dem": None})
FEW, MANY = Unmatched(10, 50), Unmatched(45, 50)


def sample(n: int = 40, d: float = 1.0, radar: Unmatched = FEW, dem: Unmatched = FEW) -> ScanSample:
    return ScanSample(np.full(n, d), np.full(n, d), np.linspace(-np.pi, np.pi, n), np.full(n, 9.0), radar, dem, 2.0)


@pytest.mark.parametrize("eligible", [2, 3, 5, 8, 20, 60, 200])
@pytest.mark.parametrize("p_fa", [1e-1, 1e-2, 1e-4, 1e-13])
def test_the_threshold_of_a_share_is_that_of_a_beta_binomial(eligible: int, p_fa: float) -> None:
    """Of the same mean and variance: more are unmatched with at most that probability, and one fewer will not do."""
    rho = MODEL.overdispersion * eligible / (eligible - 1)
    weight = 1 / rho - 1
    other = betabinom(eligible, MODEL.mean * weight, (1 - MODEL.mean) * weight)
    limit = round(unmatched_threshold(eligible, MODEL, p_fa) * eligible)
    tail = other.pmf(np.arange(eligible, -1, -1)).cumsum()[::-1]  # where sf would lose what is smaller than 1e-13
    assert limit == eligible or tail[limit + 1] <= p_fa
    assert tail[limit] > p_fa


def test_without_overdispersion_the_threshold_is_that_of_a_binomial() -> None:
    limit = unmatched_threshold(80, UnmatchedModel(mean=0.25, overdispersion=0.0), 1e-3)
    assert limit == binom.isf(1e-3, 80, 0.25) / 80


def test_a_window_is_told_how_many_pairs_let_q_exceed_its_threshold() -> None:
    """Q of n clipped pairs is 4 n: at a P_FA of 1e-9 it takes more than the 20 of the settings."""
    settings = MonitorSettings(p_fa=1e-9)
    needed = pairs_for_verdict(settings, BARE)
    assert 4 * needed > chi2.isf(1e-9, needed)
    assert 4 * (needed - 1) <= chi2.isf(1e-9, needed - 1)
    assert needed > 20
    assert pairs_for_verdict(settings.model_copy(update={"method": "paper"}), BARE) == 20


def test_a_share_of_few_shadows_cannot_exceed_its_threshold() -> None:
    assert unmatched_threshold(1, MODEL, 1e-3) == 1.0


def test_the_probability_of_a_false_alert_is_split_among_the_tests() -> None:
    settings = MonitorSettings(p_fa=1e-3, shift_budget=0.5, unmatched_dem_budget=0.3, unmatched_radar_budget=0.1)
    found = examine(sample(), settings, CALIBRATION)
    assert found.statistic is not None
    assert found.shift is not None
    assert found.unmatched_radar is not None
    assert found.statistic.limit == pytest.approx(chi2.isf(0.1e-3, 40))
    assert found.shift.limit == pytest.approx(chi2.isf(0.5e-3, 2))
    assert found.unmatched_dem is not None
    assert found.unmatched_radar.limit == unmatched_threshold(50, MODEL, 0.1e-3)
    assert found.unmatched_dem.limit == unmatched_threshold(50, MODEL, 0.3e-3)


@pytest.mark.parametrize(
    ("settings", "calibration"),
    [
        (MonitorSettings(p_fa=1e-3, method="paper"), CALIBRATION),
        (MonitorSettings(p_fa=1e-3), BARE),
        (MonitorSettings(p_fa=1e-3, shift_budget=0, unmatched_dem_budget=0), CALIBRATION),
    ],
)
def test_the_statistic_has_it_all_where_it_is_the_only_test(
    settings: MonitorSettings, calibration: Calibration
) -> None:
    found = examine(sample(dem=MANY), settings, calibration)
    assert found.statistic is not None
    assert found.statistic.limit == pytest.approx(chi2.isf(1e-3, 40))
    assert not found.alerts


def test_unmatched_shadows_alert_alone_where_there_are_too_few_pairs_for_the_statistic() -> None:
    settings = MonitorSettings(p_fa=1e-3, shift_budget=0.5, unmatched_radar_budget=0.1)
    found = examine(sample(n=3, radar=MANY), settings, CALIBRATION)
    assert found.statistic is None
    assert found.blind == "3 pairs of shadows, 16 needed"
    assert [test.name for test in found.alerts] == [RADAR_SHARE]
    assert [test.name for test in examine(sample(dem=MANY), settings, CALIBRATION).alerts] == [DEM_SHARE]
    assert not examine(sample(radar=MANY), MonitorSettings(p_fa=1e-3), CALIBRATION).alerts  # told, not tested
    assert str(found.alerts[0]).startswith("the unmatched share of radar shadows 0.9 exceeds 0.")


def test_disparities_that_follow_the_cosine_of_the_azimuth_alert_where_their_squares_do_not() -> None:
    d = 3 * np.cos(sample().azimuth_rad)
    shifted = sample()._replace(front=d, back=d)
    found = examine(shifted, MonitorSettings(p_fa=1e-3), CALIBRATION)
    assert [test.name for test in found.alerts] == ["the shift statistic"]
    assert not examine(shifted, MonitorSettings(p_fa=1e-3), BARE).alerts


def test_a_calibration_without_what_a_test_needs_leaves_its_share_to_q_and_says_so() -> None:
    settings = MonitorSettings(p_fa=1e-3)
    old = CALIBRATION.model_copy(update={"shift": None, "unmatched_dem": UnmatchedModel(mean=0.3, overdispersion=0.02)})
    found = examine(sample(dem=MANY), settings, old)
    assert (found.shift, found.unmatched_dem) == (None, None)
    assert found.statistic is not None
    assert found.statistic.limit == pytest.approx(chi2.isf(1e-3, 40))
    shift, unmatched = untested(settings, old)
    assert shift == "shifts are not tested: calibration made does not say how shadows lie, make it anew"
    assert "of 8 bins and more are not tested: calibration made has those of 3 bins and more" in unmatched
    assert not untested(settings, CALIBRATION)
    assert not untested(settings.model_copy(update={"method": "paper"}), old)


@pytest.mark.parametrize("method", ["robust", "paper"])
def test_what_a_calibration_does_not_say_it_holds_for_is_named(method: str) -> None:
    options = {name: value for name, value in CALIBRATION.options.items() if name != "beam_width_deg"}
    unsaid = CALIBRATION.model_copy(update={"level": None, "options": {**options, "beam_with_deg": "3.5"}})
    (told,) = untested(MonitorSettings.model_validate({"method": method}), unsaid)
    assert told == "calibration made does not say for which signal levels, beam_width_deg it holds: make it anew"


def test_where_neither_q_nor_the_shift_statistic_could_alert_nothing_is_ok() -> None:
    """Common errors of the position as large as these hide any shift, and 20 clipped pairs Q at such a P_FA."""
    exact, wide = (
        CALIBRATION.model_copy(update={"shift": SHIFT.model_copy(update={"place_bins": place_bins})})
        for place_bins in (0.0, 60.0)
    )
    settings = MonitorSettings(p_fa=1e-9, unmatched_dem_budget=0.0)
    assert examine(sample(n=20), settings, exact).statistic is not None
    blind = examine(sample(n=20), settings, wide)
    assert blind.statistic is None
    assert "20 pairs cannot alert" in blind.blind
    assert "no shift would be found" in blind.blind


def test_a_window_lends_pairs_to_the_statistic_and_to_no_other_test() -> None:
    """What the newest scan says of shifts and of unmatched shadows is not thinned by the scans before."""
    settings, few = MonitorSettings(p_fa=1e-3), sample(n=9, dem=MANY)
    gathered = examine(few, settings, CALIBRATION, np.full(40, 1.0))
    assert gathered.statistic is not None
    assert [test.name for test in gathered.alerts] == [DEM_SHARE]
    assert gathered.shift is None


def test_q_and_t_are_both_told_whatever_decides() -> None:
    """Forty pairs, three bins apart: Q = 40 9 / 4 and N T / sigma^2 = 40 9 / 16."""
    found = examine(sample(d=3.0), MonitorSettings(p_fa=1e-3), BARE)
    assert (found.q, found.t_normalised) == (90.0, 22.5)
    assert [test.value for test in found.alerts] == [90.0]
    paper = examine(sample(d=3.0), MonitorSettings(p_fa=1e-3, method="paper"), BARE)
    assert paper.statistic is not None
    assert (paper.statistic.value, paper.q, paper.alerts) == (22.5, 90.0, [])
