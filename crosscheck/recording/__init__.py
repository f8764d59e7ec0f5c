"""Recordings for the Rerun viewer. Importing this imports Rerun, which takes a second or two."""

from __future__ import annotations

from crosscheck.recording.case import write_case_recording
from crosscheck.recording.comparison import write_comparison_recording
from crosscheck.recording.diagnosis import write_diagnosis_recording

__all__ = ["write_case_recording", "write_comparison_recording", "write_diagnosis_recording"]
