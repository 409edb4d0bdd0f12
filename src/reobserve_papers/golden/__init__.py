"""Golden numbers: the accepted numbers behind each figure, compared with those of every build.

``tests/golden/PAPER/FIGURE.csv`` holds the metrics of a figure and samples of the series that it
is the first to show; a table and the theory have a file like it. Each number has one tolerance,
measured when the number was accepted (`tolerances`). `values` reads the numbers from a build,
`comparison` says what moved and by how much, `acceptance` writes new ones for
``make accept REASON="..."``. ``tests/golden/claims.csv`` holds the verdicts (`golden_claims`).
"""
