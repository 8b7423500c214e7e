"""Answers of a diagnosis, as the challenge judges them."""


def answer(verdict, *names, alternatives=()):
    """Return an answer that names effects, the first with the largest gain."""
    effects = [
        {"name": n, "heldout_gain": 1.0 / (k + 1), "alternatives": list(alternatives)}
        for k, n in enumerate(names)
    ]
    return {"verdict": verdict, "effects": effects}
