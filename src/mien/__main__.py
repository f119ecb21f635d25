"""`mien`, and `python -m mien`: a run that is stopped at any moment ends without a word."""

from __future__ import annotations

import sys

STOPPED = 130
"""Exit status of a run that Ctrl-C or SIGTERM stopped."""


def main() -> int:
    """The console script's entry point. Returns the exit status."""
    # Nothing is imported above that takes time: a traceback of imports helps nobody.
    try:
        _heed_stops()
        from mien.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        return STOPPED


def _heed_stops() -> None:
    """SIGTERM as Ctrl-C: blocks are left, and take their temporary files with them."""
    import signal

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)


if __name__ == "__main__":
    sys.exit(main())
