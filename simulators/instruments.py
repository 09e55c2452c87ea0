"""The instruments on the ARINC 429 buses: the words each sends, how often, and with what status.

An instrument is a source of words: a table of labels with their intervals, over what it measures, under the faults
that change the sign/status matrix.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC

import numpy as np
from numpy.typing import NDArray

from decoders.formats import KIND_429_HIGH
from simulators import scenario, utc
from simulators.arinc429 import (
    BNR_NORMAL,
    FAILURE_WARNING,
    NO_COMPUTED_DATA,
    Words,
    encode_array,
    encode_data,
    encode_position,
    without_data,
)
from simulators.flight import Trajectory, Truth
from simulators.measurements import FEET, KNOTS, during, gnss_measurement, inertial_measurement
from simulators.terrain import Ground

Floats = NDArray[np.float64]
Source = Callable[[int, Floats], Words]  # label and times (n,) in seconds -> words (n,)

RADIO_STREAM = 7
NO_TRACK_BELOW_KT = 7.0
RADIO_ALTIMETER_LIMIT_FT = 2500.0
NAVIGATION_MODE = 0b011 << 15  # label 273, bits 28 to 26
HIL_NM = 0.1

INERTIAL_LABELS = {  # label: (interval in s, what, factor to the label's unit)
    0o310: (0.150, "latitude_deg", 1.0),
    0o311: (0.150, "longitude_deg", 1.0),
    0o312: (0.040, "ground_speed_mps", KNOTS),
    0o313: (0.040, "track_deg", 1.0),
    0o314: (0.040, "heading_deg", 1.0),
    0o324: (0.020, "pitch_deg", 1.0),
    0o325: (0.020, "roll_deg", 1.0),
    0o361: (0.040, "height_m", FEET),
}
GNSS_COMPUTED = (0o110, 0o120, 0o111, 0o121, 0o076, 0o112, 0o103)
GNSS_LABELS = (*GNSS_COMPUTED, 0o130, 0o150, 0o140, 0o260, 0o273)
RADIO_ALTITUDE = 0o164
RADIO_ALTITUDE_INTERVAL_S = 0.040

EQUIPMENT, EQUIPMENT_INTERVAL_S = 0o377, 1.0  # every box names itself

BIT_FAULTS = {  # fault: (label, bit that turns over, and the parity with it)
    "gnss_satellite_failure": (0o130, 11),
    "gnss_acquisition": (0o273, 26),  # navigation, 011 in bits 28 to 26, becomes acquisition
}
STATUS_FAULTS = {  # fault: (labels, sign/status matrix)
    "gnss_no_computed_data": (GNSS_COMPUTED, NO_COMPUTED_DATA),
    "inertial_failure_warning": (tuple(INERTIAL_LABELS), FAILURE_WARNING),
    "radio_altitude_no_computed_data": ((RADIO_ALTITUDE,), NO_COMPUTED_DATA),
}


@dataclass(frozen=True)
class Channel:
    """One ARINC 429 bus: its number and kind on the link, its equipment, and its labels in the order sent.

    `words(label, times)` gives the words (n,) of a label due at times (n,) in seconds.
    """

    number: int
    kind: int
    equipment: int
    intervals_s: Mapping[int, float]
    words: Source


def channels(settings: scenario.Scenario, trajectory: Trajectory, ground: Ground) -> tuple[Channel, ...]:
    """Inertial reference (1), GNSS sensor (2) and radio altimeter (3), with the scenario's status faults."""
    healthy = (
        Channel(1, KIND_429_HIGH, 0x04, _inertial_intervals(), inertial(settings, trajectory)),
        Channel(
            2,
            KIND_429_HIGH,
            0x0B,
            dict.fromkeys(GNSS_LABELS, settings.gnss_interval_s),
            gnss(settings, trajectory),
        ),
        Channel(
            3,
            KIND_429_HIGH,
            0x07,
            {RADIO_ALTITUDE: RADIO_ALTITUDE_INTERVAL_S},
            radio_altimeter(settings, trajectory, ground),
        ),
    )
    return tuple(_with_faults(_announcing(channel), settings.faults) for channel in healthy)


def inertial(settings: scenario.Scenario, trajectory: Trajectory) -> Source:
    """The inertial reference: every label of its table from the same measured motion."""
    measure = inertial_measurement(settings, trajectory)

    def words(label: int, time_s: Floats) -> Words:
        _, what, factor = INERTIAL_LABELS[label]
        return encode_array(label, getattr(measure(time_s), what) * factor)

    return words


def gnss(settings: scenario.Scenario, trajectory: Trajectory) -> Source:
    """The GNSS sensor: every label of an epoch tells of the same instant."""
    measure = gnss_measurement(settings, trajectory)
    epoch = np.datetime64(settings.epoch.astimezone(UTC).replace(tzinfo=None), "ns")

    def words(label: int, time_s: Floats) -> Words:
        measured = measure(time_s)
        instants = epoch + np.rint(time_s * 1e9).astype("timedelta64[ns]")
        return GNSS_WORDS[label](measured, instants)

    return words


def radio_altimeter(settings: scenario.Scenario, trajectory: Trajectory, ground: Ground) -> Source:
    """Height above the ground straight below, with noise; no computed data above 2,500 ft or over unknown ground."""
    rng = np.random.default_rng((settings.seed, RADIO_STREAM))
    count = math.ceil(settings.flight.total_s / RADIO_ALTITUDE_INTERVAL_S) + 1
    noise = rng.normal(0.0, settings.errors.radio_altitude_m, count)

    def words(label: int, time_s: Floats) -> Words:
        truth = trajectory.at(time_s)
        below = ground.elevation(*ground.locate(truth.latitude_deg, truth.longitude_deg))
        drawn = noise[np.minimum(np.rint(time_s / RADIO_ALTITUDE_INTERVAL_S).astype(np.int64), count - 1)]
        feet = (truth.height_m - below + drawn) * FEET
        heard = feet <= RADIO_ALTIMETER_LIMIT_FT
        return _unless(heard, encode_array(label, np.where(heard, feet, 0.0)), NO_COMPUTED_DATA)

    return words


def _inertial_intervals() -> dict[int, float]:
    return {label: interval for label, (interval, _, _) in INERTIAL_LABELS.items()}


def _unless(good: NDArray[np.bool_], words: Words, ssm: int) -> Words:
    return np.where(good, words, without_data(words, ssm))


def _announcing(channel: Channel) -> Channel:
    """The same bus with the equipment label of its box."""

    def words(label: int, time_s: Floats) -> Words:
        if label == EQUIPMENT:
            return encode_data(EQUIPMENT, np.full(len(time_s), channel.equipment))
        return channel.words(label, time_s)

    return replace(channel, words=words, intervals_s={**channel.intervals_s, EQUIPMENT: EQUIPMENT_INTERVAL_S})


def _with_faults(channel: Channel, faults: Sequence[scenario.Fault]) -> Channel:
    """The same bus under the faults of its labels."""

    def faulty(label: int, time_s: Floats) -> Words:
        sent = channel.words(label, time_s)
        for fault in faults:
            labels, ssm = STATUS_FAULTS.get(fault.name, ((), BNR_NORMAL))
            if label in labels:
                sent = _unless(~during(fault, time_s), sent, ssm)
            turned, bit = BIT_FAULTS.get(fault.name, (None, 1))
            if label == turned:
                sent = np.where(during(fault, time_s), sent ^ np.uint32(1 << bit - 1 | 1 << 31), sent)
        return sent

    return replace(channel, words=faulty)


def _track_words(measured: Truth, _: utc.Times) -> Words:
    """No computed data below about 7 kt, where a receiver cannot tell its track."""
    moving = measured.ground_speed_mps * KNOTS >= NO_TRACK_BELOW_KT
    return _unless(moving, encode_array(0o103, measured.track_deg), NO_COMPUTED_DATA)


GNSS_WORDS: dict[int, Callable[[Truth, utc.Times], Words]] = {
    0o110: lambda measured, _: encode_position(0o110, 0o120, measured.latitude_deg)[0],
    0o120: lambda measured, _: encode_position(0o110, 0o120, measured.latitude_deg)[1],
    0o111: lambda measured, _: encode_position(0o111, 0o121, measured.longitude_deg)[0],
    0o121: lambda measured, _: encode_position(0o111, 0o121, measured.longitude_deg)[1],
    0o076: lambda measured, _: encode_array(0o076, measured.height_m * FEET),
    0o112: lambda measured, _: encode_array(0o112, measured.ground_speed_mps * KNOTS),
    0o103: _track_words,
    0o130: lambda measured, _: encode_array(0o130, np.full_like(measured.time_s, HIL_NM)),
    0o150: lambda _, instants: encode_data(0o150, utc.time_data(instants), ssm=BNR_NORMAL),
    0o140: lambda _, instants: encode_array(0o140, utc.fraction_s(instants)),
    0o260: lambda _, instants: encode_data(0o260, utc.date_data(instants)),
    0o273: lambda _, instants: encode_data(0o273, np.full(len(instants), NAVIGATION_MODE)),
}
