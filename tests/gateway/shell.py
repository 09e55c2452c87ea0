"""The real command line, as a process of its own or within this one."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import Self
from unittest.mock import patch

import pytest

from gateway.cli import main
from tests.gateway.live import wait_until

START_S = 60.0
GATEWAY = (sys.executable, "-m", "gateway")
WIDE = {**os.environ, "COLUMNS": "200"}  # so that no table breaks a line


def shadebus(*arguments: str | Path, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    """Run a verb to its end."""
    command = [*GATEWAY, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=START_S, env=WIDE, cwd=cwd, check=False)


def within(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """Run a verb to its end in this process, which saves its start; the signals stay those of the tests."""
    command, output, errors = ["shadebus", *map(str, arguments)], StringIO(), StringIO()
    with (
        patch.object(sys, "argv", command),
        patch.dict(os.environ, WIDE),
        patch("gateway.stopping.signal.signal"),
        redirect_stdout(output),
        redirect_stderr(errors),
        pytest.raises(SystemExit) as end,
    ):
        main()
    code = end.value.code
    assert isinstance(code, int)
    return subprocess.CompletedProcess(command, code, output.getvalue(), errors.getvalue())


def limited(largest_file: int | None) -> Sequence[str]:
    """A prefix under which `write()` fails, as on a full disk, where a file would grow beyond so many bytes."""
    if largest_file is None:
        return ()
    limit = f"resource.setrlimit(resource.RLIMIT_FSIZE, ({largest_file}, {largest_file}))"
    return (sys.executable, "-c", f"import os, resource, sys; {limit}; os.execv(sys.argv[1], sys.argv[1:])")


class Running:
    """`shadebus run --json` inside a `with` block: what it prints is gathered as it comes."""

    def __init__(
        self,
        *arguments: str | Path,
        largest_file: int | None = None,
    ) -> None:
        self.output = bytearray()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 # closed with the block
        command = [*limited(largest_file), *GATEWAY, "run", "--json", *map(str, arguments)]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )
        self._reader = Thread(target=self._read)
        self._reader.start()

    @property
    def lines(self) -> list[str]:
        """The whole lines printed so far."""
        return bytes(self.output).decode().split("\n")[:-1]

    @property
    def errors(self) -> str:
        """What went to stderr so far."""
        size = os.fstat(self._errors.fileno()).st_size
        return os.pread(self._errors.fileno(), size, 0).decode()

    def wait_for(self, kind: str, **fields: object) -> None:
        """Wait for an event of this type with these fields."""

        def seen() -> bool:
            events = [json.loads(line) for line in self.lines]
            return any(event["type"] == kind and fields.items() <= event.items() for event in events)

        wait_until(lambda: seen() or self.process.poll() is not None, f"{kind} {fields}")
        assert seen(), self.errors

    def end(self) -> int:
        """Wait for the process and for all that it printed; its exit code."""
        code = self.process.wait(START_S)
        self._reader.join()
        return code

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.end()
        if self.process.stdout:
            self.process.stdout.close()
        self._errors.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        while chunk := os.read(self.process.stdout.fileno(), 65_536):
            self.output += chunk
