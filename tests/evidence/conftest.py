"""One table for all evidence from recordings."""

from collections.abc import Iterator

import pytest
from evidence_table import Table, write


@pytest.fixture(scope="session")
def table() -> Iterator[Table]:
    rows = Table()
    yield rows
    write(rows)
