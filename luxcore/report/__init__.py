"""The report: one page of pictures, tables and curves from whatever stages have run."""

from luxcore.report.explorers import write_explorers
from luxcore.report.page import write_report

__all__ = ["write_explorers", "write_report"]
