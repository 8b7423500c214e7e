"""Stop by a signal: immediately where possible, and never lost.

An exception out of a signal's handler is not enough. Raised within `__del__`, a weak reference's
callback or a function that compiled code calls, it is printed and forgotten: so it isn't printed,
and the wish is repeated until it is heard. Raised while a compiled module loads, it becomes another
error or a crash: so it waits until none loads. And it is no `KeyboardInterrupt`: where one of those
passed the `exec` of a string, `python -m` ends by the signal, whatever exit code is chosen. Objects
that it left half made fail in their `__del__`: from the wish on nothing of that kind is printed.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
LOADED_S: Final = 0.05  # until one looks again whether modules are loaded
REPEAT_S: Final = 2.0  # until a wish is repeated; leaving in good order takes less

_wish: signal.Signals | None = None


class Stopped(BaseException):
    """The user or the system requests a stop."""


@contextmanager
def stoppable() -> Iterator[None]:
    """Let signals stop the code within; an ignored signal stays ignored."""
    global _wish
    _wish = None
    before = {number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGALRM)}
    printed = sys.unraisablehook

    def unheard(forgotten: Any) -> None:
        if _wish is None:
            printed(forgotten)

    sys.unraisablehook = unheard
    try:
        for number, handler in before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, _ask)
        yield
    finally:
        _wish = None
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = printed


def heard() -> signal.Signals | None:
    """Return the signal that requested a stop, if any; later signals have no effect."""
    if _wish is not None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
    return _wish


def _ask(number: int, frame: FrameType | None) -> None:
    global _wish
    if number != signal.SIGALRM:
        _wish = signal.Signals(number)
    loading = _loads(frame)
    signal.setitimer(signal.ITIMER_REAL, LOADED_S if loading else REPEAT_S)
    if not loading:
        raise Stopped


def _loads(frame: Any) -> bool:
    """Whether a module is being loaded in a frame or in those that called it."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False
