"""The senders that bridge makers start from: C and Python write the same bytes, and they are the packets intended."""

import importlib.util
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from cobs import cobs

from decoders.racklink import Framer, Packet

SENDER = Path(__file__).parents[1] / "examples" / "sender"
WARNINGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")
CODER = f"""
#define main example
#include "{SENDER / "sender.c"}"
#undef main
int main(void)
{{
    uint8_t data[4096];
    send_cobs(data, data + fread(data, 1, sizeof data, stdin));
    return 0;
}}
"""
EDGES = [
    b"",
    b"\0",
    b"\0\0",
    b"\1",
    *(bytes([7]) * n + end for n in (253, 254, 255, 508) for end in (b"", b"\0", b"a")),
]


def compiled(source: Path, program: Path) -> Path:
    compiler = shutil.which("cc")
    assert compiler, "the C sender is tested with a C compiler: install one as `cc`, such as Debian's package gcc"
    subprocess.run([compiler, *WARNINGS, "-o", program, source], check=True)
    return program


def from_python() -> bytes:
    return subprocess.run([sys.executable, "-I", "-S", SENDER / "sender.py"], capture_output=True, check=True).stdout


def test_the_c_sender_writes_the_same_bytes_as_the_python_one(tmp_path: Path) -> None:
    program = compiled(SENDER / "sender.c", tmp_path / "sender")
    assert subprocess.run([program], capture_output=True, check=True).stdout == from_python()


def test_they_are_a_hello_two_words_a_radar_word_and_a_heartbeat() -> None:
    framer = Framer()
    packets = framer.feed(from_python())
    assert (framer.skipped, framer.pending) == (0, 0)
    assert packets == [
        Packet(0x01, 0, 0, 0, 0, bytes.fromhex("34120000 0201 00700000 012a0004")),
        Packet(0x10, 1, 0x01, 1, 1_500_000_000, struct.pack("<IIII", 0, 0x600C808B, 360_000, 0xE00190A1)),
        Packet(0x20, 0, 0, 2, 1_502_000_000, bytes.fromhex("4006 b443047a0e80767c" + 64 * "88c6fa")),
        Packet(0x02, 0, 0, 3, 2_000_000_000, struct.pack("<BIIBII", 0, 1, 0, 1, 2, 2)),
    ]


@pytest.fixture(scope="module")
def c_coder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("coder")
    (place / "coder.c").write_text(CODER)
    return compiled(place / "coder.c", place / "coder")


@pytest.fixture(scope="module")
def python_sender() -> Any:
    spec = importlib.util.spec_from_file_location("sender", SENDER / "sender.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("data", EDGES, ids=lambda data: f"{len(data)} bytes to {data[-1:].hex()}")
def test_long_groups_and_zeros_at_the_end_are_coded_as_by_the_cobs_package(
    data: bytes, c_coder: Path, python_sender: Any
) -> None:
    whole = cobs.encode(data) + b"\0"
    assert subprocess.run([c_coder], input=data, capture_output=True, check=True).stdout == whole
    assert python_sender.cobs(data) + b"\0" == whole
