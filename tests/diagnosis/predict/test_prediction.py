"""Predictions against draws of the same law."""

import numpy as np
import pytest

from diagnosis.data.patch import in_range
from diagnosis.predict.prediction import law_of, predict
from sensors.effects.outlier_spikes import OutlierSpikes
from tests.support.effect_case import bench_workspace


@pytest.mark.parametrize("width_um", [500.0, 20000.0, 50000.0])
def test_spikes_beyond_the_range_come_as_no_reading(width_um: float) -> None:
    ws = bench_workspace("wedge")
    patch = ws.patches[0]
    spikes = (OutlierSpikes(share=0.4, width_um=width_um),)
    law = law_of(patch.view, spikes, ws.noise)
    plain = predict(patch.view, (), ws.noise)
    full = predict(patch.view, spikes, ws.noise)
    drawn, _ = law.sample(lambda name: np.random.default_rng([len(name), 7]), patch.view)
    lost = np.isnan(in_range(drawn, patch.view.datasheet))[plain.seen].mean()
    predicted = (full.p_missing - plain.p_missing)[plain.seen].mean()
    assert predicted == pytest.approx(lost, abs=0.01)
    assert (predicted > 0.03) == (width_um > 500.0)
