"""Cells of a table as people and their spreadsheets write them, and the numbers that they mean.

And the texts and workbooks that such cells are in.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from datetime import date, datetime, time
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from seecr.errors import Faults, InputFileError, MissingPackageError
from seecr.files import no_text
from seecr.pose import LARGEST

NOT_READ = frozenset(
    {"", "-", "--", "\u2013", "\u2014", "?", "nan", "na", "n/a", "#n/a", "#nv", "#n/d", "null"}
)
"""What stands in cells where nothing was read, in small letters."""

# What a formula leaves that has no value, in Excel's languages.
_EXCEL_FAULT = re.compile(r"#(DIV/0|VALUE|WERT|VALEUR|REF|BEZUG|NAME|NUM|ZAHL|NULL)[!?]?", re.I)
_NO_NUMBER = {*NOT_READ, "inf", "infinity"}
# Minus signs of word processors and spreadsheets, and blanks that do not break a line.
_MINUS, _BLANKS = dict.fromkeys(map(ord, "\u2212\u2013\u2014"), "-"), "[ \u00a0\u202f\u2009]"
_EXPONENT = r"(?:[eE][+-]?\d+)?"
OF_NUMBERS = re.compile(r"[-+.\deE]*")
"""Cells, one after the other, that only hold numbers as programs write them."""

_PLAIN = re.compile(rf"[+-]?(?:\d+\.?\d*|\.\d+){_EXPONENT}")
# Thousands in groups of three behind one mark, and a part behind another mark.
_GROUPED = {
    mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:[{point}]\d*)?{_EXPONENT}")
    for mark, point in ((",", "."), (r"\.", ","), ("['\u2019]", ".,"), (_BLANKS, ".,"))
}
_COMMA = re.compile(rf"[+-]?(?:\d+,\d*|,\d+){_EXPONENT}")
_POINT = re.compile(rf"[+-]?(?:\d+\.\d*|\.\d+){_EXPONENT}")
# One group alone, which is thousands or three decimals; a leading zero is before decimals.
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")


def is_comment(line: str) -> bool:
    """Whether a line, or the first cell of a row, begins a comment, not with a mark of Excel."""
    first = re.split("[,;\t]", line.strip(' "'), maxsplit=1)[0].strip(' "\r\n')
    excel = first.lower() in NOT_READ or _EXCEL_FAULT.fullmatch(first)
    return first.startswith("#") and not excel


def plain_sign(cell: str) -> str:
    """The cell with an ordinary minus sign before a number; other texts as they are."""
    return cell.translate(_MINUS) if cell[:1] in "\u2212\u2013\u2014" and len(cell) > 1 else cell


def decimals(cell: str) -> int:
    """How many digits a number has behind its point; fewer than none of tens and so on."""
    mantissa, _, power = cell.lower().partition("e")
    return len(mantissa.partition(".")[2]) - int(power or 0)


def _marked(columns: Sequence[Iterable[str]]) -> Iterator[str]:
    """The cells with a point or a comma."""
    for cell in chain.from_iterable(columns):
        if "," in cell or "." in cell:
            yield plain_sign(cell)


def _has_point(cell: str) -> bool:
    """Whether a cell is a number with a decimal point, whatever others are."""
    if _POINT.fullmatch(cell):
        return not _EITHER.fullmatch(cell)
    grouped = "," in cell and ("." in cell or cell.count(",") > 1)
    return grouped and _GROUPED[","].fullmatch(cell) is not None


def _has_comma(cell: str) -> bool:
    """Whether a cell is a number with a decimal comma, whatever others are."""
    if _COMMA.fullmatch(cell):
        return not _EITHER.fullmatch(cell)
    grouped = "." in cell and ("," in cell or cell.count(".") > 1)
    return grouped and _GROUPED[r"\."].fullmatch(cell) is not None


class Style:
    """How a file writes numbers: with decimal points or commas, with marks between thousands.

    Args:
        columns: of numbers. comma: whether a comma can be in a cell without quotation marks,
            because it is not what separates cells: then it may be decimal.
    """

    def __init__(self, columns: Sequence[Iterable[str]], comma: bool) -> None:
        self.grouped = self.unsure = ""
        # A file has one kind of decimal mark. Without commas a point is decimal, as ever.
        self.comma = comma and not any(map(_has_point, _marked(columns)))
        if self.comma:
            commas = any(map(_has_comma, _marked(columns)))
            either = min(
                (c for c in _marked(columns) if "," in c and _EITHER.fullmatch(c)), default=""
            )
            self.comma = commas or bool(either)
            # only groups of three behind one comma: nothing tells thousands from decimals
            self.unsure = either if not commas else ""

    def plain(self, cell: str) -> str:
        """The cell as a number with a decimal point and nothing else; as it is if it is none."""
        text = plain_sign(cell)
        if _PLAIN.fullmatch(text) and not (self.comma and _GROUPED[r"\."].fullmatch(text)):
            return text
        if self.comma and _COMMA.fullmatch(text):
            return text.replace(",", ".")
        for mark, pattern in _GROUPED.items():
            if mark == ("," if self.comma else r"\.") or not pattern.fullmatch(text):
                continue
            self.grouped = self.grouped or cell
            return re.sub(mark, "", text).replace(",", ".")
        return cell

    def notes(self) -> list[str]:
        """What a reader should check."""
        said = []
        if self.grouped:
            said.append(
                f"Thousands have marks between them: {self.grouped} is read as "
                f"{float(self.plain(self.grouped)):.12g}."
            )
        if self.unsure:
            said.append(
                f"Commas are taken as decimal: {self.unsure} is read as "
                f"{self.plain(self.unsure)}, not as thousands."
            )
        return said


def fault_of(cell: str, blank_is_nan: bool) -> str | None:
    """What is wrong with a cell that should hold a number; None if nothing is."""
    expected = "expected a number, or an empty cell where the reading is missing"
    if not blank_is_nan:
        expected = "expected a number in every row"
    remedy = "" if blank_is_nan else "; fill it or drop the row"
    if not cell:
        return None if blank_is_nan else f"{expected}, got an empty cell{remedy}"
    if _EXCEL_FAULT.fullmatch(cell):
        return f"{expected}, got {show(cell)}, an error of a formula; mend it in the spreadsheet"
    if cell.lower().lstrip("+-") in _NO_NUMBER or cell.lower() in _NO_NUMBER:
        return f"{expected}, got {show(cell)}{remedy}"
    if _COMMA.fullmatch(cell):
        point = cell.replace(",", ".")
        return f"{expected}, got a decimal comma in {show(cell)}; write {point}"
    if re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?\s*[^\W\d_]+", cell, re.IGNORECASE):
        return f"{expected}, got {show(cell)}; a unit belongs in the column's name, not in a cell"
    try:
        number = float(cell.replace("_", "?"))
    except ValueError:
        return f"{expected}, got {show(cell)}"
    if abs(number) <= LARGEST:
        return None
    largest = f"{LARGEST:g}".replace("+", "")
    return (
        f"{expected}, got {show(cell)}, which is too large; numbers go from -{largest} to {largest}"
    )


def show(text: str) -> str:
    """A cell or header for an error message: quoted, one line, not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


# Rows that a spreadsheet adds below the data.

_STATISTIC = re.compile(
    r"(mean|average|avg|median|min(imum)?|max(imum)?|sum|total|std\.?( ?dev\.?)?|stdev|rms|range|"
    r"standard deviation|mittelwert|durchschnitt|summe|moyenne|[øσµμ])( value)?\s*[:=]?",
    re.IGNORECASE,
)


def is_statistic(cells: Sequence[str]) -> str:
    """The word at the beginning of a row that is computed from the others; "" if there is none."""
    first = next((cell for cell in cells if cell), "")
    return first if _STATISTIC.fullmatch(first) else ""


# Texts in the encodings of spreadsheets, and the sheets of their workbooks.

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
