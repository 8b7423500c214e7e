"""Each picture of the report is a PNG."""

from pathlib import Path

from diagnosis.diagnosis import Diagnosis
from diagnosis.report.covariate_picture import covariate_picture
from diagnosis.report.map_pictures import mismatch_map, residual_maps
from diagnosis.report.profile_picture import profile_picture


def test_each_picture_is_a_png(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    for picture in (
        mismatch_map(result), residual_maps(result), profile_picture(result),
        covariate_picture(result, result.effects[0]),
    ):  # fmt: skip
        assert picture is not None
        assert picture.startswith(b"\x89PNG")
