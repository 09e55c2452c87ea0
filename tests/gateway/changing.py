"""A recording whose terrain and calibration change between one working out and the next."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.config import check_config
from gateway.reprocess.job import Job
from gateway.reprocess.work import key, work
from monitor.calibration import uncalibrated
from simulators.scenario import BUILT_IN_TERRAIN


@dataclass
class Changing:
    """A recording to work out in this process by a rack file whose terrain and calibration are written anew."""

    path: Path
    directory: Path

    @property
    def job(self) -> Job:
        table: dict[str, object] = {
            "adapters": [{"name": "bridge", "source": "serial:x"}],
            "terrain": [self.directory / "N44W072.hgt"],
            "calibration": self.directory / "radar.json",
        }
        return Job("flight", (self.path,), json.dumps(check_config(table, "test").model_dump(mode="json")))

    def raise_terrain(self, metres: int) -> None:
        heights = np.fromfile(BUILT_IN_TERRAIN["white_mountains"], ">i2") + metres
        heights.astype(">i2").tofile(self.directory / "N44W072.hgt")

    def calibrate(self, name: str) -> None:
        made = uncalibrated(512, 10.0, "arinc708").model_copy(update={"name": name})
        (self.directory / "radar.json").write_text(made.model_dump_json())

    def outcome(self) -> tuple[set[str], bool, str]:
        """What the verdicts say: their calibrations, and whether any finds the aircraft below ground; and the key."""
        outcome = work(self.job)
        assert outcome.whole["key"] == key(self.job)
        rows = outcome.verdicts
        below = any("below the stored terrain" in reason for row in rows for reason in row["reasons"])
        return {row["calibration"] for row in rows}, below, outcome.whole["key"]
