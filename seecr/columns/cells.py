"""Cells of a table as people and their spreadsheets write them, and the numbers that they mean."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

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


class Style:
    """How a file writes numbers: with decimal points or commas, with marks between thousands.

    Args:
        cells: of all columns of numbers. comma: whether a comma can be in a cell without quotation
            marks, because it is not what separates cells: then it may be decimal.
    """

    def __init__(self, cells: Iterable[str], comma: bool) -> None:
        marked = {cell for cell in map(plain_sign, cells) if "," in cell or "." in cell}
        points = {cell for cell in marked if _POINT.fullmatch(cell) and not _EITHER.fullmatch(cell)}
        commas = {cell for cell in marked if _COMMA.fullmatch(cell) and not _EITHER.fullmatch(cell)}
        points |= {cell for cell in marked if "," in cell and _GROUPED[","].fullmatch(cell)
                   and ("." in cell or cell.count(",") > 1)}  # fmt: skip
        commas |= {cell for cell in marked if "." in cell and _GROUPED[r"\."].fullmatch(cell)
                   and ("," in cell or cell.count(".") > 1)}  # fmt: skip
        either = sorted(cell for cell in marked if _EITHER.fullmatch(cell))
        with_comma = [cell for cell in either if "," in cell]
        # A file has one kind of decimal mark. Without commas a point is decimal, as ever.
        self.comma = comma and not points and (bool(commas) or bool(with_comma))
        # only groups of three behind one comma: nothing tells thousands from decimals
        self.unsure = with_comma[0] if self.comma and not commas else ""
        self.grouped = ""

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
