"""Stored records with columns of other types, odd values and other metadata."""

from __future__ import annotations

import json
from typing import Any

import pyarrow.parquet as parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drawn.test_files import observed_record
from tests.reobserve.bad_input.odd import changed
from tests.reobserve.bad_input.test_records import KEY, ROWS, changed_table, written

from . import valid


def observed(paper: str, content: bytes) -> bool:
    return observed_record(paper).accepts(content)


@pytest.mark.parametrize("options", [{"compression": one} for one in ("none", "snappy", "gzip")])
def test_compressed_record_is_accepted(options: dict[str, Any]) -> None:
    assert observed("imm", written(parquet.read_table(valid.record("imm")), **options))
    assert observed("imm", written(parquet.read_table(valid.record("imm")), row_group_size=100))


@given(st.data())
def test_changed_columns_are_accepted_or_refused(data: st.DataObject) -> None:
    paper = data.draw(st.sampled_from(valid.PAPERS))
    table = parquet.read_table(valid.record(paper)).slice(0, ROWS)
    observed(paper, written(data.draw(changed_table(table))))


@given(st.data())
def test_changed_metadata_is_accepted_or_refused(data: st.DataObject) -> None:
    paper = data.draw(st.sampled_from(valid.PAPERS))
    table = parquet.read_table(valid.record(paper)).slice(0, ROWS)
    about = json.loads(table.schema.metadata[KEY])
    metadata = json.dumps(data.draw(changed(about))).encode()
    observed(paper, written(table.replace_schema_metadata({KEY: metadata})))
