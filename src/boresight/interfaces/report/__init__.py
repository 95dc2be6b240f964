"""The report: one self-contained HTML page about one recording, tracked, calibrated, or both."""

from boresight.interfaces.report.page import Report, report

__all__ = ["Report", "report"]
