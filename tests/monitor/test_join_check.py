"""The sawtooth that the wrong rule of joining leaves is seen, and a rough flight is not taken for one."""

import numpy as np
import pytest
from numpy.typing import NDArray

from decoders.arinc429 import JOIN_RULES, JoinRule
from monitor.join_check import EPOCHS, JoinCheck
from tests.decoders.bus import word429

Floats = NDArray[np.float64]

STEP_DEG = 180 / 2**31
METRE_DEG = 1 / 111_320


def words(degrees: float, box: JoinRule) -> tuple[int, int]:
    """What a box of either kind sends: the remainder of the angle, or that of its magnitude."""
    steps = round(abs(degrees) / STEP_DEG) if box == "toward_zero" else round(degrees / STEP_DEG)
    coarse, fine = divmod(steps, 2048)
    if box == "toward_zero" and degrees < 0:
        coarse = -coarse
    return word429(0o110, {9: (coarse & 0x1FFFFF, 21)}, 3), word429(0o120, {18: (fine, 11)}, 3)


def checked(track: Floats, box: JoinRule, rule: JoinRule) -> str | None:
    check = JoinCheck()
    for degrees in track:
        coarse, fine = words(float(degrees), box)
        check.feed(coarse, fine, rule)
    return check.doubt()


@pytest.fixture(params=[90.0, 9.0, 3.0], ids=["90 m/s", "9 m/s", "3 m/s"])
def southward(request: pytest.FixtureRequest) -> Floats:
    noise = np.random.default_rng(5).normal(0, 0.5 * METRE_DEG, EPOCHS)
    speed_m_s: float = request.param
    return np.asarray(-44.0 - np.arange(EPOCHS) * speed_m_s * METRE_DEG + noise)


@pytest.mark.parametrize("box", JOIN_RULES)
def test_the_wrong_rule_is_doubted_with_the_right_one_named_and_the_right_one_is_not(
    southward: Floats, box: JoinRule
) -> None:
    (wrong,) = set(JOIN_RULES) - {box}
    assert checked(southward, box, box) is None
    doubt = checked(southward, box, wrong)  # type: ignore[arg-type]
    assert doubt is not None
    assert f"by {box!r} 0.0000" in doubt


def test_north_of_the_equator_both_rules_are_one(southward: Floats) -> None:
    assert [checked(-southward, box, rule) for box in JOIN_RULES for rule in JOIN_RULES] == [None] * 4


def test_a_steep_turn_and_jumps_of_the_receiver_are_no_sawtooth() -> None:
    time = np.arange(EPOCHS)
    turn = -44.0 + 500 * METRE_DEG * np.sin(time / 5)
    jumps = -44.0 + 300 * METRE_DEG * np.cumsum(time % 4 == 0)
    assert [checked(track, "concatenate", "concatenate") for track in (turn, jumps)] == [None, None]


def test_a_few_epochs_say_nothing(southward: Floats) -> None:
    assert checked(southward[:-1], "toward_zero", "concatenate") is None
