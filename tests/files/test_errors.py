"""An error of a user's: place, fault, value and what is allowed, in one line."""

from files.errors import RecipeError


def test_the_line_holds_place_fault_value_and_what_is_allowed() -> None:
    error = RecipeError("is unknown", where="r.yaml:3", value="sise", allowed="size")
    assert str(error) == "r.yaml:3: is unknown, got 'sise'; allowed: size"
    assert str(RecipeError("is missing")) == "is missing"
    assert str(RecipeError("is empty", value=None)) == "is empty, got None"


def test_it_is_one_line_and_short_whatever_the_value() -> None:
    line = str(RecipeError("a\nb", value="x" * 500))
    assert "\n" not in line
    assert len(line) < 80
