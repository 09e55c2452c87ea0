"""Device clocks of several bridges laid beside each other."""

import numpy as np
import pytest

from gateway.timebase import Timebase

SECOND_NS = 1_000_000_000


def test_words_of_a_single_bridge_keep_their_device_times() -> None:
    timebase = Timebase(["a", "b"])
    delays = np.random.default_rng(1).exponential(5e6, 500)
    for k, delay in enumerate(delays):
        assert timebase.offset_ns("a", k * 10_000_000, 77 * SECOND_NS + k * 10_000_000 + int(delay)) == 0
    assert timebase.restarts == 0


def test_two_bridges_are_aligned_to_their_smallest_delays_whatever_the_jitter() -> None:
    timebase = Timebase(["a", "b"])
    random = np.random.default_rng(2)
    ahead_ns = 3 * SECOND_NS  # the clock of b is that much ahead of a's
    offset = 0
    for k in range(2000):
        true_ns = k * 10_000_000
        for name, device_ns in (("a", true_ns), ("b", true_ns + ahead_ns)):
            host_ns = 50 * SECOND_NS + true_ns + 200_000 + int(random.exponential(3e6))
            offset = timebase.offset_ns(name, device_ns, host_ns)
    assert offset == pytest.approx(-ahead_ns, abs=1_000_000)
    assert timebase.restarts == 0


def test_drifting_clocks_are_followed() -> None:
    timebase = Timebase(["a", "b"])
    offset = 0
    for k in range(60_000):
        true_ns = k * 10_000_000
        timebase.offset_ns("a", true_ns, true_ns)
        offset = timebase.offset_ns("b", round(true_ns * (1 - 5e-5)), true_ns)
    assert offset == pytest.approx(600 * SECOND_NS * 5e-5, abs=100_000)


def test_a_late_burst_does_not_move_the_clocks() -> None:
    timebase = Timebase(["a", "b"])
    for k in range(100):
        timebase.offset_ns("a", k * 10_000_000, k * 10_000_000)
        timebase.offset_ns("b", k * 10_000_000, k * 10_000_000)
    late = timebase.offset_ns("b", SECOND_NS, 4 * SECOND_NS)
    assert late == pytest.approx(0, abs=1_000_000)


@pytest.mark.parametrize("restarted", ["a", "b"])
def test_a_bridge_that_restarts_is_aligned_anew_and_counted(restarted: str) -> None:
    timebase = Timebase(["a", "b"])
    offsets = {}
    for k in range(200):
        true_ns = 20 * SECOND_NS + k * 10_000_000
        for name in ("a", "b"):
            anew = k >= 100 and name == restarted
            device_ns = true_ns - (21 * SECOND_NS if anew else 0)
            offsets[name] = device_ns + timebase.offset_ns(name, device_ns, true_ns)
    assert offsets["b"] == pytest.approx(offsets["a"], abs=100_000)
    assert timebase.restarts == 1


def test_a_clock_that_leaps_ahead_of_the_host_began_anew_and_one_that_was_only_silent_did_not() -> None:
    timebase = Timebase(["a", "b"])
    timebase.offset_ns("a", 0, 0)
    timebase.offset_ns("a", 3600 * SECOND_NS, 3600 * SECOND_NS)
    assert timebase.restarts == 0
    timebase.offset_ns("a", 90_000 * SECOND_NS, 3601 * SECOND_NS)
    assert timebase.restarts == 1
