"""Names and data from files as text of a Markdown card: no markup, no link, no HTML of theirs."""

import re


def as_text(name: object) -> str:
    """Return one line that Markdown shows as it is."""
    return re.sub(r"([\\`*{}\[\]<>()#+!|&~$:])", r"\\\1", " ".join(str(name).split()))


def as_code(text: str, language: str) -> str:
    """Return a block of code; its fence is longer than any that the text holds."""
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"{fence}{language}\n{text.rstrip()}\n{fence}"
