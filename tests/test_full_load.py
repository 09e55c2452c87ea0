"""Every word of full buses arrives over each kind of line; `make full-load` measures what that costs."""

import pytest

from benchmarks.full_load import LINES, run


@pytest.mark.parametrize("name", LINES)
def test_full_buses_lose_no_word(name: str) -> None:
    found = run(name, seconds=4.0)
    assert found["radar words arrived"] == found["radar words sent"] == 4_000_000 // 1606
    assert found["ARINC 429 words arrived"] == found["ARINC 429 words sent"] == 4 * (4_000_000 // 360)
    assert found["words counted as lost"] == 0
