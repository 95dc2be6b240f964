"""The report: one self-contained HTML page about what was tracked, calibrated or analysed."""

from boresight.interfaces.report.page import Report, report

__all__ = ["Report", "report"]
