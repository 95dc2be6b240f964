"""The report: one self-contained HTML page about one tracked recording."""

from boresight.interfaces.report.page import Report, report

__all__ = ["Report", "report"]
