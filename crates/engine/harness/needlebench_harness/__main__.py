"""Entry point: ``python -m needlebench_harness``, frames on standard input and output."""

import os
import signal
import sys

from needlebench_harness.protocol import Answer, Channel, ProtocolError

EXIT_OK = 0
EXIT_FAILED = 3


def claim_pipes() -> Channel:
    """Keep standard input and output for frames alone.

    Whatever Python, numpy or MuJoCo print afterwards goes to standard error, at the level of file
    descriptors, so that C code is caught too.
    """
    requests = os.dup(0)
    answers = os.dup(1)
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    return Channel(requests=requests, answers=answers)


def main() -> int:
    """Serve until the client quits or closes the pipe."""
    # Ctrl-C reaches the whole process group; the client decides what to do about it, and ends
    # this process by closing the pipe.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    channel = claim_pipes()
    try:
        # Only now: importing MuJoCo may print, and may fail.
        from needlebench_harness.server import Server  # noqa: PLC0415

        Server(channel=channel).serve()
    except BrokenPipeError:
        return EXIT_OK
    except ProtocolError as error:
        channel.write_text(Answer.ERROR, f"malformed request: {error}")
        return EXIT_FAILED
    except Exception as error:  # noqa: BLE001 - the last resort: the client shall learn of it
        channel.write_text(Answer.ERROR, f"harness failed: {type(error).__name__}: {error}")
        return EXIT_FAILED
    return EXIT_OK


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    # Nothing is left to save, and tearing an interpreter with numpy down takes tens of ms.
    os._exit(status)
