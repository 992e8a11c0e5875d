"""The report: one page of pictures, tables and curves from whatever stages have run."""

from luxcore.report.page import write_report

__all__ = ["write_report"]
