"""YAML of plain data: no tags, no dates, every key once, and no more of it than a config needs."""

from __future__ import annotations

from typing import Any

from reobserve.errors import InputError
from reobserve.extras import package
from reobserve.plain_data.json_data import check_plain

MOST_BYTES = 512 * 1024  # of a file; the largest config has 25 000


def parse_yaml(text: str, place: str) -> Any:
    """The data in one YAML document; an alias becomes a copy of what it stands for.

    Raises
    ------
    InputError
        If it is not such YAML, or too deep or too large.
    """
    package("yaml", "read YAML")
    import yaml
    from yaml.error import MarkedYAMLError

    from reobserve.plain_data.yaml_loader import PlainLoader

    try:
        tree = PlainLoader(text).get_single_data()
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        said = f"{where}{error.problem or error.context}"
        raise InputError(place, f"is not YAML of plain values: {said}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(place, f"is not YAML of plain values: {error}") from None
    check_plain(tree, place)
    return _separate(tree)


def _separate(branch: Any) -> Any:
    """A copy in which nothing stands in two places; of checked data, which is not deep."""
    if isinstance(branch, dict):
        return {key: _separate(value) for key, value in branch.items()}
    if isinstance(branch, list):
        return [_separate(value) for value in branch]
    return branch
