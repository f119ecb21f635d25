"""The line that live tracking draws, and what it says in the end."""

from __future__ import annotations

import pytest

from mien.cli.live_line import live_line, status_text, summary_text
from mien.pipelines.tracking.live_loop import LiveStatus, LiveSummary

STATUS = LiveStatus(120, "reacquired", 29.84, 0.0412, 3)


def test_texts_of_status_and_summary() -> None:
    expected = "frame 120 | 29.8 frames/s | 41 ms | reacquired | 3 dropped | Ctrl-C stops"
    assert status_text(STATUS) == expected
    summary = LiveSummary(300, 4, 3, 10.0, 29.9, 0.0412)
    expected = "300 frames, 29.9 a second, 4 lost, 3 pictures dropped"
    assert summary_text(summary) == f"{expected}, 41 ms from picture to packet"
    none = LiveSummary(0, 0, 0, 0.0, 0.0, None)
    assert summary_text(none) == "0 frames, 0.0 a second, 0 lost, 0 pictures dropped"


def test_a_terminal_gets_a_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    with live_line(quiet=False) as tell:
        tell(STATUS)
    seen = capsys.readouterr()
    assert seen.out == ""
    assert "reacquired" in seen.err


@pytest.mark.parametrize("quiet", [False, True])
def test_a_pipe_gets_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    if quiet:
        monkeypatch.setenv("FORCE_COLOR", "1")
    with live_line(quiet=quiet) as tell:
        tell(STATUS)
    assert capsys.readouterr() == ("", "")
