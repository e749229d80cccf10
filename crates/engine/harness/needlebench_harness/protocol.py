"""Frames: ``u32 kind, u32 payload length, payload``, little-endian. See README.md for the table."""

import os
import struct
from enum import IntEnum
from typing import Final

VERSION: Final = 3

HEADER: Final = struct.Struct("<II")
U32: Final = struct.Struct("<I")
PLANT: Final = struct.Struct("<II")
"""Plant index, and four bytes that align the numbers behind it: zero, but see STEP."""

GROUP: Final = struct.Struct("<II")
"""Number of plants in a STEP_GROUP and zero; number of states in a GROUP_STATE and of failures."""

INBOX_BYTES: Final = 1 << 16
"""Requests up to this size arrive in one reused buffer."""

MAX_PAYLOAD_BYTES: Final = 1 << 28
"""More than any model needs; a longer frame is a broken length field."""


class Request(IntEnum):
    """Kinds of frames from the client."""

    HELLO = 1
    LOAD = 2
    RESET = 3
    STEP = 4
    INVERSE = 5
    DISTANCE = 6
    QUIT = 7
    COPY = 8
    STEP_GROUP = 9
    REPLAY = 10
    CLEAR = 11


class Answer(IntEnum):
    """Kinds of frames to the client."""

    WELCOME = 0x81
    LOADED = 0x82
    STATE = 0x83
    DYNAMICS = 0x84
    DISTANCE = 0x85
    COPIED = 0x86
    GROUP_STATE = 0x87
    REPLAYED = 0x88
    CLEARED = 0x89
    ERROR = 0xFF


class ProtocolError(Exception):
    """The client sent what this protocol does not allow; the stream cannot be trusted further."""


class RequestError(Exception):
    """A well-formed request that cannot be served; the next one may be."""


class Channel:
    """Frames over two raw file descriptors, one request in flight at a time."""

    def __init__(self, *, requests: int, answers: int) -> None:
        """Take the descriptors over."""
        self._requests = open(requests, "rb", buffering=0)  # noqa: SIM115 - lives as long as the process
        self._answers = answers
        self.inbox = bytearray(INBOX_BYTES)
        self._inbox_view = memoryview(self.inbox)

    def read(self) -> tuple[int, memoryview] | None:
        """Return kind and payload of the next request, or None at the end of the stream.

        The payload of a request that fits lies in ``inbox`` behind its header, and is overwritten
        by the next request.
        """
        view = self._inbox_view
        received = self._requests.readinto(view)
        if not received:
            return None
        while received < HEADER.size:
            received += self._read_more(view[received:])
        kind, length = HEADER.unpack_from(view)
        end = HEADER.size + length
        if received == end:
            return kind, view[HEADER.size : end]
        if length > MAX_PAYLOAD_BYTES:
            raise ProtocolError(f"a payload of {length} bytes, allowed are {MAX_PAYLOAD_BYTES}")
        if received > end:
            raise ProtocolError(f"{received - end} bytes behind a request that is not answered yet")
        if end > INBOX_BYTES:
            grown = memoryview(bytearray(end))
            grown[:received] = view[:received]
            view = grown
        while received < end:
            received += self._read_more(view[received:end])
        return kind, view[HEADER.size : end]

    def _read_more(self, into: memoryview) -> int:
        received = self._requests.readinto(into)
        if not received:
            raise ProtocolError("the stream ends inside a frame")
        return received

    def write_frame(self, frame: bytes | bytearray) -> None:
        """Send a frame that already carries its header."""
        sent = os.write(self._answers, frame)
        while sent < len(frame):
            sent += os.write(self._answers, memoryview(frame)[sent:])

    def write(self, kind: Answer, payload: bytes) -> None:
        """Send one answer."""
        self.write_frame(HEADER.pack(kind, len(payload)) + payload)

    def write_text(self, kind: Answer, text: str) -> None:
        """Send an answer whose payload is UTF-8 text."""
        self.write(kind, text.encode("utf-8", "replace"))


def pack_string(string: str) -> bytes:
    """Encode as ``u32 length`` and UTF-8 bytes."""
    encoded = string.encode("utf-8", "replace")
    return U32.pack(len(encoded)) + encoded


def pack_strings(strings: list[str]) -> bytes:
    """Encode as ``u32 count``, then each string."""
    return U32.pack(len(strings)) + b"".join(map(pack_string, strings))
