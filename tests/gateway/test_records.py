"""A record comes back as it was written, or not at all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.records import (
    DamagedRecord,
    Note,
    Raw,
    Stamp,
    Status,
    Tick,
    json_payload,
    parse_json,
    parse_raw,
    raw_payload,
)
from tests.gateway.made import raw, stamp

U64 = st.integers(0, 2**64 - 1)
STAMPS = st.builds(Stamp, U64, U64)


@given(U64, STAMPS, st.binary(max_size=300), st.integers(0, 2**32 - 1))
def test_a_raw_record_survives_the_file(sequence: int, when: Stamp, data: bytes, dropped: int) -> None:
    record = Raw(sequence, when, "left-2", data, dropped)
    assert parse_raw("left-2", raw_payload(record)) == record


@given(U64, STAMPS, st.text(), st.text(), st.text())
def test_the_other_records_survive_the_file(sequence: int, when: Stamp, adapter: str, state: str, reason: str) -> None:
    for record in (Status(sequence, when, adapter, state, reason), Tick(sequence, when), Note(sequence, when, reason)):
        assert parse_json(type(record), json_payload(record)) == record


def test_a_loss_too_large_for_its_field_stands_at_its_largest() -> None:
    assert parse_raw("bridge", raw_payload(raw(1, 0, b"x", dropped=2**40))).dropped_before == 2**32 - 1


def test_every_flipped_byte_of_a_raw_payload_is_noticed() -> None:
    payload = raw_payload(raw(1, 0.5, b"some words"))
    for place in range(len(payload)):
        damaged = bytearray(payload)
        damaged[place] ^= 0x40
        with pytest.raises(DamagedRecord, match="CRC"):
            parse_raw("bridge", bytes(damaged))


def test_every_shortened_raw_payload_is_noticed() -> None:
    payload = raw_payload(raw(1, 0.5, b"some words"))
    for size in range(len(payload)):
        with pytest.raises(DamagedRecord):
            parse_raw("bridge", payload[:size])


@pytest.mark.parametrize(
    "payload",
    [b"", b"{", b"\xff", b"[]", b"{}", b'{"sequence":1,"stamp":3}', b'{"sequence":1,"stamp":{}}'],
)
def test_json_that_is_no_record_is_noticed(payload: bytes) -> None:
    with pytest.raises(DamagedRecord, match="tick"):
        parse_json(Tick, payload)


def test_a_record_of_another_kind_is_noticed() -> None:
    with pytest.raises(DamagedRecord, match="tick"):
        parse_json(Tick, json_payload(Note(1, stamp(0), "no tick")))
