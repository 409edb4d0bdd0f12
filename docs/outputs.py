"""Outputs of pages, kept in the pages: `python -m docs.outputs [PAGE...]` renews them.

Code for cog stands in a comment, `<!-- [[[cog ... ]]] -->`, and what it printed last follows, up to
`<!-- [[[end]]] -->`. It shares its names with the Python blocks that stand above it on the page,
and has two more: `page`, a `Session`, and `console`, a folder to type commands in.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cogapp.cogapp import Cog, CogError

from docs.console import Console

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs/pages"

_PYTHON = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_SNIPPET = re.compile(r"^<!-- \[\[\[cog.*?^<!-- \[\[\[end\]\]\] -->\n", re.MULTILINE | re.DOTALL)


class Session:
    """What the code of a page can do besides, and what of the page was run."""

    def __init__(self, path: Path, pictures: Path) -> None:
        self.path, self.pictures = path, pictures
        self.text, self.written = path.read_text(encoding="utf-8"), StringIO()
        self.console = Console()
        self.names: dict[str, Any] = {
            "__name__": path.stem, "page": self, "console": self.console,
        }  # fmt: skip
        self._lines_run = 0

    def run(self) -> None:
        """Run the Python blocks above that were not run yet, and print what they print."""
        here = self.names["cog"].firstLineNum
        lines = self.text.splitlines(keepends=True)
        above = "\n" * self._lines_run + "".join(lines[self._lines_run : here])
        printed = StringIO()
        with contextlib.redirect_stdout(printed), self.console.inside():
            for block in _PYTHON.finditer(above):
                shifted = "\n" * above.count("\n", 0, block.start(1)) + block[1]
                exec(compile(shifted, self.path, "exec", dont_inherit=True), self.names)
        self._lines_run = here
        if printed.getvalue():
            print(f"\n```text\n{printed.getvalue().rstrip()}\n```")

    def show(self, figure: Figure, name: str, *, alt: str, caption: str) -> None:
        """Save a figure; print it as an image with ``alt`` for screen readers, and the caption."""
        from docs.pictures import save

        file = f"{self.path.stem}-{name}.png"
        save(figure, self.pictures / file)
        print(f"\n![{alt}](pictures/{file})\n\n*{caption}*")

    def part(self, name: str) -> None:
        """Print a part that is generated from code, configuration or evidence."""
        from docs.generate.parts import part

        print(part(ROOT, name))

    def references(self) -> None:
        """Print where the code is to which the text above refers; the site leads to its pages."""
        from docs.generate.api import source

        for name in sorted(set(re.findall(r"\]\[(reobserve[\w.]*)\]", self.written.getvalue()))):
            print(f"[{name}]: {os.path.relpath(source(ROOT, name), self.path.parent)}")


class _Cog(Cog):
    """Code that prints, in comments of Markdown; `]]]` alone would end it in a matrix."""

    def __init__(self) -> None:
        super().__init__()
        self.options.print_output = True
        self.options.begin_spec = "<!-- [[[cog"
        self.options.end_spec = "]]] -->"
        self.options.end_output = "<!-- [[[end]]] -->"

    def suffix_lines(self, text: str) -> str:
        """Put what was printed between empty lines: Markdown may need them."""
        return f"\n{text.strip()}\n\n" if text.strip() else ""


def renewed(path: Path, pictures: Path | None = None) -> str:
    """Run the code of a page and return its text; figures go to ``pictures`` beside it, or there.

    Raises
    ------
    CogError
        If the code fails.
    """
    import matplotlib

    session = Session(path, pictures or path.parent / "pictures")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        _Cog().process_file(StringIO(session.text), session.written, str(path), session.names)
    return session.written.getvalue()


def by_hand(text: str) -> str:
    """The text of a page without what was printed, and without the code that did."""
    return _SNIPPET.sub("", text)


def with_outputs() -> Iterator[Path]:
    """The pages that have any."""
    for path in sorted(PAGES.rglob("*.md")):
        if _SNIPPET.search(path.read_text(encoding="utf-8")):
            yield path


def main() -> None:
    """Renew pages in place: those that are named, or all."""
    from reobserve.core.code_paths import pin_code_paths

    pin_code_paths()
    for path in [Path(name).resolve() for name in sys.argv[1:]] or with_outputs():
        try:
            path.write_text(renewed(path), encoding="utf-8")
        except CogError as error:
            sys.exit(f"{path.relative_to(ROOT)}: {error}")


if __name__ == "__main__":
    main()
