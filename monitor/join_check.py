"""Whether coarse and fine position words are joined by the right rule; the wrong one leaves a sawtooth.

South of the equator and west of Greenwich the two rules part: added or subtracted, the fine word puts the position up
to two coarse steps of 0.000172 degrees apart. A flight path is smooth, so the rule with the smaller second differences
is the true one. In the north and east both rules give the same and nothing can be said, nor needs to be.
"""

from collections import deque
from itertools import pairwise

from decoders.arinc429 import JOIN_RULES, TOWARD_ZERO, JoinRule
from decoders.kernels429 import join_position

EPOCHS = 20  # looked at, after each of which the rules are compared
ROUGH_DEG = 5e-5  # mean second difference that no flight and no receiver has: 5 m from one epoch to the next
CLEARLY = 4.0


class JoinCheck:
    """Fed with every joined pair of one coordinate."""

    def __init__(self) -> None:
        self._joined: dict[str, deque[float]] = {rule: deque(maxlen=EPOCHS) for rule in JOIN_RULES}
        self._rule: JoinRule = "concatenate"

    def feed(self, coarse: int, fine: int, rule: JoinRule) -> float:
        """The degrees of one pair of raw words, joined by `rule`."""
        self._rule = rule
        for name, joined in self._joined.items():
            joined.append(join_position(coarse, fine, name == TOWARD_ZERO))
        return self._joined[rule][-1]

    def doubt(self) -> str | None:
        """Why the other rule seems to be the right one, or None."""
        if len(self._joined[self._rule]) < EPOCHS:
            return None
        roughness = {rule: _roughness_deg([*joined]) for rule, joined in self._joined.items()}
        (other,) = set(JOIN_RULES) - {self._rule}
        if roughness[self._rule] < max(ROUGH_DEG, CLEARLY * roughness[other]):
            return None
        return (
            f"joined by {self._rule!r} the position jumps {roughness[self._rule]:.6f} deg from epoch to epoch, "
            f"by {other!r} {roughness[other]:.6f}: set join_rule of the channel"
        )


def _roughness_deg(joined: list[float]) -> float:
    """The mean of the second differences, whatever their signs."""
    steps = [b - a for a, b in pairwise(joined)]
    return sum(abs(b - a) for a, b in pairwise(steps)) / (len(steps) - 1)
