"""When alerts begin and end."""

import pytest

from monitor.hysteresis import Hysteresis

VERDICTS = {"o": "ok", "a": "alert", "-": "unavailable"}
LETTERS = {verdict: letter for letter, verdict in VERDICTS.items()}


@pytest.mark.parametrize(
    ("alert_scans", "clear_scans", "found", "told"),
    [
        (1, 1, "oao-aa-o", "oao-aa-o"),
        (2, 1, "oaoaaaoa", "o-o-aao-"),
        (1, 3, "aoaooo", "aaaaao"),
        (1, 2, "ao-oo", "aa-ao"),  # a scan without a verdict breaks the row
        (2, 2, "aaoao--oo", "-aaaa--ao"),
        (2, 1, "a-aa", "---a"),
    ],
)
def test_rows_of_scans_begin_and_end_an_alert(alert_scans: int, clear_scans: int, found: str, told: str) -> None:
    hysteresis = Hysteresis(alert_scans, clear_scans)
    assert "".join(LETTERS[hysteresis.settle(VERDICTS[letter])[0]] for letter in found) == told


def test_whatever_is_not_the_verdict_of_the_scan_itself_has_a_reason() -> None:
    hysteresis = Hysteresis(2, 2)
    assert hysteresis.settle("alert")[1] == ["beyond a threshold for 1 of the 2 scans that make an alert"]
    assert hysteresis.settle("alert") == ("alert", [])
    assert hysteresis.settle("unavailable")[1] == ["the alert before has not cleared"]
    assert hysteresis.settle("ok")[1] == ["within the thresholds for 1 of the 2 scans that clear the alert"]
    assert hysteresis.settle("ok") == ("ok", [])
    assert hysteresis.settle("unavailable") == ("unavailable", [])
