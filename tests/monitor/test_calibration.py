"""The calibration file."""

from pathlib import Path

import pytest

from monitor.calibration import (
    Calibration,
    CheckedRate,
    EdgeModel,
    Limits,
    ShiftModel,
    UnmatchedModel,
    load_calibration,
    uncalibrated,
)
from monitor.settings import MonitorSettings

DEFAULTS = MonitorSettings()

STORED = Calibration(
    name="bench",
    provenance="made up",
    bins=512,
    range_nm=10.0,
    radar_profile="arinc708",
    median_bins=0.0,
    spread_bins=2.0,
    sigma_bins=2.2,
    rms_bins=6.0,
    variance_factor=1.4,
)
SHIFT = ShiftModel(
    front=EdgeModel(median_bins=0.5, clip_bins=3.0),
    back=EdgeModel(median_bins=-0.5, clip_bins=4.0),
    sigma_bins=1.5,
    place_bins=0.25,
    stretch=0.01,
)
WHOLE = STORED.model_copy(
    update={
        "shift": SHIFT,
        "unmatched_radar": UnmatchedModel(mean=0.4, overdispersion=0.01),
        "unmatched_dem": UnmatchedModel(mean=0.2, overdispersion=0.0),
        "level": Limits(lowest=1.5, highest=2.5),
        "checked": (CheckedRate(p_fa=0.1, scans=20, alerts=1),),
    }
)


def test_a_calibration_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "radar.json"
    path.write_text(WHOLE.model_dump_json(indent=2))
    assert load_calibration(path) == WHOLE


def test_a_file_from_before_there_were_shares_and_levels_loads() -> None:
    assert (STORED.unmatched_radar, STORED.unmatched_dem, STORED.level) == (None, None, None)


def test_a_file_with_the_common_errors_of_older_versions_loads_without_a_test_for_shifts(tmp_path: Path) -> None:
    common = '"common":{"place_bins":0.2,"stretch":0.004}'
    assert load_calibration(damaged(tmp_path, '"shift":null', common)) == STORED


def damaged(tmp_path: Path, old: str, new: str, calibration: Calibration = STORED) -> Path:
    text = calibration.model_dump_json()
    assert old in text
    path = tmp_path / "radar.json"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ('"spread_bins":2.0', '"spread_bins":-2.0', "spread_bins"),
        ('"sigma_bins":2.2', '"sigma_bins":"wide"', "sigma_bins"),
        ('"sigma_bins":2.2', '"sigma_bins":"2.2"', "sigma_bins"),
        ('"bins":512', '"bins":true', "bins"),
        ('"sigma_bins":2.2', '"sigma_bins":Infinity', "sigma_bins"),
        ('"median_bins":0.0', '"median_bins":NaN', "median_bins"),
        ('"variance_factor":1.4', '"variance_factor":0.9', "variance_factor"),
        ('"variance_factor":1.4', '"variance_factor":1e9', "variance_factor"),
        ('"spread_bins":2.0', '"spread_bins":1e6', "spread_bins"),
        ('"sigma_bins":2.2', '"sigma_bins":4.1', "the file: Value error, sigma_bins 4.1 is above 2 spread_bins"),
        ('"bins":512', '"bins":0', "bins"),
        ('"bins":512', '"bins":null', "bins: Input should be a valid integer; .*anew with shadebus calibrate radar"),
        ('"bins":512,', "", "bins: Field required; .*anew with shadebus calibrate radar"),
        ('"range_nm":10.0', '"range_nm":-1', "range_nm"),
        ('"range_nm":10.0', '"range_nm":null', "range_nm: Input should be a valid number; .*calibrate radar"),
        ('"radar_profile":"arinc708"', '"radar_profile":null', "radar_profile: Input should be a valid string; .*anew"),
        ('"radar_profile":"arinc708",', "", "radar_profile: Field required; .*anew with shadebus calibrate radar"),
        ('"level":null', '"level":{"lowest":3,"highest":1}', "level: Value error, lowest 3 is above highest 1"),
        ('"name":"bench"', '"name":""', "name"),
        ('"name":"bench"', '"name":"two\\nlines"', "name: String should match pattern"),
        ('"sigma_bins":2.2', '"sigma_bins":1e-200', "sigma_bins: Input should be greater than or equal to 0.001"),
        ('"rms_bins":6.0', '"rms_bins":1e300', "rms_bins: Input should be less than or equal to 256"),
        ('"name":"bench"', '"name":"none"', "its name is 'none', as if there were none"),
        ('"name":"bench",', "", "name"),
        ('"name":"bench"', '"name":"bench","colour":"blue"', "colour"),
        ('"checked":[]', '"checked":[{"p_fa":0.1,"scans":3}]', r"checked\.0\.alerts"),
    ],
)
def test_a_fault_in_the_file_names_the_file_and_the_field(tmp_path: Path, old: str, new: str, field: str) -> None:
    with pytest.raises(ValueError, match=rf"radar\.json: {field}"):
        load_calibration(damaged(tmp_path, old, new))


def test_no_pair_could_stand_out_of_more_scatter_than_clipped_edges_have(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"radar\.json: shift: Value error, sigma_bins 3.6 is above 3.5, where"):
        load_calibration(damaged(tmp_path, '"sigma_bins":1.5', '"sigma_bins":3.6', WHOLE))


def test_a_file_that_is_missing_or_no_json_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"lost\.json cannot be read: No such file"):
        load_calibration(tmp_path / "lost.json")
    (tmp_path / "torn.json").write_bytes(b"5")
    with pytest.raises(ValueError, match=r"torn\.json: the file: Input should be"):
        load_calibration(tmp_path / "torn.json")
    for content in (b"{", b"\xff\xfe\x00"):
        (tmp_path / "torn.json").write_bytes(content)
        with pytest.raises(ValueError, match=r"torn\.json: the file: Invalid JSON"):
            load_calibration(tmp_path / "torn.json")


def test_a_calibration_says_for_which_radar_it_holds() -> None:
    made = WHOLE
    assert made.mismatch(512, 10.0, "arinc708", DEFAULTS) is None
    assert "calibration bench is for 512 range bins, the radar sends 256" in str(made.mismatch(256, 10.0, "", DEFAULTS))
    assert "range of 10 NM, the radar is set to 20 NM" in str(made.mismatch(512, 20.0, "", DEFAULTS))
    assert made.mismatch(512, 10.0, "", DEFAULTS) is None
    said = str(made.mismatch(512, 10.0, "rdr4000", DEFAULTS))
    assert "is for radar profile arinc708, this one is rdr4000: load one that was made for it" in said


def test_a_calibration_made_with_other_options_does_not_hold() -> None:
    made = WHOLE.model_copy(update={"options": DEFAULTS.shaping})
    assert made.mismatch(512, 10.0, "", DEFAULTS) is None
    assert made.mismatch(512, 10.0, "", DEFAULTS.model_copy(update={"p_fa": 1e-3})) is None
    said = made.mismatch(512, 10.0, "", DEFAULTS.model_copy(update={"azimuth_fan": 1}))
    assert said is not None
    assert said.startswith("calibration bench was made with azimuth_fan 7, the monitor has 1: load one")


def test_the_stated_defaults_are_the_same_share_of_the_range_setting_for_any_number_of_bins() -> None:
    fine, coarse = (uncalibrated(bins, 20.0, "arinc708") for bins in (512, 256))
    assert coarse.mismatch(256, 20.0, "", DEFAULTS) is None
    for name in ("spread_bins", "sigma_bins", "rms_bins", "clip_bins"):
        assert getattr(fine, name) == 2 * getattr(coarse, name)
    assert fine.variance_factor == coarse.variance_factor
