"""PyTorch: inputs without NaN, weights, streams that repeat nothing, a loop that learns."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

import flawforge.dataset
from pipeline.batch.stream import ScanStream
from pipeline.dataset.relief import local_relief, pitch_mm
from pipeline.recipe import Recipe

torch = pytest.importorskip("torch", reason="PyTorch isn't installed: pip install torch")

from torch.utils.data import DataLoader  # noqa: E402  # after the skip

from flawforge.torch import IGNORED, NUMBER_OF_CLASSES, Scans, Stream  # noqa: E402

RECIPE = {
    "name": "plates", "seed": 4, "sensor": "KEYENCE-LJ-X8200", "surface": "car_door",
    "profiles": 16, "points": 40, "specimens": 2, "good_specimens": 1, "scans": 2,
    "parts": [
        {"builtin": "steel_plate", "name": "a", "parameters": {"length_mm": 60, "width_mm": 50}},
        {"builtin": "steel_plate", "name": "b", "parameters": {"length_mm": 80, "width_mm": 50}},
    ],
    "flaws": {"dent": {"length_mm": 9, "depth_mm": 0.5}}, "motion": {"length_mm": 20},
}  # fmt: skip


def test_pairs_hold_the_scan(small_dataset: Path) -> None:
    scans = flawforge.dataset.open(small_dataset)
    for kind, channels in (("relief", 2), ("depth", 2), ("points", 4)):
        pairs = Scans(small_dataset, input=kind)
        assert len(pairs) == len(scans)
        for number, scan in enumerate(scans):
            inputs, target = pairs[number]
            valid = np.isfinite(scan["depth"])
            assert inputs.dtype == torch.float32
            assert target.dtype == torch.int64
            assert inputs.shape == (channels, *valid.shape)
            assert torch.isfinite(inputs).all()
            np.testing.assert_array_equal(inputs[-1].numpy() > 0, valid)
            np.testing.assert_array_equal(target.numpy()[valid], scan["mask"][valid])
            assert (target.numpy()[~valid] == IGNORED).all()
            if kind == "points":
                cloud = np.moveaxis(inputs[:3].numpy(), 0, -1)[valid]
                np.testing.assert_allclose(cloud, scans.points(number), rtol=0, atol=1e-4)
            if kind == "relief":
                relief = local_relief(scan["depth"], pitch_mm(scan))
                np.testing.assert_allclose(inputs[0].numpy()[valid], relief[valid], atol=1e-5)
    with pytest.raises(ValueError, match="'height'; allowed: relief, depth, points"):
        Scans(small_dataset, input="height")


def test_split_target_and_transform(small_dataset: Path) -> None:
    scans = flawforge.dataset.open(small_dataset).split("test")
    pairs = Scans(
        small_dataset, "test", target="instance", ignore_index=-1,
        transform=lambda inputs, target: (inputs.flip(-1), target.flip(-1)),
    )  # fmt: skip
    assert len(pairs) == len(scans)
    _, target = pairs[0]
    valid = np.isfinite(scans[0]["depth"])
    expected = np.where(valid, scans[0]["instance"], -1)[:, ::-1]
    np.testing.assert_array_equal(target.numpy(), expected)


def test_class_weights_balance_the_classes(small_dataset: Path) -> None:
    pairs = Scans(small_dataset)
    weights = pairs.class_weights().numpy()
    counts = np.zeros(NUMBER_OF_CLASSES)
    for scan in flawforge.dataset.open(small_dataset):
        counts += np.bincount(scan["mask"].ravel(), minlength=NUMBER_OF_CLASSES)
    there = counts > 0
    np.testing.assert_allclose(weights * counts, np.where(there, counts.sum() / there.sum(), 0),
                               rtol=1e-6)  # fmt: skip


def test_a_loader_with_workers_gives_batches(small_dataset: Path) -> None:
    loader = DataLoader(Scans(small_dataset), batch_size=2, num_workers=2)
    batches = [inputs.shape for inputs, _ in loader]
    assert batches == [(2, 2, 60, 90)] * 2


def test_a_stream_is_the_dataset_to_the_bit_and_goes_on(tmp_path: Path) -> None:
    scans = flawforge.generate(RECIPE, tmp_path / "data")
    pairs = Scans(tmp_path / "data")
    stream, scans_of = Stream(RECIPE), ScanStream(Recipe.load(RECIPE))
    taken = list(itertools.islice(stream.numbered(), 14))
    assert [number for number, _ in taken] == list(range(14))
    for number, (inputs, target) in taken[: len(scans)]:
        part, specimen, scan = scans_of.names(number)
        at = scans.index(f"{part.name}-{specimen:04d}-{scan:04d}")
        stored_inputs, stored_target = pairs[at]
        assert torch.equal(target, stored_target)
        torch.testing.assert_close(inputs, stored_inputs, rtol=0, atol=1e-4)
    again = next(iter(Stream(RECIPE, start=13)))
    assert torch.equal(again[0], taken[13][1][0])
    other = next(iter(Stream(RECIPE, seed=5)))
    assert not torch.equal(other[0], taken[0][1][0])


class _Numbers(torch.utils.data.IterableDataset):
    """The numbers of the scans that a worker simulates."""

    def __init__(self, stream: Stream, count: int) -> None:
        self.stream, self.count = stream, count

    def __iter__(self):
        for number, _ in itertools.islice(self.stream.numbered(), self.count):
            yield number


def test_no_two_workers_or_ranks_repeat_a_scan() -> None:
    numbers: list[int] = []
    for rank in range(2):
        stream = Stream(RECIPE, rank=rank, world_size=2)
        loader = DataLoader(_Numbers(stream, 4), batch_size=None, num_workers=2)
        numbers += [int(number) for number in loader]
    assert sorted(numbers) == list(range(16)), "all shares together: every scan once"


def test_the_documented_training_loop_lowers_its_loss(
    small_dataset: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/train.md").read_text()
    code = next(
        block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        if "flawforge.torch" in block
    )  # fmt: skip
    assert len(code.strip().splitlines()) <= 14
    (tmp_path / "plates").symlink_to(small_dataset)
    monkeypatch.chdir(tmp_path)
    torch.manual_seed(0)
    names: dict[str, object] = {}
    exec(compile(code, "train.md", "exec"), names)  # our own page
    losses = names["losses"]
    assert isinstance(losses, list)
    assert np.mean(losses[-4:]) < 0.7 * np.mean(losses[:2])
