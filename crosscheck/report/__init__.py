"""Results as self-contained pages with their figures. Importing this imports Matplotlib."""

from __future__ import annotations

from crosscheck.report.drawing import keeping
from crosscheck.report.write import write_page

__all__ = ["keeping", "write_page"]
