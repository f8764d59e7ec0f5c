"""``diagnosis.html``: a diagnosis as one self-contained page. Importing this imports Matplotlib."""

from __future__ import annotations

from crosscheck.report.page import write_report

__all__ = ["write_report"]
