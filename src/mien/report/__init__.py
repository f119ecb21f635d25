"""The report of a build: pictures of what was solved, and how well each mark agrees."""

from mien.report.page import ReportInput, render_report

__all__ = ["ReportInput", "render_report"]
