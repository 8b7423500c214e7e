"""Progress of a command: a bar on a terminal, a line for each tenth elsewhere, or JSON."""

import json
import logging
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


class Progress(logging.Handler):
    """Shows a logger's events: `plan`, `part`, `shard`, `scan`, `warning`."""

    def __init__(self, *, json_lines: bool) -> None:
        super().__init__()
        self._json = json_lines
        self._bar: Any = None
        self._unusable: list[str] = []
        self._start = time.monotonic()
        self._done = self._total = self._said = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Show an event."""
        name: str = record.__dict__["event"]
        facts: Mapping[str, Any] = record.__dict__["facts"]
        if self._json:
            seconds = round(time.monotonic() - self._start, 3)
            print(json.dumps({"event": name, "seconds": seconds, **facts}), flush=True)
        elif name == "part":
            if "why" in facts:  # alone, it will be the error's own line
                self._unusable.append(f"part {facts['part']}: {facts['why']}")
                return
            state = "; ".join([f"{facts['triangles']} triangles", *facts.get("mended", ())])
            print(f"part {facts['part']}: {state}", file=sys.stderr)
        elif name == "plan":
            self._say_unusable()
            self._total = facts["scans"]
            if sys.stderr.isatty():
                from tqdm import tqdm

                tqdm.monitor_interval = 0  # its thread would keep processes from being forked
                self._bar = tqdm(total=self._total, unit="scan", smoothing=0.1)
        elif name in ("shard", "scan"):
            self._count(facts["scans"])
        elif name == "warning":
            print(f"warning: {facts['text']}", file=sys.stderr)

    def _count(self, scans: int) -> None:
        self._done += scans
        if self._bar is not None:
            self._bar.update(scans)
        elif self._done * 10 // max(self._total, 1) > self._said:
            self._said = self._done * 10 // max(self._total, 1)
            print(f"{self._done} of {self._total} scans", file=sys.stderr)

    def _say_unusable(self) -> None:
        for line in self._unusable:
            print(line, file=sys.stderr)
        self._unusable.clear()

    def close(self) -> None:
        """Close the bar."""
        if len(self._unusable) > 1:
            self._say_unusable()
        if self._bar is not None:
            self._bar.close()
        super().close()


@contextmanager
def shown(logger: str, *, json_lines: bool = False) -> Iterator[None]:
    """Show the progress of what runs in a context."""
    progress, log = Progress(json_lines=json_lines), logging.getLogger(logger)
    log.setLevel(logging.INFO)
    log.addHandler(progress)
    try:
        yield
    finally:
        log.removeHandler(progress)
        progress.close()


@contextmanager
def compiling_said() -> Iterator[None]:
    """Print a line once when numba compiles inner loops instead of loading them from its cache."""
    import numba.core.event

    event: Any = numba.core.event  # numba ships no types
    said = False

    def say(*_: Any) -> None:
        nonlocal said
        if not said:
            said = True
            print("compiling the inner loops, once; this takes half a minute", file=sys.stderr)

    def ignore(*_: Any) -> None:
        pass

    listener = type("Said", (event.Listener,), {"on_start": say, "on_end": ignore})()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
