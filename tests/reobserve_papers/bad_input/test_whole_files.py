"""Files with each token of YAML, in other encodings, and states that lack each key."""

from __future__ import annotations

import pytest

from tests.drawn.test_files import (
    ESTIMATED,
    TOKENS,
    model,
    parameter_file,
    specification,
    state_file,
)


@pytest.mark.nightly_after(20)
@pytest.mark.parametrize("token", TOKENS)
def test_yaml_that_once_raised_other_errors_is_refused(token: bytes) -> None:
    for one in (specification("kalman"), model("kalman"), parameter_file("ilo")):
        for content in (token, b"a: " + token, one.valid + token, b"a: 1\nb: &b " + token):
            one.accepts(content)


def test_yaml_of_another_encoding_is_refused() -> None:
    for one in (specification("kalman"), model("kalman"), parameter_file("ilo")):
        for encoding in ("utf-16", "utf-32"):
            assert not one.accepts(one.valid.decode().encode(encoding))


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("name", ESTIMATED)
def test_state_that_lacks_a_key_is_refused(name: str) -> None:
    """Also where the digest is that of what is left."""
    one = state_file(name)
    for part, held in one.tree.items():
        for key in held if isinstance(held, dict) else ():
            lacking = {**one.tree, part: {name: held[name] for name in held if name != key}}
            assert not one.accepts(one.dumped(lacking)), (part, key)
        lacking = {name: one.tree[name] for name in one.tree if name != part}
        assert part == "digest" or not one.accepts(one.dumped(lacking)), part
