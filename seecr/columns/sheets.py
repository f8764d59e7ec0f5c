"""Texts in the encodings of spreadsheets, and the sheets of their workbooks."""

from __future__ import annotations

from datetime import date, datetime, time
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from seecr.columns.cells import is_comment
from seecr.errors import Faults, InputFileError, MissingPackageError
from seecr.files import no_text

# Beginnings that say how a text is encoded.
_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}
_ZIP = b"PK\x03\x04"


def decoded(path: Path, data: bytes, expected: str) -> tuple[str, list[str]]:
    """A file's text, and a note where its encoding had to be guessed.

    Excel writes "Unicode text" as UTF-16 and a plain CSV in Windows' encoding of the West.

    Raises:
        InputFileError: it is no text.
    """
    mark = next((kind for start, kind in _MARKS.items() if data.startswith(start)), None)
    kind = "" if mark else no_text(data)
    if kind:
        raise InputFileError.at(path, f"is {kind}; {expected}, or Parquet")
    try:
        return data.decode(mark or "utf-8"), []
    except UnicodeDecodeError as error:
        place, byte = error.start, data[error.start]
        line = data.count(b"\n", 0, place) + 1
    try:
        text = data.decode("cp1252")
        if mark or any(ord(letter) < 32 and letter not in "\t\r\n\f" for letter in text):
            raise ValueError
    except ValueError:
        said = (
            f"byte 0x{byte:02X} (number {place + 1} of the file) is not UTF-8; expected text in "
            "UTF-8; save the file again in that encoding"
        )
        raise InputFileError.at(path, said, line=line) from None
    return text, [f"Not UTF-8 from line {line} on: read as Windows-1252 (Latin-1)."]


def is_workbook(data: bytes) -> bool:
    """Whether a file's bytes are those of an .xlsx."""
    return data.startswith(_ZIP) and b"xl/" in data


def sheet_rows(path: Path, file: Path, sheet: str | None) -> list[tuple[int, list[str]]]:
    """The rows of a sheet, as texts, with their numbers; comments are left out.

    Raises:
        InputFileError: no workbook, no such sheet, or formulas without values.
        MissingPackageError: openpyxl is not installed.
    """
    try:
        import openpyxl
    except ModuleNotFoundError:
        raise MissingPackageError(
            f"{file}: is a workbook, which needs openpyxl; pip install openpyxl, or save it as CSV"
        ) from None
    books = []
    try:
        for values in (True, False):
            books.append(openpyxl.load_workbook(file, read_only=True, data_only=values))
    except (BadZipFile, KeyError, OSError, ValueError) as error:
        raise InputFileError.at(file, f"cannot be read as a workbook: {error}") from None
    names = books[0].sheetnames
    if sheet is not None and sheet not in names:
        listed = ", ".join(names)
        raise InputFileError.at(file, f"has no sheet {sheet!r}; expected one of {listed}")
    there = [book[sheet or names[0]] for book in books]
    for one in there:
        one.reset_dimensions()  # some programs write wrong ones
    rows, faults = list[tuple[int, list[str]]](), Faults()
    for number, pair in enumerate(zip(*(s.iter_rows() for s in there), strict=True), start=1):
        cells = [_text(cell.value) for cell in pair[0]]
        for cell, formula in zip(*pair, strict=True):
            if cell.value is None and str(formula.value or "").startswith("="):
                text = (
                    f"expected a value, got the formula {formula.value} without one; open the "
                    "file in a spreadsheet and save it there"
                )
                at = {"line": number, "line_word": "row", "column": formula.column_letter}
                faults.add(InputFileError.at(path, text, **at))
        if any(cells) and not is_comment(next(cell for cell in cells if cell)):
            rows.append((number, cells))
    for book in books:
        book.close()
    faults.check()
    width = max((len(cells) for _number, cells in rows), default=0)
    return [(number, cells + [""] * (width - len(cells))) for number, cells in rows]


def _text(value: Any) -> str:
    """A cell as a CSV has it."""
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}"
    return "" if value is None else str(value).strip()
