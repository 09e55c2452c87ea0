"""The weather radar in map mode: mean echo, speckle and noise, and the levels that its bus word carries."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulators import antenna, arinc708, scenario
from simulators.echo import Beam, Views, mean_echo
from simulators.flight import Trajectory
from simulators.measurements import during
from simulators.terrain import Ground

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

METRES_PER_NM = 1852.0
ERROR_STREAM, SPECKLE_STREAM = 3, 4
REFERENCE_SNR_DB = 18.0
# gamma over noise at which lit bins from 5 to 10 NM have a median of 18 dB in the reference configuration
REFERENCE_GAMMA_DB = 155.3
FIRST_LEVEL_DB = 4.0


@dataclass(frozen=True)
class Payload:
    """How received power becomes bin codes: 0 under the first level, then one more every `step_db`."""

    bins: int
    highest: int
    step_db: float


PAYLOADS = {
    "arinc708": Payload(bins=512, highest=4, step_db=8.0),
    "wxr2100_6bit": Payload(bins=256, highest=63, step_db=1.0),
}


@dataclass(frozen=True)
class Radials:
    """n radials as the radar sends them: times (n,) in s, scan angles (n,) in degrees from the nose, bins (n, M)."""

    time_s: Floats
    scan_angle_deg: Floats
    bins: NDArray[np.uint8]


class Radar:
    """One radar on one flight; asked for a span of time, it looks at the ground from where the aircraft is then."""

    def __init__(self, settings: scenario.Scenario, ground: Ground, trajectory: Trajectory) -> None:
        self._settings, self._ground, self._trajectory = settings.radar, ground, trajectory
        self._seed, self._faults = settings.seed, settings.faults
        self.scan = antenna.scan(settings.radar)
        self.payload = PAYLOADS[settings.radar.payload]
        errors = np.random.default_rng((settings.seed, ERROR_STREAM)).normal(0.0, settings.errors.antenna_deg, 2)
        self._azimuth_error_deg, self._tilt_error_deg = (float(error) for error in errors)

    def between(self, start_s: float, stop_s: float) -> Radials:
        """The radials of [start, stop) seconds of flight."""
        numbers = self.scan.radials_between(start_s, stop_s)
        time = np.asarray(numbers * self.scan.interval_s, np.float64)
        angles = self.scan.angles_deg(numbers)
        angles[self._faulty("scanner_stuck", time)] = 0.0
        speaking = ~self._faulty("radar_silent", time)
        numbers, time, angles = numbers[speaking], time[speaking], angles[speaking]
        received = self.received(self.signal_to_noise(time, angles), numbers)
        return Radials(time, angles, self.levels(received))

    def words(self, radials: Radials) -> NDArray[np.uint8]:
        """ARINC 708 words (n, 200) of the radials."""
        return arinc708.encode_block(
            radials.bins,
            scan_angle_deg=radials.scan_angle_deg,
            tilt_deg=self._settings.tilt_deg,
            range_nm=self._settings.range_nm,
        )

    def signal_to_noise(self, time_s: Floats, scan_angle_deg: Floats) -> Floats:
        """Mean signal over mean noise (n, M), linear. The antenna is stabilised: only heading turns the beam."""
        truth = self._trajectory.at(time_s)
        latitude, longitude = truth.latitude_deg, truth.longitude_deg
        azimuth = truth.heading_deg + scan_angle_deg + self._azimuth_error_deg
        bearing = self._ground.grid_bearing(latitude, longitude, azimuth)
        views = Views(*self._ground.locate(latitude, longitude), truth.height_m, bearing)
        settings = self._settings
        beam = Beam(settings.tilt_deg + self._tilt_error_deg, settings.beam_width_deg, settings.azimuth_span)
        echo = mean_echo(self._ground, views, beam, settings.range_nm * METRES_PER_NM, self.payload.bins)
        return echo * 10 ** ((REFERENCE_GAMMA_DB + settings.snr_db - REFERENCE_SNR_DB) / 10)

    def received(self, signal_to_noise: Floats, numbers: Integers) -> Floats:
        """Power over mean noise (n, M) after averaging: the sum of echo and noise is Gaussian, its mean square a gamma.

        Every radial has its own stream, so the draw does not depend on how the flight is cut into spans.
        """
        looks = self._settings.looks
        draws = [
            np.random.default_rng((self._seed, SPECKLE_STREAM, int(number))).standard_gamma(looks, self.payload.bins)
            for number in numbers
        ]
        return (1.0 + signal_to_noise) * np.reshape(draws, signal_to_noise.shape) / looks

    def levels(self, received: Floats) -> NDArray[np.uint8]:
        """Bin codes (n, M) of powers over noise (n, M)."""
        above_db = 10 * np.log10(received) - FIRST_LEVEL_DB
        codes = np.floor(above_db / self.payload.step_db) + 1
        return np.asarray(np.clip(codes, 0, self.payload.highest), np.uint8)

    def _faulty(self, name: str, time_s: Floats) -> NDArray[np.bool_]:
        hits = [during(fault, time_s) for fault in self._faults if fault.name == name]
        return np.logical_or.reduce(hits) if hits else np.zeros(len(time_s), np.bool_)
