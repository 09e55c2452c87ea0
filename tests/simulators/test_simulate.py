"""`shadebus simulate` as a process of its own, heard by other people's readers."""

import socket
import struct
import subprocess
import sys
from pathlib import Path

import serial

from tests.simulators.small_bridge import heard

SIMULATE = [sys.executable, "-m", "gateway", "simulate"]
SMALL = """
[flight]
latitude_deg = 44.37514
longitude_deg = -71.71874
height_m = 761.0
heading_deg = 197.6
duration_s = 2
[radar]
step_deg = 3.0
range_nm = 5
"""
UNPLUGGED = '[[link_faults]]\nname = "unplug"\nstart_s = 0.5\nstop_s = 1.0\n'
PATIENCE_S = 60


def written(folder: Path, text: str) -> str:
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_udp_listener_hears_all_words_that_the_last_heartbeat_counts(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**21)
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(PATIENCE_S)
        place = "udp:{}:{}".format(*listener.getsockname())
        command = [*SIMULATE, written(tmp_path, SMALL), "--to", place, "--speed", "4"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as simulation:
            datagrams = [listener.recv(4096)]
            while (datagrams[-1][1], struct.unpack_from("<Q", datagrams[-1], 8)) != (0x02, (2 * 10**9,)):
                datagrams.append(listener.recv(4096))
            told, _ = simulation.communicate(timeout=PATIENCE_S)
    assert told == place + "\n"
    words, counts = heard(datagrams, "datagram")
    assert counts == {channel: (words[channel], 0) for channel in range(4)}
    assert min(words[channel] for channel in range(4)) > 0


def test_a_replugged_terminal_tells_its_new_name(tmp_path: Path) -> None:
    command = [*SIMULATE, written(tmp_path, SMALL + UNPLUGGED)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as simulation:
        assert simulation.stdout is not None
        places = []
        for line in simulation.stdout:
            place = line.strip()
            with serial.Serial(place.removeprefix("serial:")) as host:
                try:
                    while host.read(max(1, host.in_waiting)):
                        pass
                except (serial.SerialException, OSError):
                    places.append(place)
        assert simulation.wait(PATIENCE_S) == 0
    assert len(set(places)) == 2
