"""Placement by a model's word on edges, where smooth faces leave a recording open.

Registration follows silhouettes as if they were sharp. Under a model it is known what becomes of
readings at edges and which of them are missing: where all of that fits best, there the part lay.
Light that is spread over many pitches says so to a small part of one, and a plateau of the
silhouettes' cost has a slope.
"""

from dataclasses import replace

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.prediction import predict
from diagnosis.register.coordinate_search import step_by_step
from diagnosis.register.placement import PRIOR_SD, Placement, move
from diagnosis.register.sample import pitch_of
from diagnosis.register.silhouettes import open_directions
from diagnosis.settings import SETTINGS
from sensors.casting.laser import Laser
from sensors.view.view import View

READINGS = 6_000
"""Readings that a placement goes by, about: whole columns, evenly spread."""
REACHES = (0.4, 0.15, 0.05)
"""Steps of the search, in pitches."""


def placed_by_law(
    patch: Patch, placement: Placement, model: Model, noise: NoiseModel
) -> Placement:
    """Move a recording, one patch, to where a model's law gives its readings the most density.

    Readings count by their distance from the law's mean and by whether there are any, each as if
    alone: what they share tells no direction from another. Only directions in which smooth faces
    leave the recording open are searched.
    """
    view = patch.view
    points = view.part_mm[view.in_range]
    pitch = pitch_of(points, patch.shape)
    smooth = (patch.columns / PRIOR_SD)[patch.observed & ~patch.edge] / noise.sd_mm
    hessian = smooth.T @ smooth / SETTINGS.register.together + np.diag(PRIOR_SD**-2.0)
    covariance = np.linalg.inv(hessian)
    directions = open_directions(covariance, view.poses, view.laser, patch.depth_mm, pitch)
    if not len(directions):
        return placement
    every = max(1, patch.depth_mm.size // READINGS)
    depth, counted = patch.depth_mm[:, ::every], patch.counted[:, ::every]
    laser = Laser(x_mm=view.laser.x_mm[::every], slope_x=view.laser.slope_x[::every])
    bright = None if view.intensity is None else view.intensity[:, ::every]
    effects = model.of(patch.recording)
    farthest, least = SETTINGS.clip, SETTINGS.reregister.least_chance

    def moved(steps: Field) -> Field:
        return move(view.poses, steps @ directions, placement.centre_mm)

    def cost(steps: Field) -> float:
        there = View(
            view.scene, view.sensor, moved(steps), view.time_s, laser=laser,
            intensity=bright, start_time_s=view.start_time_s,
        )  # fmt: skip
        law = predict(there, effects, noise, level=model.level)
        read = np.isfinite(depth) & counted
        told = read & law.seen
        away = np.clip((depth - law.mean_mm)[told] / law.sd_mm[told], -farthest, farthest)
        wrong = 0.5 * float(away @ away) + float(np.log(law.sd_mm[told] / noise.sd_mm).sum())
        wrong += 0.5 * farthest**2 * np.count_nonzero(read & ~law.seen)
        for here, chance in ((told, 1.0 - law.p_missing), (counted & ~read, law.p_missing)):
            wrong -= float(np.log(np.fmax(chance[here], least)).sum())
        prior = steps @ directions / PRIOR_SD
        return wrong + 0.5 * float(prior @ prior)

    best, gained = step_by_step(cost, len(directions), [k * pitch for k in REACHES])
    if gained < SETTINGS.register.least_settled:
        return placement
    return replace(placement, shift=placement.shift + best @ directions, poses=moved(best))
