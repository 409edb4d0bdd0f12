"""A figure as a file of its format: whole, with its fonts inside, the same bytes each time."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.files import write_bytes, write_text, write_whole
from reobserve_papers.plotting.style_sheet import laid_out

Array = NDArray[np.float64]

# What would differ from build to build, by format.
_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
    "eps": {"Creator": "reobserve"},
    "pgf": {},
}


def save(figure: Figure, path: Path) -> None:
    """Write the format of the path's suffix, whole or not at all, without dates or versions."""
    kind = path.suffix.removeprefix(".")
    if kind not in _METADATA:
        raise InputError(str(path), f"must end in one of .{', .'.join(_METADATA)}")
    with laid_out():
        if kind == "eps":
            content = _eps(figure)
            write_bytes(path, content)
        elif kind == "pgf":
            from reobserve_papers.plotting.pgf import pgf

            write_text(path, pgf(figure, str(path)))
        else:
            about = _METADATA[kind] | (_panels(figure) if kind == "png" else {})
            write_whole(path, lambda partial: figure.savefig(partial, format=kind, metadata=about))


# What a PNG says of the share of its height that panels take, where a note is below them.
PANELS = "Panels"


def _panels(figure: Figure) -> dict[str, str]:
    note = next((text for text in figure.texts if text.get_text() == figure.get_supxlabel()), None)
    if note is None:
        return {}
    return {PANELS: f"{1 - note.get_window_extent().y1 / figure.bbox.height:.4f}"}


def _eps(figure: Figure) -> bytes:
    """Encapsulated PostScript without its date."""
    stream = io.BytesIO()
    with _opaque(figure):
        figure.savefig(stream, format="eps", metadata=_METADATA["eps"])
    return re.sub(rb"^%%CreationDate: .*\n", b"", stream.getvalue(), count=1, flags=re.MULTILINE)


@contextmanager
def _opaque(figure: Figure) -> Iterator[None]:
    """Let what is transparent be as light, but opaque: PostScript knows nothing else."""
    with ExitStack() as restored:
        artists: list[Any] = [*figure.findobj(Collection), *figure.findobj(Patch)]
        for artist in artists:
            faces, edges = map(to_rgba_array, (artist.get_facecolor(), artist.get_edgecolor()))
            if _see_through(faces) or _see_through(edges):
                restored.callback(_paint, artist, faces, edges, artist.get_alpha())
                _paint(artist, _on_white(faces), _on_white(edges), None)
        for line in figure.findobj(Line2D):
            if line.get_alpha() is not None:
                restored.callback(line.set, color=line.get_color(), alpha=line.get_alpha())
                color = _on_white(to_rgba_array(line.get_color(), line.get_alpha()))
                line.set(color=color[0], alpha=None)
        yield


def _see_through(colors: Array) -> bool:
    return bool(np.any((colors[:, 3] > 0) & (colors[:, 3] < 1)))


def _on_white(colors: Array) -> Array:
    """Colours as they look on white, but for those that cannot be seen at all."""
    share = colors[:, 3:]
    seen = np.hstack([1 - share * (1 - colors[:, :3]), np.ones_like(share)])
    return np.where(share > 0, seen, colors)


def _paint(artist: Any, faces: Array, edges: Array, alpha: float | None) -> None:
    single = isinstance(artist, Patch)
    artist.set_alpha(alpha)
    artist.set_facecolor(faces[0] if single else faces)
    artist.set_edgecolor(edges[0] if single else edges)
