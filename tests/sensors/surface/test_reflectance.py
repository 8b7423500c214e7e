"""Brightness of a part over its plane."""

import numpy as np
import pytest

from files.errors import RecipeError
from files.record import parse
from sensors.surface.reflectance import Patch, Picture, ReflectanceMap, Stripes


def points(*xy):
    return np.array([[x, y, 5.0] for x, y in xy])


def test_patches_lie_over_stripes_over_the_base():
    bright = ReflectanceMap(
        base=0.8,
        stripes=(Stripes(value=0.4, period_mm=10.0, duty=0.3),),
        patches=(Patch(value=0.1, x_mm=(0.0, 5.0), y_mm=(0.0, 2.0)),),
    )
    got = bright.at(points((-1, 1), (1, 1), (1, 4), (1, 12.9), (1, 13.1), (1, -8)))
    assert np.allclose(got, [0.4, 0.1, 0.8, 0.4, 0.8, 0.4])
    across_x = ReflectanceMap(stripes=(Stripes(value=0.0, period_mm=2.0, across="x"),))
    assert np.allclose(across_x.at(points((0.5, 0), (1.5, 0))), [0.0, 1.0])


def test_missing_points_have_none():
    bright = ReflectanceMap(base=0.5)
    got = bright.at(np.array([[np.nan, np.nan, np.nan], [1.0, 1.0, 1.0]]))
    assert np.array_equal(got, [np.nan, 0.5], equal_nan=True)


@pytest.mark.parametrize("kind", ["npy", "png"])
def test_picture_is_laid_over_its_rectangle(tmp_path, kind):
    grey = np.array([[0.0, 1.0], [0.6, 0.2]])  # first row at the far y
    path = tmp_path / f"grey.{kind}"
    if kind == "npy":
        np.save(path, grey)
    else:
        from matplotlib.image import imsave

        imsave(path, np.repeat(grey[..., None], 3, axis=2))
    bright = ReflectanceMap(
        base=0.9, picture=Picture(path=str(path), x_mm=(0.0, 4.0), y_mm=(0.0, 4.0))
    )
    got = bright.at(points((1, 3), (3, 3), (1, 1), (3, 1), (2, 2), (5, 1)))
    assert np.allclose(got, [0.0, 1.0, 0.6, 0.2, 0.45, 0.9], atol=0.003)


def test_bad_pictures_are_named(tmp_path):
    here = np.zeros((1, 3))
    for name, content in (("none.png", None), ("text.png", b"hello"), ("dark.npy", None)):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        if name == "dark.npy":
            np.save(path, np.full((2, 2), -1.0))
        picture = Picture(path=str(path), x_mm=(-1.0, 1.0), y_mm=(-1.0, 1.0))
        with pytest.raises(RecipeError, match=name):
            ReflectanceMap(picture=picture).at(here)


def test_it_is_read_from_a_recipe():
    data = {"base": 0.7, "stripes": [{"value": 0.1, "period_mm": 4.0}]}
    assert parse(ReflectanceMap, data).stripes[0].across == "y"
    with pytest.raises(RecipeError, match="base"):
        parse(ReflectanceMap, {"base": 1.2})
