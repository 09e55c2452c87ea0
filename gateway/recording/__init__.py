"""Recordings: written so that they survive, and read whatever became of them."""

from gateway.recording.session import Recording
from gateway.recording.writer import Recorder

__all__ = ["Recorder", "Recording"]
