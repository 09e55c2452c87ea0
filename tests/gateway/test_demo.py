"""A short demo: three legs through the shipped gateway, and the page that it leaves."""

import html
import json
import re
import signal
from dataclasses import dataclass
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from gateway import demo, stopping
from gateway.errors import GatewayError
from gateway.recording import Recording
from gateway.report import HEADINGS, VERSIONS
from monitor.calibration import load_calibration
from tests.gateway.live import records, replayed


@dataclass(frozen=True)
class Shown:
    """What a demo printed, the page it wrote, and its recordings."""

    printed: str
    page: str
    recordings: list[Path]

    @property
    def figures(self) -> list[tuple[str, str]]:
        """What stands in each picture, and its caption."""
        found = re.findall('alt="(.*?)"><figcaption>(.*?)</figcaption>', html.unescape(self.page), re.DOTALL)
        assert len(found) == self.page.count("<img")
        return found


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """Three sweeps a leg; the GNSS fails in the second."""
    out, printed = tmp_path_factory.mktemp("demo"), StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "LEG_S", 3 * demo.SWEEP_S)
        patch.setattr(demo, "GNSS_FAILS_S", 6.0)
        patch.setattr(demo, "plain_console", lambda: Console(file=printed, width=200, markup=False, emoji=False))
        patch.setattr(signal, "signal", lambda *_: None)  # Ctrl-C is for pytest
        demo.fly(out, seed=7, speed=10.0, stop=stopping.Stop())
    page = (out / "report" / "index.html").read_text()
    return Shown(printed.getvalue(), page, sorted(out.glob("*/*.mcap")))


@pytest.fixture(scope="module")
def events(shown: Shown) -> list[dict[str, Any]]:
    """Of all legs, one after the other."""
    return [json.loads(line) for recording in shown.recordings for line in replayed(recording)]


def test_no_reason_of_a_verdict_speaks_of_the_end_of_the_demo_itself(events: list[dict[str, Any]]) -> None:
    assert [event for event in events if event["type"] == "status" and event["state"] == "LOST"] == []
    assert [event["reasons"] for event in events if "degraded" in str(event.get("reasons"))] == []


def test_the_last_word_of_a_leg_is_recorded_although_the_gateway_is_stopped_first(events: list[dict[str, Any]]) -> None:
    assert [event["radials"] for event in events if event["type"] == "scan"] == [361] * 9


def test_every_bar_reaches_its_end(shown: Shown) -> None:
    assert shown.printed.count("100%") == len(shown.recordings) == 3


def test_the_page_says_when_from_what_and_how_it_was_made(shown: Shown) -> None:
    calibration = load_calibration(demo.CALIBRATION)
    for path in shown.recordings:
        metadata, first = Recording(path).metadata, records(path)[0].stamp.utc_ns
        assert f"{datetime.fromtimestamp(first / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC" in shown.page
        assert {path.name, metadata["terrain_checksum"]} <= set(re.findall(r"[\w.]+", shown.page))
        assert all(f"{name} {metadata[name]}" in shown.page for name in VERSIONS)
    for text in (f"{calibration.name}: {calibration.provenance}", "robust", f"{demo.P_FA:g}", "N44W072.hgt"):
        assert f">{text}" in shown.page
    assert "CRC" not in shown.page, "of wide terrain the checksum is of samples: the documents say of which"


def test_every_figure_of_the_table_of_verdicts_has_its_unit_in_the_heading(shown: Shown) -> None:
    assert {heading for heading in HEADINGS if "(" not in heading} == {"leg", "scan", "verdict", "reasons"}
    assert "".join(f"<th>{heading}" for heading in HEADINGS) in shown.page


def test_the_caption_of_every_picture_says_which_scans_when_and_with_what_verdict(shown: Shown) -> None:
    for _, caption in shown.figures:
        assert re.search(r"scans? \d+.*\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC.*(ok|alert|unavailable)", caption)


def test_the_last_scan_of_each_leg_is_shown_and_an_unavailable_one_says_why(shown: Shown) -> None:
    headings = [re.sub("2[0-9: -]* UTC", "UTC", heading) for heading, _ in shown.figures[2:]]
    assert headings == [
        "true terrain, scan 2, UTC\nok",
        "terrain 500 m east, scan 2, UTC\nalert",
        "GNSS fails at 6 s, scan 2, UTC\nunavailable: latitude_deg: NO_COMPUTED_DATA on 61 of 61 radials",
    ]


def test_the_kernels_are_compiled_before_the_first_gateway_listens(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    happened: list[str] = []

    def live(*_: object) -> None:
        happened.append("live")
        raise GatewayError("enough")

    monkeypatch.setattr(demo, "warm_up_gateway", lambda _: happened.append("warm"))
    monkeypatch.setattr(demo, "_live", live)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(GatewayError, match="enough"):
        demo.fly(tmp_path, seed=7, speed=10.0, stop=stopping.Stop())
    assert happened == ["warm", "live"]
