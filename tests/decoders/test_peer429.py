"""Side by side with PyPI `arinc429` 0.1.7: equal on the values that both should agree on, and where that peer is wrong.

It takes words as four bytes, the last on the wire first. Each place where it departs from the standard has a test that
shows both answers, so that a later release that mends one is noticed.
"""

import arinc429 as peer
import numpy as np
import pytest

from decoders.arinc429 import Status, decode, unpack
from decoders.definitions import Definition, load_definitions
from tests.decoders.bus import NORMAL_SSM, word429

IRU, RADIO = load_definitions("iru_704"), load_definitions("ra_707")
AGREED = [row for row in IRU.labels.values() if row.encoding == "bnr" and row.bits[0] > 10]


def theirs(word: int, row: Definition) -> peer.ArincWord:
    encoding = {"bnr": "BNR", "bcd": "BCD"}[row.encoding]
    return peer.Decoder().decode(word.to_bytes(4, "big"), encoding, msb=29, lsb=row.bits[0], scale=float(row.lsb))


def ours(word: int, name: str) -> float:
    values = decode([word], load_definitions(name))
    assert values.status[0] == Status.NORMAL
    return float(values.value[0])


@pytest.mark.parametrize("row", AGREED, ids=lambda row: f"{row.label:03o}")
def test_positive_values_labels_and_parts_agree(row: Definition) -> None:
    width = row.bits[1] - row.bits[0] + 1
    for integer in (0, 1, 2 ** (width - 1), 2**width - 1):
        word = word429(row.label, {9: (2, 2), row.bits[0]: (integer, width)}, NORMAL_SSM[row.ssm])
        found, parts = theirs(word, row), unpack([word])
        assert (found.label, found.sdi, found.ssm) == (parts.label[0], parts.sdi[0], parts.ssm[0])
        assert found.value == ours(word, "iru_704")


def test_decimal_words_agree() -> None:
    for digits in (0x00000, 0x00001, 0x12345, 0x79999):
        word = word429(0o165, {11: (digits, 19)})
        assert theirs(word, RADIO.labels[0o165]).value == round(ours(word, "ra_707") * 10)


def test_the_peer_reads_a_negative_binary_value_as_large_and_positive() -> None:
    word = word429(0o324, {15: (2**15 - 1, 15)}, ssm=3)
    assert ours(word, "iru_704") == -180 / 2**14
    assert theirs(word, IRU.labels[0o324]).value == 360 - 180 / 2**14


def test_the_peer_loses_the_two_lowest_bits_of_20_bit_words() -> None:
    word = word429(0o310, {9: (1001, 21)}, ssm=3)
    assert ours(word, "iru_704") == 1001 * 180 / 2**20
    assert theirs(word, IRU.labels[0o310]).value == 1000 * 180 / 2**20


def test_the_peer_gives_no_sign_to_a_decimal_value() -> None:
    word = word429(0o165, {11: (0x00205, 19)}, ssm=3)
    assert ours(word, "ra_707") == -20.5
    assert theirs(word, RADIO.labels[0o165]).value == 205


def test_the_peer_gives_a_value_to_a_word_of_bad_parity() -> None:
    word = word429(0o324, {15: (1000, 15)}, ssm=3, odd=False)
    assert decode([word], IRU).status[0] == Status.BAD_PARITY
    assert theirs(word, IRU.labels[0o324]).value == 1000 * 180 / 2**14


def test_the_peer_gives_a_value_to_a_word_without_computed_data() -> None:
    word = word429(0o324, {15: (1000, 15)}, ssm=1)
    assert decode([word], IRU).status[0] == Status.NO_COMPUTED_DATA
    assert theirs(word, IRU.labels[0o324]).value == 1000 * 180 / 2**14


def test_the_peer_turns_an_integer_s_bytes_round() -> None:
    word = word429(0o324, {15: (1000, 15)}, ssm=3)
    assert unpack([word]).label[0] == 0o324
    assert peer.Decoder().decode(word, "BNR").label != 0o324


def test_results_of_one_decoder_of_the_peer_are_one_object() -> None:
    decoder = peer.Decoder()
    first = decoder.decode(word429(0o165, {11: (0x12345, 19)}).to_bytes(4, "big"), "BCD")
    second = decoder.decode(word429(0o165, {11: (0x00001, 19)}).to_bytes(4, "big"), "BCD")
    assert first is second
    block = decode(np.array([word429(0o165, {11: (n, 19)}) for n in (5, 1)], np.uint32), RADIO)
    assert block.value.tolist() == [0.5, 0.1]
