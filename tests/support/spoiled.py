"""Spoiled files: valid bytes with a few random edits."""

from __future__ import annotations

import os
from collections.abc import Iterator
from random import Random

# What typing errors, spreadsheets and broken disks leave in files.
_PIECES = [
    b"", b",", b";", b"\n", b"\r", b"\t", b'"', b"'", b"#", b"=", b"[", b"]", b"{", b"}", b"<",
    b">", b"/>", b"&", b"&#0;", b"-", b"\x00", b"\xff", b"\xef\xbb\xbf", b"nan", b"inf", b"1e999",
    b"-1", b"0", b"1e300", b"1e-300", b"99999999999999999999", b"true", b'"mm"',
    "\u0661".encode(), "\u202e".encode(), b"\x1b[31m", b"_", b".", b"1979-05-27", b"null", b"\xc3",
]  # fmt: skip


def spoiled(whole: bytes) -> Iterator[bytes]:
    """As many spoiled files as ``SEECR_EXAMPLES`` says, drawn with the seed ``SEECR_SEED``.

    Each has one to four edits: a stretch removed, repeated, or replaced by a piece. Hypothesis is
    not asked: it takes longer to draw a file than our programs to read it, and with so few edits
    there is little to shrink.
    """
    random = Random(int(os.environ.get("SEECR_SEED", "0")))
    for _ in range(int(os.environ.get("SEECR_EXAMPLES", "40"))):
        data = bytearray(whole)
        for _ in range(random.randint(1, 4)):
            at = random.randint(0, len(data))
            length = random.choice([0, 0, 1, 1, 2, 5, 20, 200])
            piece = random.choice(_PIECES)
            if random.random() < 0.5:
                piece = random.randbytes(random.randint(0, 3))
            if random.random() < 0.1:
                piece = bytes(data[at : at + length]) * 2
            data[at : at + length] = piece
        yield bytes(data)
