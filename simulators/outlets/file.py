"""The traffic in a file."""

from io import BufferedWriter
from pathlib import Path

from simulators.outlets.base import Closing


class FileOutlet(Closing):
    """The stream as a new file, made when the first packet is there to be written, or into a device."""

    def __init__(self, path: Path) -> None:
        self.place = ""
        self._path = path
        self._file: BufferedWriter | None = None

    def write(self, data: bytes) -> None:
        """Append to the file; raises OSError when it cannot, or when something has its name already."""
        if self._file is None:
            self._file = self._path.open("wb" if self._path.is_char_device() else "xb")
        self._file.write(data)

    def close(self) -> None:
        """Finish the file. Raises OSError when it cannot."""
        if self._file:
            self._file.close()
