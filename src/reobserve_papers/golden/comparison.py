"""Comparison of the numbers of a build with the golden ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve_papers.golden.number_files import Key, Numbers, columns, golden_file, read_numbers
from reobserve_papers.golden.values import built_numbers


@dataclass(frozen=True)
class Moved:
    """A number, a word or a whole column that is not the golden one.

    ``excess`` is the distance of a number in tolerances.
    """

    place: str
    golden: str
    value: str
    tolerance: str = ""
    unit: str = ""
    excess: float = math.inf

    def __str__(self) -> str:
        """One line: what it was, what it is, and for a number how far that is."""
        if not self.tolerance:
            return f"{self.place}: golden {self.golden}, found {self.value}"
        old, new = self.short
        unit = "" if self.unit in ("", "1", "word") else f" {self.unit}"
        return f"{self.place}: golden {old}, found {new}{unit}{self._by}"

    @property
    def short(self) -> tuple[str, str]:
        """Both numbers with so few digits that they differ, but four at least."""
        if not self.tolerance:
            return self.golden, self.value
        numbers = float(self.golden), float(self.value)
        for digits in range(4, 16):
            old, new = (f"{number:.{digits}g}" for number in numbers)
            if old != new:
                break
        return old, new

    @property
    def relative(self) -> str:
        """The change in per cent or as a factor, empty if it has none: from zero, of words."""
        old, new = (float(self.golden), float(self.value)) if self.tolerance else (0.0, 0.0)
        factor = new / old if old else math.nan
        if not 0 <= factor < math.inf:
            return ""
        if not 0.01 <= factor < 1.99:
            return f"x {factor:.3g}"
        return f"{100 * (new - old) / abs(old):+.2g} %"

    @property
    def _by(self) -> str:
        off = "" if math.isinf(self.excess) else f"{self.excess:.2g} times what is allowed"
        said = ", ".join(filter(None, (self.relative, off)))
        return f" ({said})" if said else ""


def compare_built(
    project: Path, folder: Path, tree: Mapping[str, Any], paper: str, part: str
) -> list[Moved]:
    """The changes of a part that was built, or `InputError` if a file is missing or damaged."""
    golden = read_numbers(golden_file(project, paper, part))
    return list(compare(golden, built_numbers(folder, tree, part), f"{paper} {part}"))


def compare(golden: Numbers, built: Numbers, name: str) -> Iterator[Moved]:
    """The number furthest off, in tolerances, of each column that moved, the furthest first."""
    return iter(sorted(_compare(golden, built, name), key=lambda moved: -moved.excess))


def _compare(golden: Numbers, built: Numbers, name: str) -> Iterator[Moved]:
    for (source, quantity, _), keys in columns(golden, built).items():
        place = f"{name}, {source} {quantity}" if source else f"{name}, {quantity}"
        old, new = ([key for key in keys if key in side] for side in (golden, built))
        units = {golden[key].unit for key in old}, {built[key].unit for key in new}
        if old != new:
            yield Moved(place, _extent(old), _extent(new))
        elif units[0] != units[1]:
            before, after = (f"in {', '.join(sorted(side)) or 'no unit'}" for side in units)
            yield Moved(place, before, after)
        else:
            worst = max(keys, key=lambda key: excess(golden, built, key))
            if (off := excess(golden, built, worst)) > 1:
                old_one, new_one = golden[worst], built[worst]
                where = f" at {worst[2]} s" if worst[2][:1].isdigit() else f" in {worst[2]}"
                at = place + where * bool(worst[2])
                allowed = "" if new_one.is_word else old_one.tolerance
                values = old_one.value or "nothing", new_one.value or "nothing"
                yield Moved(at, values[0], values[1], allowed, new_one.unit, off)


def excess(golden: Numbers, built: Numbers, key: Key) -> float:
    """The distance of a number in tolerances, 0 for one that is not compared."""
    before, after = golden[key], built[key]
    if before.value == after.value:
        return 0.0
    if before.is_word or after.is_word:
        return math.inf
    if not before.tolerance:
        return 0.0
    off = distance(float(before.value), float(after.value))
    if math.isinf(off):
        return math.inf
    allowed = float(before.tolerance)
    return off / allowed if allowed else (math.inf if off else 0.0)


def distance(first: float, second: float) -> float:
    """The distance of two numbers, infinite if only one of them is nan."""
    if first == second or (math.isnan(first) and math.isnan(second)):
        return 0.0
    off = abs(first - second)
    return math.inf if math.isnan(off) else off


def _extent(keys: list[Key]) -> str:
    if not keys:
        return "none"
    if not keys[0][2]:
        return "a number"
    if not keys[0][2][0].isdigit():
        return number_of(keys, "value")
    last = max(float(time) for _, _, time in keys)
    return f"{number_of(keys, 'number')} up to {last:g} s"


def number_of(things: Sized, word: str) -> str:
    """The number of things with their word, in the plural unless it is one."""
    return f"{len(things)} {word}{'s' * (len(things) != 1)}"
