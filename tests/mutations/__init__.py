"""Changes of one line that the tests must notice: a list that is kept, and fresh ones by a seed.

Not part of the gate, since a hundred runs of the tests take an hour. Each change is made in a copy
of the project and judged by the tests of its room; `python -m tests.mutations --help`.
"""
