"""Options that no monitor can have are refused before anything starts, with their name and what they may be."""

from math import inf, nan
from typing import Any

import pytest
from pydantic import ValidationError

from monitor.settings import MonitorSettings

IMPOSSIBLE: list[tuple[str, list[Any], str]] = [
    ("method", ["paper!", "", None], "Input should be 'robust' or 'paper'"),
    ("p_fa", [0, 0.5, -1e-4, nan, inf], "(greater than or equal to 0.000000000001|less than 0.5)"),
    ("p_md", [0, 1, nan, inf], "(greater than 0|less than 1)"),
    ("minimum_pairs", [1, 0, -5, 10**30], "(greater than or equal to 2|less than or equal to 65536)"),
    ("minimum_pairs", [16.5, inf, "many"], "(integer|finite number)"),
    ("beam_width_deg", [0.1, 0, -3.5, nan, inf, 30.1], "(greater than 0.1|less than or equal to 30)"),
    ("azimuth_fan", [0, -7, 100], "(greater than or equal to 1|less than or equal to 99)"),
    ("azimuth_span", [0, -1, 2.1, nan, inf], "(greater than 0|less than or equal to 2)"),
    ("refraction_k", [0, -4 / 3, 0.49, nan, -inf], "greater than or equal to 0.5"),
    ("range_reference", ["near_edge", 0], "Input should be 'centre' or 'far_edge'"),
    ("radial_spacing_deg", [0, 1e-300, -3, 31, nan, inf], "(greater than or equal to 0.01|less than or equal to 30)"),
    ("minimum_size", [0, -1, 10**30], "(greater than or equal to 1|less than or equal to 65536)"),
    ("maximum_size", [0, -1, 10**30], "(greater than or equal to 1|less than or equal to 65536)"),
    ("maximum_size", [2], "maximum_size 2 is below minimum_size 3"),
    ("maximum_size", [7], "maximum_size 7 is below unmatched_size 8"),
    ("unmatched_dem_budget", [-0.1, 0.96, nan, inf], "(greater than or equal to 0|less than or equal to 0.95)"),
    ("unmatched_radar_budget", [-0.1, 0.96, nan, inf], "(greater than or equal to 0|less than or equal to 0.95)"),
    ("shift_budget", [-0.1, 0.96, nan, inf], "(greater than or equal to 0|less than or equal to 0.95)"),
    ("shift_budget", [0.65], "shift_budget and the unmatched budgets are 1 together: leave Q 0.05"),
    ("unmatched_size", [0, -1, 10**30], "(greater than or equal to 1|less than or equal to 65536)"),
    ("window_scans", [0, 31], "(greater than or equal to 1|less than or equal to 30)"),
    ("alert_scans", [0, 31], "(greater than or equal to 1|less than or equal to 30)"),
    ("clear_scans", [0, 31], "(greater than or equal to 1|less than or equal to 30)"),
    ("offset_search_m", [-1, 5001, nan, inf], "(greater than or equal to 0|less than or equal to 5000)"),
    ("offset_search_m", [199.0], "offset_search_m 199 is below 200"),
    ("minimum_width_deg", [-1, 181, nan, inf], "(greater than or equal to 0|less than or equal to 180)"),
    ("pairing", ["second", None], "Input should be 'overlap' or 'first'"),
    ("radio_altitude_limit_m", [0, -1, 20_001, nan, inf], "(greater than 0|less than or equal to 20000)"),
    ("first_bin_from_radio_altitude", ["perhaps", None], "valid boolean"),
    ("minimum_water_km2", [-1, 1e10, nan, inf], "(greater than or equal to 0|less than or equal to 1000000000)"),
    ("tracked_scans", [0, 21], "(greater than or equal to 1|less than or equal to 20)"),
    ("tracking_tolerance_m", [0, -1, 10_001, nan, inf], "(greater than 0|less than or equal to 10000)"),
    ("range_limit_nm", [0, -10, nan, inf, 321], "(greater than 0|less than or equal to 320)"),
    ("height_source", ["203", 76], "Input should be '076' or '370'"),
    ("position_gate", ["perhaps", 2, None], "valid boolean"),
    ("largest_integrity_limit_nm", [0, -1, 16, nan, inf], "(greater than 0|less than or equal to 15)"),
    ("control_delay_s", [-1, 61, nan, inf], "(greater than or equal to 0|less than or equal to 60)"),
    *((f"lever_arm.{axis}_m", [101, -101, nan, inf], "equal to -?100") for axis in ("forward", "right", "down")),
    ("beam_with_deg", [3.5], "Extra inputs are not permitted"),
]


@pytest.mark.parametrize(
    ("option", "value", "words"), [(option, value, words) for option, values, words in IMPOSSIBLE for value in values]
)
def test_an_impossible_value_is_refused_and_the_option_is_named(option: str, value: object, words: str) -> None:
    section, _, key = option.rpartition(".")
    with pytest.raises(ValidationError, match=words) as caught:
        MonitorSettings.model_validate({section: {key: value}} if section else {key: value})
    (problem,) = caught.value.errors()
    assert problem["loc"] in (tuple(option.split(".")), ())  # () where two options contradict each other
    assert option.rpartition(".")[2] in f"{problem['loc']} {problem['msg']}"


def test_no_option_is_left_out_of_the_impossible_ones() -> None:
    assert {option.partition(".")[0] for option, _, _ in IMPOSSIBLE} > set(MonitorSettings.model_fields)


@pytest.mark.parametrize(
    "possible",
    [
        {"p_fa": 0.499, "p_md": 0.999, "minimum_pairs": 2, "azimuth_fan": 1, "azimuth_span": 2, "control_delay_s": 0},
        {"refraction_k": inf, "radial_spacing_deg": 0.01, "range_limit_nm": 320, "beam_width_deg": 30},
        {
            "minimum_size": 3,
            "maximum_size": 3,
            "unmatched_size": 3,
            "lever_arm": {"forward_m": -100, "right_m": 100, "down_m": 100},
        },
    ],
)
def test_what_is_just_possible_is_taken(possible: dict[str, object]) -> None:
    assert MonitorSettings.model_validate(possible).model_dump(include=set(possible)) == possible
