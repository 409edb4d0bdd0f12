"""Golden numbers: what stands behind each figure, kept with tolerances and compared.

For each figure ``tests/golden/<paper>`` holds the metrics; for each record that figures show, the
plant's or an observer's in a scenario, its series once, one row every `kept.PERIOD` seconds; for
each table its cells; and the numbers of the paper's theory like the metrics of a figure of that
name. Every number has two tolerances, both measured when it was written: how far
other processors moved it (`processors`), and how far halving every numerical step did. What moves
too far to be called determined is not kept, and listed (`files.UNDETERMINED`).
"""
