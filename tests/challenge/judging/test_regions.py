"""True regions, drawn again from opened keys."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from challenge.cases.truth import facts
from challenge.judging.regions import draw_again, drawn_again
from challenge.judging.score import overlap


@pytest.mark.slow
def test_true_regions_are_drawn_again(bowed, tmp_path):
    secret, staged, _ = bowed
    known = facts(staged, secret)
    keys = tmp_path / "keys"
    keys.mkdir()
    np.savez(keys / "case-001.npz", region=known.region)
    opened = {"secret": asdict(secret), "facts": known.figures()}
    (keys / "case-001.key.json").write_text(json.dumps(opened))
    (keys / "case-002.key.json").write_text(json.dumps(opened))  # without maps: none is judged
    assert drawn_again(tmp_path) == {}
    (tmp_path / "regions").mkdir()
    with pytest.raises(ValueError, match="lacks 1 of 1 cases, case-001"):
        drawn_again(tmp_path)
    assert draw_again(tmp_path, jobs=1) == 0
    found = drawn_again(tmp_path)
    assert list(found) == ["case-001"]
    region, other = found["case-001"]
    assert np.array_equal(region, known.region)
    assert 0.3 < overlap(region, other) < 1.0
