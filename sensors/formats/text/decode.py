"""From the bytes of a text file to its lines: byte order marks, UTF-16 without one, Latin-1."""

import codecs

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def is_text(head: bytes) -> bool:
    """Return whether a file's first bytes are text: no control bytes once they are decoded."""
    text = decoded(head)
    return not any(ord(sign) < 9 or 13 < ord(sign) < 32 for sign in text)


def decoded(blob: bytes) -> str:
    """Return the text of a file that may be UTF-8, UTF-16, UTF-32 or Latin-1."""
    for mark, encoding in MARKS:
        if blob.startswith(mark):
            return blob.decode(encoding, "replace")
    # Without a mark, every other byte of Western UTF-16 is zero.
    head = blob[:4096]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        zeros = head[first::2]
        if len(zeros) > 2 and zeros.count(0) > 0.7 * len(zeros):
            return blob.decode(encoding, "replace")
    try:
        return blob.decode("utf-8")
    except UnicodeDecodeError:
        return blob.decode("latin-1")
