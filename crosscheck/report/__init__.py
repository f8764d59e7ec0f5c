"""Results as self-contained pages with their figures. Importing this imports Matplotlib."""

from __future__ import annotations

from crosscheck.report.comparison import write_comparison_page
from crosscheck.report.drawing import keeping
from crosscheck.report.page import write_report
from crosscheck.report.plan import write_plan_page

__all__ = ["keeping", "write_comparison_page", "write_plan_page", "write_report"]
