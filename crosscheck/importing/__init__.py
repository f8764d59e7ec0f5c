"""Other programs' files: exports of motion capture and logs, converted to measurements."""

from __future__ import annotations

from crosscheck.importing.case import FILES, Imported, import_case, write_case
from crosscheck.importing.choices import ImportChoices

__all__ = ["FILES", "ImportChoices", "Imported", "import_case", "write_case"]
