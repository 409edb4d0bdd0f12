"""The replication report: one page with every figure, claim, assumption and erratum.

`gather` reads what a build left in a project, `render` turns it into HTML by the templates of the
workflow and writes the file.
"""

from reobserve_papers.report.render import report_command

__all__ = ["report_command"]
