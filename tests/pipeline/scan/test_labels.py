"""Labels and counts of a scan against plain NumPy; empty chunks of a shard."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import find_objects

from pipeline.scan.labels import boxes_of, cross_boxes, differ, flaws_hit, tally

BOX = np.array([[[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]])


@pytest.mark.parametrize(
    ("start", "end", "crosses"),
    [
        ((-5, 0, 0), (5, 0, 0), True),
        ((-5, 0, 0), (-2, 0, 0), False),  # ends before it
        ((0, 0, 0), (0.5, 0, 0), True),  # inside all the way
        ((-5, 2, 0), (5, 2, 0), False),
        ((-2, 0.5, 0), (0.5, -2, 0), True),
        ((-3.1, 0, 0), (0, -3.1, 0), False),  # cuts the corner off
        ((-5, 1, 1), (5, 1, 1), True),  # along an edge
    ],
)
def test_lines_that_come_into_a_box(start, end, crosses):
    ends = np.array([start], float), np.array([end], float)
    assert cross_boxes(*ends, BOX)[0] == crosses
    assert cross_boxes(*ends[::-1], BOX)[0] == crosses
    assert not cross_boxes(*ends, BOX + 100)[0]
    assert cross_boxes(*ends, np.concatenate([BOX + 100, BOX]))[0] == crosses


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_lines_into_a_box_by_sampling_them(seed):
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(-3, 3, (2, 1, 3))
    along = start + np.linspace(0, 1, 4001)[:, None] * (end - start)
    inside = (np.abs(along) < 1 - 2e-3).all(axis=1).any()
    near = (np.abs(along) < 1 + 2e-3).all(axis=1).any()
    crosses = bool(cross_boxes(start, end, BOX)[0])
    assert crosses or not inside
    assert near or not crosses


def test_a_tally_is_what_numpy_counts():
    rng = np.random.default_rng(5)
    shape = (30, 40)
    instance = rng.integers(0, 4, shape).astype(np.uint16)
    instance[instance == 2] = 0  # a flaw that isn't seen
    visible = (instance > 0).astype(np.uint8) * rng.integers(0, 2, shape).astype(np.uint8)
    reason = rng.choice(6, shape, p=[0.6, 0.1, 0.1, 0.1, 0.05, 0.05]).astype(np.uint8)
    reading = np.where(reason == 0, rng.normal(100, 1, shape), np.nan)
    clean = rng.normal(100, 1, shape)
    depth = np.where(rng.random(shape) < 0.1, np.nan, clean + rng.normal(0, 0.1, shape))
    noise = np.broadcast_to(np.float64(0.02), shape)
    seen = tally(3, instance, visible, reason, (3, 5), reading, depth, clean, noise)
    assert seen.points == reason.size
    assert seen.valid == (reason == 0).sum()
    assert seen.depth_mean_mm == pytest.approx(np.nanmean(reading), rel=1e-13)
    assert seen.pixels[0] == 0
    assert np.isnan(seen.deviation_over_noise[2])
    for number in (1, 2, 3):
        on = instance == number
        assert seen.pixels[number] == on.sum()
        assert seen.visible[number] == (visible[on] > 0).sum()
        assert seen.hidden[number] == np.isin(reason[on], (3, 5)).sum()
    for number in (1, 3):
        off = (depth - clean)[instance == number] / 0.02
        expected = np.sqrt(np.nanmean(off**2))
        assert seen.deviation_over_noise[number] == pytest.approx(expected, rel=1e-12)


def test_boxes_hold_all_points_of_a_flaw():
    rng = np.random.default_rng(6)
    instance = np.where(rng.random((30, 40)) < 0.01, rng.integers(1, 5, (30, 40)), 0)
    instance[instance == 2] = 0  # a flaw that isn't seen
    boxes = boxes_of(instance.astype(np.uint16), 5)
    assert boxes == find_objects(instance, max_label=5)
    assert boxes[1] is None


def test_a_point_is_of_the_flaw_whose_face_it_hits_or_whose_cut_it_misses():
    triangle = np.array([[0, 1, -1, 1, 0]], np.int32)
    instance = flaws_hit(triangle, np.array([0, 7], np.uint16))
    assert instance.tolist() == [[0, 7, 0, 7, 0]]
    depth, clean = np.array([[1, 2, np.nan, 2, 1.5]]), np.array([[1, 1, 1, np.nan, 1]])
    moved = differ(instance, depth, clean, 1e-6)
    assert moved.tolist() == [[False, False, True, False, True]]


def test_empty_labels_take_no_place_on_disk(once):
    met = set()
    for path in sorted(once.glob("shard-*.h5")):
        with h5py.File(path) as shard:
            for name in ("mask", "mask_visible", "instance", "invalid_reason"):
                empty = not shard[name][:].any()
                assert (shard[name].id.get_storage_size() == 0) == empty
                met.add(empty)
    assert met == {True, False}
