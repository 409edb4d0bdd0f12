"""Types of arguments on the command line, of which a wrong one is refused in one sentence."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from reobserve.core.errors import InputError, shown


def tree(text: str) -> dict[str, Any]:
    """A mapping from JSON, or from standard input for a dash."""
    from reobserve.core.documents import parse_json

    try:
        parsed = parse_json(sys.stdin.read() if text == "-" else text, "")
    except InputError as error:
        said = str(error).lstrip(".: ")  # argparse names the argument
        raise argparse.ArgumentTypeError(said) from None
    if not isinstance(parsed, dict):
        raise argparse.ArgumentTypeError("must be a JSON object")
    return parsed


def whole(least: int, most: int = 2**53) -> Callable[[str], int]:
    """A parser of whole numbers, up to ``most`` or what a float can count to."""

    def parse(text: str) -> int:
        if not text.isascii() or not text.isdigit() or len(text) > 16:
            raise argparse.ArgumentTypeError(f"{shown(text)} must be {allowed}")
        number = int(text)
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(f"{shown(text)} must be {allowed}")
        return number

    allowed = f"a whole number from {least} to {most}"
    return parse
