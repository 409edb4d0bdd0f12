"""Bad input of every kind: it is accepted, or refused in one sentence, and leaves nothing behind.

`hypothesis` changes valid files, arguments and command lines. The ordinary run takes the same few
examples each time; `pytest tests/bad_input --hypothesis-profile=nightly` takes many new ones.
"""
