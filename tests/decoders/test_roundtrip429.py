"""Words from the simulators' encoder, which shares only the label rows, back through the decoder, value by value."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoders.arinc429 import Status, Values429, Words429, decode, field, text, unpack
from decoders.definitions import Definition, load_definitions, set_names
from simulators.arinc429 import encode_array, encode_data
from tests.decoders.bus import word429

MOST_VALUES = 2**17
BINARY = [
    (name, row)
    for name in set_names()
    for row in load_definitions(name).labels.values()
    if row.encoding in ("bnr", "bnr_unsigned") and 2 ** (row.bits[1] - row.bits[0] + 2) <= MOST_VALUES
]


@pytest.mark.parametrize(
    ("name", "row"), BINARY, ids=lambda part: part if isinstance(part, str) else f"{part.label:03o}"
)
def test_every_value_of_a_field_comes_back_exactly(name: str, row: Definition) -> None:
    width = row.bits[1] - row.bits[0] + 1
    integers = np.arange(-(2**width) if row.encoding == "bnr" else 0, 2**width)
    # Python's quotient of two integers is the exact one rounded once.
    sent = np.array([integer * row.lsb.numerator / row.lsb.denominator for integer in integers.tolist()])
    words = encode_array(row.label, sent, definition=row, ssm=0 if row.ssm == "disc" else 3)
    values = decode(words, load_definitions(name))
    assert not values.status.any()
    np.testing.assert_array_equal(values.value, sent)


@pytest.mark.parametrize("name", set_names())
@given(words=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=40), swapped=st.booleans())
def test_a_block_gives_bit_for_bit_what_its_words_give_one_by_one(name: str, words: list[int], swapped: bool) -> None:
    definitions, orientation = load_definitions(name), "label_swapped" if swapped else "wire"
    values = decode(words, definitions, orientation)
    ones = [decode([word], definitions, orientation) for word in words]
    for part, value in values._asdict().items():
        assert value.tobytes() == b"".join(getattr(one, part).tobytes() for one in ones)
    parts = unpack(words, orientation)
    for part, value in parts._asdict().items():
        assert value.tobytes() == b"".join(getattr(unpack([word], orientation), part).tobytes() for word in words)


def test_every_minute_of_the_clock_comes_back() -> None:
    words = []
    for minutes in range(1440):
        hours, rest = divmod(minutes, 60)
        digits = {27: (hours // 10, 2), 23: (hours % 10, 4), 19: (rest // 10, 4), 15: (rest % 10, 4)}
        words.append(word429(0o125, {**digits, 11: (minutes % 10, 4)}))
    values = decode(words, load_definitions("clock_731"))
    assert not values.status.any()
    assert values.value.tolist() == [(10 * minutes + minutes % 10) / 10 for minutes in range(1440)]


@pytest.mark.parametrize("digits", [{27: (2, 2), 23: (4, 4)}, {19: (6, 4)}, {11: (10, 4)}, {27: (3, 2)}, {15: (15, 4)}])
def test_a_clock_beyond_its_day_is_invalid(digits: dict[int, tuple[int, int]]) -> None:
    assert decode([word429(0o125, digits)], load_definitions("clock_731")).status[0] == Status.INVALID_DATA


@given(data=st.integers(0, 2**19 - 1))
def test_discrete_fields_beside_a_value_come_back(data: int) -> None:
    definitions = load_definitions("gnss_743a")
    for label in (0o130, 0o150, 0o273, 0o343, 0o060):
        row = definitions.labels[label]
        words = encode_data(label, [data])
        for name, (first, last) in row.fields.items():
            assert field(words, row, name)[0] == data >> (first - 11) & ((1 << last - first + 1) - 1)


ISO5 = """
[mine]
equipment_id = 0x0FE
rows = [
  { label = "233", name = "Flight number", encoding = "iso5", bits = [11, 24], source = "test", confidence = "test" },
]
"""


def test_text_comes_back_as_text_and_what_cannot_be_printed_is_invalid(tmp_path: Path) -> None:
    (tmp_path / "text.toml").write_text(ISO5)
    definitions = load_definitions(tmp_path / "text.toml")
    row = definitions.labels[0o233]
    words = [word429(0o233, {11: (ord(one), 7), 18: (ord(other), 7)}) for one, other in ("AZ", "7\0", "\x07A", " ~")]
    values = decode(words, definitions)
    assert text(words, row) == ["AZ", "7", "\x07A", " ~"]
    assert values.status.tolist() == [Status.NORMAL, Status.NORMAL, Status.INVALID_DATA, Status.NORMAL]
    assert values.value[0] == ord("A") + ord("Z") * 128


def test_no_decoder_emits_a_field_that_nobody_declared() -> None:
    """The fields that the interface page promises, their order and their types."""
    declared = {
        Words429: {"label": "u1", "sdi": "u1", "data": "u4", "ssm": "u1", "parity_ok": "b1"},
        Values429: {"label": "u1", "value": "f8", "status": "u1"},
    }
    for kind, fields in declared.items():
        found = unpack([0]) if kind is Words429 else decode([0], load_definitions("iru_704"))
        assert {name: part.dtype.str[1:] for name, part in found._asdict().items()} == fields
