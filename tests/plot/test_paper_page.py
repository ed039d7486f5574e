"""The page of `outrider papers`: self-contained, every table and figure there, whatever the names are."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_report import Page

from outrider.campaign.papers import Pair, Paper, Row, Table, Work, exact, find_paper, make_document, paper_names
from outrider.campaign.papers.document import page
from outrider.campaign.papers.model import plain_row
from outrider.eval import paired, summary
from outrider.plot.papers import bars_figure, values_figure
from outrider.plot.style import to_svg


@pytest.fixture(scope="module")
def html() -> str:
    return page(*make_document([find_paper(name) for name in paper_names()], Work(seeds=0)))


def test_nothing_from_outside_and_every_link_leads_somewhere(html: str) -> None:
    parsed = Page(html)
    assert parsed.open == [] and "script" not in parsed.tags
    assert not re.search(r"https?://", html) and len(html) < 600_000  # three papers, their figures inline
    assert len(set(parsed.ids)) == len(parsed.ids)
    for link in parsed.links:
        if link.startswith("data:image/"):  # drawn inside of a figure
            continue
        assert link.startswith("#") and link[1:] in parsed.ids, link


def test_everything_of_the_document_is_on_the_page(html: str) -> None:
    document, _ = make_document([find_paper(name) for name in paper_names()], Work(seeds=0))
    parsed = Page(html)
    text = " ".join(" ".join(parsed.text).split())
    for paper in document["papers"]:
        for table in paper["tables"]:
            assert table["title"] in text and table["note"] in text
            for row in table["rows"]:
                assert row["name"] in text and row["note"] in text and (row["printed"] or "") in text
        assert all(f["title"] in text and f["caption"] in text for f in paper["figures"])
    assert parsed.tags.count("svg") == sum(len(p["figures"]) for p in document["papers"]) >= 5
    assert "not simulated yet" in text and "90.07" in text and "< 0.02" in text


def toy(row: Row) -> str:
    paper = Paper(name="toy", title="Toy", citation="Nobody")
    pairs = (Pair(name="a - b", unit="m", result=paired([1, 2, 4.0], [2, 3, 6.0])),)
    paper.table(lambda work: Table(key="t", title="T", rows=(row,), pairs=pairs))
    return page(*make_document([paper], Work()))


def test_seeds_and_pairs_have_their_columns() -> None:
    text = " ".join(Page(toy(Row(name="x", unit="m", printed="2.5", ours=summary([1.0, 2.0, 3.5])))).text)
    for words in ("spread", "95 % of the mean", "seeds", "1.258", "less in", "100 %", "p (Wilcoxon)", "−1.333"):
        assert words in text, words
    assert "seeds" not in " ".join(Page(toy(Row(name="x", printed="2.5"))).text).split("verdict")[0].split("value")[1]


def test_few_seeds_and_hostile_names() -> None:
    evil = '<script>alert(1)</script> & "q" 数据 $x^$'
    for ours in (None, exact(1.0), summary([1.0]), summary([])):
        parsed = Page(toy(Row(name=evil, group=evil, unit=evil, note=evil, printed="1", ours=ours)))
        assert parsed.open == [] and "script" not in parsed.tags and evil in " ".join(parsed.text)


def values() -> list[dict[str, Any]]:
    row = Row(name="UAV position", group="with", unit="m", printed="0.27", printed_sd="0.04", ours=summary([0.2, 0.3]))
    rows = [
        row,
        replace(row, group="without", ours=None),
        replace(row, printed="", ours=exact(1.0)),
        replace(row, unit=""),
    ]
    return [plain_row(r) for r in rows]


def test_values_are_drawn_where_they_are() -> None:
    figure = values_figure(values())
    assert len(figure.axes) == 2
    marks = [
        (line.get_marker(), float(line.get_xdata()[0])) for line in figure.axes[0].lines if line.get_marker() in "Do"
    ]
    assert marks == [("D", 0.27), ("o", 0.25), ("D", 0.27), ("o", 1.0)]
    names = [t.get_text() for t in figure.axes[0].get_yticklabels()]
    assert names == ["UAV position"] * 3 and {t.get_text() for t in figure.axes[0].texts} == {"with", "without"}
    assert "svg" in to_svg(figure, "values")


def test_bars_have_their_heights() -> None:
    names = ["a\n(1, 2)", "b", "c"]
    figure = bars_figure(
        names,
        np.array([1.0, -2.0, 0.5]),
        "x [m]",
        pale=np.array([True, False, False]),
        lines=[("mean", 0.3), ("mean", 1)],
    )
    (ax,) = figure.axes
    assert [p.get_height() for p in ax.patches] == [1.0, -2.0, 0.5]
    assert len(figure.legends[0].get_texts()) == 1, "one name, one entry"
    assert "svg" in to_svg(figure, "bars")
