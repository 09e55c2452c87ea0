"""A record comes back as it was written, or not at all."""

import json
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.recording.layout import (
    LAYOUTS,
    DamagedRecord,
    Topic,
    channel_entries,
    guarded,
    parse_channel,
    parse_metadata,
    parse_payload,
    payload,
    topic_of,
)
from gateway.records import Note, Raw, Record, Stamp, Status, Tick
from tests.gateway.made import raw, some_records, stamp

U64 = st.integers(0, 2**64 - 1)
STAMPS = st.builds(Stamp, U64, U64)
BRIDGE, TICK = Topic("/raw/bridge", LAYOUTS["2"]), Topic("/tick", LAYOUTS["2"])


def again(record: Record) -> Record:
    topic = Topic(topic_of(record), LAYOUTS["2"])
    return parse_payload(topic, payload(record, topic.seed))


@given(U64, STAMPS, st.binary(max_size=300), st.integers(0, 2**32 - 1))
def test_a_raw_record_survives_the_file(sequence: int, when: Stamp, data: bytes, dropped: int) -> None:
    record = Raw(sequence, when, "left-2", data, dropped)
    assert again(record) == record


@given(U64, STAMPS, st.text(), st.text(), st.text())
def test_the_other_records_survive_the_file(sequence: int, when: Stamp, adapter: str, state: str, reason: str) -> None:
    for record in (Status(sequence, when, adapter, state, reason), Tick(sequence, when), Note(sequence, when, reason)):
        assert again(record) == record
        assert type(again(record)) is type(record)


def test_a_loss_too_large_for_its_field_stands_at_its_largest() -> None:
    assert again(raw(1, 0, b"x", dropped=2**40)) == raw(1, 0, b"x", dropped=2**32 - 1)


@pytest.mark.parametrize("record", some_records(), ids=lambda record: type(record).__name__)
def test_every_flipped_byte_and_every_shortened_payload_is_noticed(record: Record) -> None:
    topic = Topic(topic_of(record), LAYOUTS["2"])
    whole = payload(record, topic.seed)
    damaged = [whole[:k] + bytes([whole[k] ^ 0x40]) + whole[k + 1 :] for k in range(len(whole))]
    for data in [*damaged, *(whole[:size] for size in range(len(whole)))]:
        with pytest.raises(DamagedRecord, match="CRC"):
            parse_payload(topic, data)


def test_a_chunk_of_one_adapter_cannot_pass_for_another_s() -> None:
    with pytest.raises(DamagedRecord, match="CRC"):
        parse_payload(Topic("/raw/other", LAYOUTS["2"]), payload(raw(1, 0, b"x"), BRIDGE.seed))


def test_json_records_stay_json_whose_crc_anybody_can_check() -> None:
    text = payload(Note(7, stamp(1), "all is well"), Topic("/note", LAYOUTS["2"]).seed)
    fields = json.loads(text)
    assert (fields["sequence"], fields["text"]) == (7, "all is well")
    before = text[: text.index(b',"crc32":')]
    assert fields["crc32"] == zlib.crc32(b"/note" + before)


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"{", b"\xff", b"[]", b"{}", b'{"sequence":1,"stamp":3}', b'{"sequence":1,"stamp":{}}', b"[" * 100_000),
        b'{"sequence":1.5,"stamp":{"monotonic_ns":1,"utc_ns":2}}',
        b'{"sequence":1,"stamp":{"monotonic_ns":"","utc_ns":2}}',
    ],
)
def test_json_that_is_no_record_is_noticed_without_a_crc(data: bytes) -> None:
    with pytest.raises(DamagedRecord, match="tick"):
        parse_payload(Topic("/tick", LAYOUTS["1"]), data)


def text(value: str) -> bytes:
    return len(value.encode()).to_bytes(4, "little") + value.encode()


def entries(table: dict[str, str]) -> bytes:
    body = b"".join(text(key) + text(value) for key, value in table.items())
    return len(body).to_bytes(4, "little") + body


def test_every_flipped_byte_of_a_channel_is_noticed() -> None:
    encoding, table = channel_entries(3, "/raw/bridge")
    whole = b"\x03\0\0\0" + text("/raw/bridge") + text(encoding) + entries(table)
    assert parse_channel(whole) == (3, BRIDGE)
    for k in range(len(whole)):
        for flip in (1, 0x80, 0xFF):
            with pytest.raises(DamagedRecord):
                parse_channel(whole[:k] + bytes([whole[k] ^ flip]) + whole[k + 1 :])


def test_every_flipped_byte_of_the_metadata_is_noticed() -> None:
    metadata = {"configuration": "{}", "host": "here"}
    whole = text("shadebus") + entries(guarded("shadebus", metadata))
    assert parse_metadata(whole) == {**metadata, "format": "2"}
    for k in range(len(whole)):
        for flip in (1, 0x80, 0xFF):
            with pytest.raises(DamagedRecord):
                parse_metadata(whole[:k] + bytes([whole[k] ^ flip]) + whole[k + 1 :])
