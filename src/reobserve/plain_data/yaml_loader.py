"""PyYAML's safe loader, that counts what it reads and takes plain values only."""

from __future__ import annotations

from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import ConstructorError
from yaml.events import AliasEvent, CollectionStartEvent, ScalarEvent

from reobserve.errors import one_line
from reobserve.plain_data.json_data import DEPTH

MOST_NODES = 20_000
MOST_ALIASES = 200
_MOST_DIGITS = 30  # of a number, with sign, point and exponent

# libyaml reads texts in a sixth of the time. It composes nodes by itself, uncounted, unless the
# composer in Python comes first.
_BASES = (Composer, yaml.CSafeLoader) if yaml.__with_libyaml__ else (yaml.SafeLoader,)


class PlainLoader(*_BASES):  # type: ignore[misc]
    """PyYAML's own safe loader, which builds nothing before all of this has been counted."""

    def __init__(self, text: str) -> None:
        _BASES[-1].__init__(self, text)
        Composer.__init__(self)
        self._depth = self._nodes = self._aliases = 0
        self._open: list[str] = []  # the anchors of what is being read

    def compose_node(self, parent: Any, index: Any) -> Any:
        """A node, once it is known that there are not too many."""
        event: Any = self.peek_event()
        self._nodes += 1
        self._aliases += isinstance(event, AliasEvent)
        if self._nodes > MOST_NODES:
            raise _refused(event, f"more than {MOST_NODES} values")
        if self._aliases > MOST_ALIASES:
            raise _refused(event, f"more than {MOST_ALIASES} aliases")
        if self._depth > DEPTH:
            raise _refused(event, f"nested deeper than {DEPTH} levels")
        if isinstance(event, ScalarEvent | CollectionStartEvent) and event.tag is not None:
            raise _refused(event, f"the tag {event.tag}; only plain values are taken")
        if isinstance(event, AliasEvent) and event.anchor in self._open:
            raise _refused(event, f"the alias *{one_line(event.anchor, 100)} inside what it names")
        self._depth += 1
        self._open.append(event.anchor)
        node = super().compose_node(parent, index)
        self._open.pop()
        self._depth -= 1
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """A mapping whose keys are text, each of them once."""
        found = set()
        for key, _ in node.value:
            if key.tag == "tag:yaml.org,2002:merge":
                raise _refused(key, "the key <<, which merges; write out what it adds")
            if key.tag != "tag:yaml.org,2002:str":
                raise _refused(key, "a key that is no text; put it in quotes")
            if key.value in found:
                raise _refused(key, f"the key {one_line(key.value, 100)!r} twice")
            found.add(key.value)
        return super().construct_mapping(node, deep)

    def plain_number(self, node: Any) -> Any:
        """A number of no more digits than one can have that a float holds."""
        if len(node.value) > _MOST_DIGITS:
            raise _refused(node, f"a number of more than {_MOST_DIGITS} characters")
        if ":" in node.value:  # which YAML 1.1 takes for minutes and seconds
            raise _refused(node, f"{node.value}, to the base of 60; put it in quotes")
        whole = node.tag.endswith(":int")
        return self.construct_yaml_int(node) if whole else self.construct_yaml_float(node)

    def date(self, node: Any) -> Any:
        """A day or an hour is no plain value."""
        raise _refused(node, f"the date {node.value}; put it in quotes")


def _refused(found: Any, what: str) -> ConstructorError:
    """An error at an event or a node."""
    return ConstructorError(None, None, what, found.start_mark)


PlainLoader.add_constructor("tag:yaml.org,2002:int", PlainLoader.plain_number)
PlainLoader.add_constructor("tag:yaml.org,2002:float", PlainLoader.plain_number)
PlainLoader.add_constructor("tag:yaml.org,2002:timestamp", PlainLoader.date)
