"""Keeps what happens in a session of files: rotates them, stops loudly when the disk fails, goes on when it is well.

A file is opened before the one before it is closed, so nothing waits and no record lies between them. Each file carries
the whole metadata. What the disk does not take is counted, and told before the first record that it takes again.
"""

import errno
import shutil
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime

from gateway.config import RecordingConfig
from gateway.errors import GatewayError
from gateway.recording.session import file_of_session
from gateway.recording.syncing import Syncer
from gateway.recording.writer import Recorder
from gateway.records import Record

MIB = 1 << 20
LOOK_NS = 1_000_000_000  # between two looks at the room, and between two attempts to go on
MARGIN_BYTES = MIB  # above the reserve, before recording goes on: or a disk at its brim would fill with small files
NAME = "recording"  # under which statuses tell of all this
MENDS = {
    errno.ENOSPC: "make room",
    errno.EDQUOT: "make room",
    errno.EFBIG: "make room",
    errno.EROFS: "have it mounted for writing",
    errno.ENOENT: "leave files and directory where they are",
}


class Keeper:
    """Takes records and says in `failure` why it does not record now, in `lost` how many it never recorded.

    `report` hears of states, and `died` of a defect in the thread that waits for the disk. Raises GatewayError naming
    directory, room and mend if it cannot begin.
    """

    def __init__(
        self,
        config: RecordingConfig,
        metadata: dict[str, str],
        report: Callable[[str, str], None],
        died: Callable[[str, BaseException], None],
    ) -> None:
        self.path = config.directory / datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ.mcap")
        self.failure = ""
        self.lost = 0
        self._config = config
        self._metadata = {**metadata, "session": self.path.stem}
        self._report = report
        self._syncer = Syncer(config.sync_interval_s, self._disk_failed, died)
        self._number = 0
        self._missed = 0  # records since the disk failed
        self._look_ns = 0  # the next time to look at the disk
        self._full_ns = 0  # when the file will have lasted long enough
        self._rotate_ns = 0  # the next time at which rotation may be tried
        self._sync_error: OSError | None = None
        self._not_rotated = ""  # why, told already
        self._recorder: Recorder | None = self._open()
        try:
            self._check_room(0)
        except OSError as error:
            self._syncer.close(self._recorder, whole=False)
            mend = "make room, name another directory, or lower reserve_mib under [recording]"
            raise GatewayError(f"cannot record to {config.directory}: {error.strerror}; {mend}") from error

    def begin(self) -> None:
        """Start to synchronise."""
        self._syncer.start()

    def keep(self, records: Sequence[Record]) -> None:
        """Write records down, all or none of them."""
        recorder, now_ns = self._recorder, records[-1].stamp.monotonic_ns
        if recorder is None:
            self._missed += len(records)
            return
        whole = True
        try:
            self._look(recorder)
            whole = False
            recorder.append(records)
        except OSError as error:
            self._fail(recorder, error, whole=whole)
            self._missed = len(records)
            return
        if self._is_due(recorder, now_ns):
            self._rotate(recorder, now_ns)

    def revive(self) -> str:
        """Try to record again if that has failed; if it goes on, what there is to say about it."""
        now_ns = time.monotonic_ns()
        if self._recorder or now_ns < self._look_ns:
            return ""
        self._look_ns = now_ns + LOOK_NS
        try:
            self._config.directory.mkdir(parents=True, exist_ok=True)
            self._check_room(MARGIN_BYTES)
            self._recorder = self._open()
        except (OSError, GatewayError):
            return ""
        said = f"{self._missed} records were not recorded: {self.failure}; it goes on in {self._recorder.path.name}"
        self.lost += self._missed
        self._missed, self.failure = 0, ""
        return said

    def end(self) -> None:
        """Close every file; what remains unrecorded is in `failure` and `lost`."""
        self._syncer.stop()
        if self._recorder:
            self._syncer.close(self._recorder, whole=True)
            if self._sync_error:
                self.failure = self._said(self._recorder, self._sync_error)
        self.lost += self._missed

    @property
    def figures(self) -> str:
        """How the disk did."""
        return str(self._syncer.figures)

    def _open(self) -> Recorder:
        number = self._number + 1
        recorder = Recorder(file_of_session(self.path, number), {**self._metadata, "file": str(number)})
        self._number = number
        self._full_ns = 0
        self._syncer.watch(recorder)
        return recorder

    def _look(self, recorder: Recorder) -> None:
        """Once a second, whether the disk is well and the file is there. Raises OSError that says what is wrong."""
        if self._sync_error:
            raise self._sync_error
        now_ns = time.monotonic_ns()
        if now_ns >= self._look_ns:
            self._look_ns = now_ns + LOOK_NS
            if not recorder.there:
                text = f"the file was removed while it was written, and with it {recorder.records} records"
                raise OSError(errno.ENOENT, text)
            self._check_room(0)

    def _check_room(self, margin: int) -> None:
        directory, reserve = self._config.directory, self._config.reserve_mib * MIB
        free = shutil.disk_usage(directory).free
        if free < reserve + margin:
            raise OSError(errno.ENOSPC, f"{free / MIB:.1f} MiB free, less than the reserve of {reserve / MIB:g} MiB")

    def _is_due(self, recorder: Recorder, now_ns: int) -> bool:
        minutes, mib = self._config.rotate_minutes, self._config.rotate_mib
        self._full_ns = self._full_ns or now_ns + int(minutes * 60e9)
        full = (mib and recorder.size >= mib * MIB) or (minutes and now_ns >= self._full_ns)
        return bool(full) and now_ns >= self._rotate_ns

    def _rotate(self, recorder: Recorder, now_ns: int) -> None:
        try:
            self._recorder = self._open()
        except GatewayError as error:
            self._rotate_ns = now_ns + LOOK_NS
            if str(error) != self._not_rotated:
                self._not_rotated = str(error)
                self._report("NOT_ROTATED", f"{error}; {recorder.path.name} grows on")
            return
        self._not_rotated = ""
        self._syncer.retire(recorder, whole=True)

    def _fail(self, recorder: Recorder, error: OSError, *, whole: bool) -> None:
        self._recorder, self._sync_error = None, None
        self._look_ns = time.monotonic_ns() + LOOK_NS
        self._syncer.retire(recorder, whole=whole)
        self.failure = self._said(recorder, error)
        self._report("FAILED", self.failure)

    def _disk_failed(self, recorder: Recorder, error: OSError) -> None:
        """The syncing thread could not have the disk hold a file."""
        if recorder is self._recorder:
            self._sync_error = error
        else:
            self._report("NOT_CLOSED", self._said(recorder, error))

    def _said(self, recorder: Recorder, error: OSError) -> str:
        return f"{recorder.path}: {error.strerror}; {MENDS.get(error.errno or 0, 'see to the disk')}"
