"""A specimen that several workers scan: cut once, and nobody waits idly."""

import fcntl
import threading

from pipeline.injection.cut_once import cut_once


def test_who_waits_for_a_cut_prepares_meanwhile(tmp_path):
    kept, done = tmp_path / "plate-0.flawed", []
    assert cut_once(kept, lambda: "cut", lambda: done.append("prepared")) == "cut"
    assert done == []  # nobody held it
    with kept.with_suffix(".lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)

        def prepared() -> None:
            done.append("prepared")
            fcntl.flock(other, fcntl.LOCK_UN)

        found = []
        waiting = threading.Thread(
            target=lambda: found.append(cut_once(kept, lambda: "again", prepared))
        )
        waiting.start()
        waiting.join(30)
    assert done == ["prepared"]
    assert found == ["cut"]
