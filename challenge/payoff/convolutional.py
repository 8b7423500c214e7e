"""A small convolutional flaw segmenter on the depth image, for one processor.

Everything about it was fixed before any test recording was scored, and is the same for all sets
of training data. An encoder halves the image twice and a decoder brings it back, with the finer
layers beside it (Ronneberger et al., MICCAI 2015), with 8, 16 and 32 channels.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.payoff.segmenter import smoothed

CHANNELS = (8, 16, 32)
STEPS, BATCH, CROP = 120, 8, 64
"""Steps of training, windows in each, and points along their sides."""
RATE = 4e-3
SCALE_MM = 0.03
"""Height that an input of one stands for."""
CLIP = 6.0
"""Largest input: a spike is no larger flaw for being higher."""
LAYERS = 3


def inputs(depth_mm: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return depth without form at two scales, and whether there is a reading, (3, n, m)."""
    depth = np.asarray(depth_mm, np.float64)
    valid = np.isfinite(depth)
    layers = []
    for scale in (3.0, 12.0):
        form, _ = smoothed(depth, valid, scale)
        rest = np.nan_to_num(np.where(valid, depth - form, 0.0)) / SCALE_MM
        layers.append(np.clip(rest, -CLIP, CLIP))
    return np.stack([*layers, valid.astype(np.float64)]).astype(np.float32)


def _torch() -> Any:
    try:
        import torch
    except ImportError:
        raise ValueError("the payoff needs PyTorch: pip install 'flawforge[payoff]'") from None
    return torch


def one_thread() -> None:
    """Keep training to one core, as that of the trees is."""
    _torch().set_num_threads(1)


def network(seed: int) -> Any:
    """Return an untrained network whose weights follow from the seed."""
    torch = _torch()
    nn = torch.nn
    one, two, three = CHANNELS

    def block(into: int, out: int) -> Any:
        return nn.Sequential(
            nn.Conv2d(into, out, 3, padding=1, bias=False), nn.BatchNorm2d(out), nn.ReLU(),
            nn.Conv2d(out, out, 3, padding=1, bias=False), nn.BatchNorm2d(out), nn.ReLU(),
        )  # fmt: skip

    class Network(nn.Module):  # type: ignore[name-defined,misc]
        def __init__(self) -> None:
            super().__init__()
            self.fine, self.middle, self.coarse = block(LAYERS, one), block(one, two), block(
                two, three
            )
            self.up_middle, self.up_fine = block(three + two, two), block(two + one, one)
            self.last = nn.Conv2d(one, 1, 1)

        def forward(self, image: Any) -> Any:
            halve, back = nn.functional.max_pool2d, nn.functional.interpolate
            fine = self.fine(image)
            middle = self.middle(halve(fine, 2))
            coarse = self.coarse(halve(middle, 2))
            middle = self.up_middle(torch.cat([back(coarse, scale_factor=2), middle], 1))
            fine = self.up_fine(torch.cat([back(middle, scale_factor=2), fine], 1))
            return self.last(fine)[:, 0]

    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return Network()


def train(scans: list[tuple[NDArray[np.float32], NDArray[np.int16]]], rng: np.random.Generator
          ) -> Any:  # fmt: skip
    """Train on inputs and labels of scans of one size; points labelled -1 count neither way."""
    torch = _torch()
    model = network(int(rng.integers(2**31)))
    images = torch.from_numpy(np.stack([_even(image) for image, _ in scans]))
    labels = torch.from_numpy(np.stack([_even(label, -1) for _, label in scans]).astype(np.int64))
    optimiser = torch.optim.Adam(model.parameters(), lr=RATE)
    plan = torch.optim.lr_scheduler.OneCycleLR(optimiser, max_lr=RATE, total_steps=STEPS)
    model.train()
    for _ in range(STEPS):
        image, label = _windows(images, labels, rng)
        if rng.random() < 0.5:  # the line has no sense of direction, the travel has
            image, label = image.flip(-1), label.flip(-1)
        loss = torch.nn.functional.binary_cross_entropy_with_logits(
            model(image), (label > 0).float(), reduction="none"
        )
        counts = (label >= 0).float()
        optimiser.zero_grad()
        (torch.sum(loss * counts) / torch.sum(counts)).backward()
        optimiser.step()
        plan.step()
    return model.eval()


def _windows(images: Any, labels: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """Draw windows of a step out of the scans."""
    torch = _torch()
    sides = [min(CROP, size) for size in labels.shape[1:]]
    cut = []
    for _ in range(BATCH):
        k = int(rng.integers(labels.shape[0]))
        i, j = (
            int(rng.integers(size - side + 1))
            for size, side in zip(labels.shape[1:], sides, strict=True)
        )
        cut.append((k, slice(i, i + sides[0]), slice(j, j + sides[1])))
    return (
        torch.stack([images[k, :, rows, columns] for k, rows, columns in cut]),
        torch.stack([labels[k, rows, columns] for k, rows, columns in cut]),
    )


def suspicion(model: Any, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much each point looks like a flaw, 0 to 1, (n, m)."""
    torch = _torch()
    n, m = image.shape[1:]
    with torch.no_grad():
        found = torch.sigmoid(model(torch.from_numpy(_even(image))[None]))[0]
    return np.asarray(found.numpy()[:n, :m], np.float32)


def _even(image: NDArray[Any], beyond: int = 0) -> NDArray[Any]:
    """Pad to multiples of four, which halving twice needs."""
    pad = [(0, 0)] * (image.ndim - 2) + [(0, -size % 4) for size in image.shape[-2:]]
    return np.pad(image, pad, constant_values=beyond)
