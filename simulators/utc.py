"""UTC as the GNSS sensor sends it: date in BCD (260), time of day (150) and the fraction of the second (140)."""

import numpy as np
from numpy.typing import NDArray

from decoders.formats import DATE_DIGITS, TIME_FIELDS

Times = NDArray[np.datetime64]
Integers = NDArray[np.int64]

PRECISE_TIME = 1  # label 150, bit 11: the time comes from satellites, not from the battery clock


def date_data(utc: Times) -> Integers:
    """Bits 11 to 29 of label 260 for times (n,): two BCD digits each of day, month and year of the century."""
    days, months = utc.astype("datetime64[D]"), utc.astype("datetime64[M]")
    numbers = {
        "day": (days - months).astype(np.int64) + 1,
        "month": months.astype(np.int64) % 12 + 1,
        "year": (months.astype(np.int64) // 12 + 1970) % 100,
    }
    data = np.zeros(len(utc), np.int64)
    for digit, (first_bit, _) in DATE_DIGITS.items():
        name, place = digit.split("_")
        tens, units = np.divmod(numbers[name], 10)
        data |= (tens if place == "tens" else units) << (first_bit - 11)
    return data


def time_data(utc: Times) -> Integers:
    """Bits 11 to 29 of label 150 for times (n,): hours, minutes and seconds, and bit 11 for precise time."""
    second = _nanoseconds_of_day(utc) // 10**9
    numbers = {"hours": second // 3600, "minutes": second // 60 % 60, "seconds": second % 60}
    data = np.full(len(utc), PRECISE_TIME, np.int64)
    for name, (first_bit, _, _) in TIME_FIELDS.items():
        data |= numbers[name] << (first_bit - 11)
    return data


def fraction_s(utc: Times) -> NDArray[np.float64]:
    """Label 140 for times (n,): the fraction of the second, cut to 2^-20 s as rounding up could reach a whole one."""
    return np.asarray((_nanoseconds_of_day(utc) % 10**9 * 2**20 // 10**9) / 2**20, np.float64)


def _nanoseconds_of_day(utc: Times) -> Integers:
    return np.asarray((utc.astype("datetime64[ns]") - utc.astype("datetime64[D]")).astype(np.int64))
