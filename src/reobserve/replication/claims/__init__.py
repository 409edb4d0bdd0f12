"""What the papers say, as checks of numbers: verdicts, and how firmly they stand.

`registry` reads claims, `checks` decides them from metrics, `choices` draws and moves what a paper
leaves open, `robustness` decides them over such draws, `verdicts` puts a word to it.
"""
