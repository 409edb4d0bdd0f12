"""The tutorials as the site's build runs them, without the site: block by block, in order.

Sentences that conclude from numbers stand beside assertions, so that they fail here if they are no
longer true.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from .hand_written import blocks, hand_written, name, run

RUN = [page for page in hand_written() if any(block.executed for block in blocks(page))]


@pytest.mark.parametrize("page", RUN, ids=name)
def test_page_runs_and_what_it_concludes_holds(page: Path) -> None:
    printed = run(page)
    assert printed.count("<svg") == printed.count('role="img"')
    assert "Traceback" not in printed
