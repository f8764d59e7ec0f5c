"""Hypothesis' strategy of spoiled files: valid bytes with a few random edits."""

from __future__ import annotations

from hypothesis import strategies as st

# What typing errors, spreadsheets and broken disks leave in files.
_PIECES = [
    b"", b",", b";", b"\n", b"\r", b"\t", b'"', b"'", b"#", b"=", b"[", b"]", b"{", b"}", b"<",
    b">", b"/>", b"&", b"&#0;", b"-", b"\x00", b"\xff", b"\xef\xbb\xbf", b"nan", b"inf", b"1e999",
    b"-1", b"0", b"1e300", b"1e-300", b"99999999999999999999", b"true", b'"mm"',
    "\u0661".encode(), "\u202e".encode(), b"\x1b[31m", b"_", b".", b"1979-05-27", b"null", b"\xc3",
]  # fmt: skip


@st.composite
def spoiled(draw: st.DrawFn, whole: bytes) -> bytes:
    """The bytes with one to four edits: a stretch removed, repeated, or replaced by a piece."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        length = draw(st.sampled_from([0, 0, 1, 1, 2, 5, 20, 200]))
        piece = draw(st.sampled_from(_PIECES) | st.binary(max_size=3))
        if draw(st.integers(0, 9)) == 0:
            piece = bytes(data[at : at + length]) * 2
        data[at : at + length] = piece
    return bytes(data)
