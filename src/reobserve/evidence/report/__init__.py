"""The replication report: one page with every figure, claim, assumption and erratum.

`model` says what the page holds, `gather` reads it from a project with the help of a module a part,
`render` turns it into HTML by the templates of the workflow, `command` writes the file.
"""

from reobserve.evidence.report.command import report_command

__all__ = ["report_command"]
