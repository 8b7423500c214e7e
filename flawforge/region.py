"""A region of a scan as a user writes it: R0:R1,C0:C1, profiles and points, half-open."""

from files.errors import RecipeError


def parse_ranges(text: str | None, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return the profiles and the points; all where nothing is said.

    Raises
    ------
    RecipeError
        Where the text isn't understood or leads outside the scan.
    """
    if text is None:
        return slice(None), slice(None)
    allowed = f"R0:R1,C0:C1 within 0:{shape[0]},0:{shape[1]}"
    try:
        parts = [[int(n) if n else None for n in part.split(":")] for part in text.split(",")]
    except ValueError:
        raise RecipeError("--region: wrong form", value=text, allowed=allowed) from None
    if len(parts) != 2 or any(len(part) != 2 for part in parts):
        raise RecipeError("--region: wrong form", value=text, allowed=allowed)
    slices = []
    for (start, stop), size in zip(parts, shape, strict=True):
        first, last = start or 0, size if stop is None else stop
        if not 0 <= first < last <= size:
            raise RecipeError("--region lies outside the scan", value=text, allowed=allowed)
        slices.append(slice(first, last))
    return slices[0], slices[1]
