"""Invalid input of every kind is accepted or refused in one sentence, and leaves no files behind.

`hypothesis` changes valid files, arguments and command lines. The ordinary run uses the same few
examples each time; `pytest tests/reobserve/bad_input --hypothesis-profile=nightly` uses many more.
"""
