"""The report: every section there, nothing from outside, valid HTML, readable whatever is missing."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import factory
import numpy as np
import pytest

from outrider.data import Finding, Outcome, Run, SensorState, Trajectory, Verdict
from outrider.data.evidence import BARS, POINTS, REFUSED, Curve, Evidence
from outrider.plot import write_report
from outrider.plot.tables import number, ratio
from outrider.plot.wrong import HEADLINES
from outrider.workflows.evidence import SHOWN
from outrider.workflows.findings import HARM

SECTIONS = (
    "findings",
    "key",
    "map",
    "odom",
    "motion",
    "sources",
    "innovations",
    "sigma",
    "slow",
    "health",
    "resets",
    "origin",
)
VOID = {"meta", "link", "br", "hr", "img", "input"}


class Page(HTMLParser):
    """Checks that elements nest, and collects ids, references and visible text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.text: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        values = dict(attrs)
        self.ids += [values["id"] or ""] if "id" in values else []
        self.links += [values[k] or "" for k in ("href", "src", "xlink:href", "srcset", "data") if k in values]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> out of order"

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text.append(data)


def page(run: Run, folder: Path, reference: Trajectory | None = None) -> tuple[Page, str]:
    """Write a report and read it back."""
    path = folder / "report.html"
    write_report(run, path, reference=reference)
    html = path.read_text("utf-8")
    return Page(html), html


def check(run: Run, folder: Path, reference: Trajectory | None = None) -> tuple[Page, str]:
    """What holds for every report."""
    parsed, html = page(run, folder, reference)
    assert parsed.open == []
    assert [i for i in parsed.ids if i in SECTIONS] == list(SECTIONS)
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in parsed.links)
    assert not re.search(r"url\((?!#)|@import|<script|\bon\w+=", html)
    targets = {link[1:] for link in parsed.links if link.startswith("#")} | set(re.findall(r"url\(#([\w.-]+)\)", html))
    assert targets <= set(parsed.ids), "every reference has its target"
    text = " ".join(parsed.text)
    assert not re.findall(r".{0,30}\b(?:nan|inf|None)\b.{0,9}", text)  # "NaN or infinite value" is a reason, not a leak
    assert not re.search(r' (d|x|y|cx|points|viewBox)="[^"]*\b(nan|inf)\b', html)
    return parsed, html


@pytest.fixture
def run() -> Run:
    return factory.full_run(200)


@pytest.fixture
def lean(run: Run) -> Run:
    """The same with fewer figures, for tests about one of them."""
    return replace(run, innovations={}, local=None, health={})


def test_full_report_tells_everything(tmp_path: Path, run: Run) -> None:
    reference = factory.trajectory(np.linspace(0, 300, 200), scale=1.01)
    parsed, html = check(run, tmp_path, reference)
    text = " ".join(parsed.text)
    for words in (
        "husky_2025-04-02.bag", "read the findings", "5 min 00 s", "heading-conflict", "leave it out", "not used: the",
        "innovation outside its chi-square gate", "could not be decoded", "drives the prediction", "gyro bias",
        number(run.fused.pose.length, "m"), "95 % ellipse", "declared invalid", "10 consistent fixes", "2.21",
        "gate_probability", "floor: not set", "numpy 2.1", "9f2c9f2c", "--seed 7", "horizontal RMSE", "faulted",
        "49.9000000",
    ):  # fmt: skip
        assert words in text, words
    assert parsed.tags.count("svg") == 10  # map, odom, motion, reference, three sources, sigma, biases, health
    assert text.index("heading-conflict") < text.index("gnss-outage") < text.index("clock-ok"), "errors come first"
    assert len(html) < 1_500_000


def test_health_stands_beside_what_was_gated(tmp_path: Path, lean: Run) -> None:
    gnss, scored = lean.accounts[0], lean.accounts[2]
    fine = factory.innovations(np.linspace(0, 300, 300), ("x", "y"))
    wild = replace(fine, nis=np.where(fine.verdict == Verdict.GATED, 1e4, fine.nis))
    run = replace(
        lean,
        innovations={"gnss/fix": wild},
        health={"gnss/fix": np.array([[0.0, 1], [140, 2], [141, 3], [150, 4], [152, 1], [200, 3], [210, 1]])},
        accounts=(
            replace(gnss, nis=wild.nis_per_dof()),
            replace(scored, role="scored: magnetic", state=None, by_verdict={Verdict.WITHHELD: 300}, used=0),
            replace(gnss, source="gnss/fix (at rest)", received=0, used=0, by_verdict={}, state=SensorState.SILENT),
        ),
    )
    text = " ".join(" ".join(check(run, tmp_path)[0].text).split())
    assert "faulted 2 times, first at 141.0 s" in text
    assert f"{ratio(wild.nis_per_dof())} with the gated" in text
    assert ratio(wild.nis_per_dof(Verdict.USED)) in text
    assert "compared with the estimate, not fused" in text and "on request" not in text
    assert "warming" not in text and "at rest" not in text


def test_source_keeps_one_colour_through_the_report(tmp_path: Path, run: Run) -> None:
    _, html = page(replace(run, local=None, health={}), tmp_path)
    beside = re.findall(r'background:var\((--c-\w+)\)"></span>gnss/fix', html)
    assert len(beside) >= 4
    assert len(set(beside)) == 1


@pytest.mark.parametrize("n", [1, 2])
def test_few_samples(tmp_path: Path, n: int) -> None:
    check(factory.full_run(n), tmp_path)


def test_a_single_stamp_everywhere(tmp_path: Path) -> None:
    one = factory.full_run(1, lasts=0.0)
    check(replace(one, health={"gnss/fix": np.array([[0.0, 1.0]])}, resets=one.resets[:1]), tmp_path)


def test_empty_run(tmp_path: Path) -> None:
    parsed, _ = check(factory.empty_run(), tmp_path)
    text = " ".join(parsed.text)
    assert "No usable record" in text
    assert "no findings" in text
    assert "never reset" in text
    assert "svg" not in parsed.tags


def test_no_gnss_no_local_no_covariance(tmp_path: Path, run: Run) -> None:
    pose = replace(run.fused.pose, P=np.zeros((0, 6, 6)), v=np.zeros((0, 3)))
    fused = replace(run.fused, pose=pose, valid=np.zeros((0, 3), np.int64))
    check(replace(run, fused=fused, local=None, innovations={}, tracks={}, datum=None), tmp_path)


def test_unknown_heading_and_position(tmp_path: Path, lean: Run) -> None:
    pose = lean.fused.pose
    some = np.where(np.arange(len(pose))[:, None] < 300, np.nan, pose.q)
    check(replace(lean, fused=replace(lean.fused, pose=replace(pose, q=some))), tmp_path)
    nowhere = replace(
        pose, q=np.full_like(pose.q, np.nan), p=np.full_like(pose.p, np.nan), P=np.full_like(pose.P, np.nan)
    )
    check(
        replace(lean, fused=replace(lean.fused, pose=nowhere)), tmp_path, reference=factory.trajectory(np.arange(9.0))
    )


def test_robot_that_never_moved(tmp_path: Path, lean: Run) -> None:
    still = replace(lean.fused.pose, p=np.zeros_like(lean.fused.pose.p), v=np.zeros_like(lean.fused.pose.v))
    check(replace(lean, fused=replace(lean.fused, pose=still), tracks={}), tmp_path)


def test_hostile_names_are_text(tmp_path: Path, run: Run) -> None:
    evil = "_/imu/<script>alert(1)</script>$x^$ & \"q\" '数据'"
    hostile = replace(
        run,
        robot=evil,
        log_path=f"/tmp/{evil}.bag",
        findings=(Finding(severity="odd", code=evil, text=evil, source=evil, fix=evil),),
        innovations={evil: run.innovations["gnss/fix"]},
        tracks={evil: run.tracks["gnss/fix"]},
        health={evil: run.health["gnss/fix"]},
        accounts=(replace(run.accounts[0], source=evil),),
        config={evil: {evil: evil}},
    )
    parsed, _ = check(hostile, tmp_path)
    assert "script" not in parsed.tags
    assert evil in "".join(parsed.text)


def test_reference_elsewhere_in_time_is_said(tmp_path: Path, lean: Run) -> None:
    later = factory.trajectory(np.linspace(9000, 9100, 50))
    parsed, _ = check(lean, tmp_path, later)
    assert "does not overlap" in " ".join(parsed.text)


def test_wild_innovations_do_not_ruin_the_scale(tmp_path: Path, run: Run, lean: Run) -> None:
    record = run.innovations["gnss/fix"]
    y, s, nis = record.y.copy(), record.s.copy(), record.nis.copy()
    y[5], y[6], s[7], nis[5], nis[6] = 1e307, np.nan, np.nan, np.inf, np.nan
    check(replace(lean, innovations={"gnss/fix": replace(record, y=y, s=s, nis=nis)}), tmp_path)
    nothing = replace(record, y=np.full_like(y, np.nan), s=np.full_like(s, np.nan), nis=np.full_like(nis, np.nan))
    check(replace(lean, innovations={"gnss/fix": nothing}), tmp_path)


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_outcome_is_the_headline(tmp_path: Path, outcome: Outcome) -> None:
    parsed, _ = page(replace(factory.empty_run(), outcome=outcome), tmp_path)
    assert outcome.value[1:] in " ".join(parsed.text)


def test_same_run_gives_the_same_bytes(tmp_path: Path, lean: Run) -> None:
    assert page(lean, tmp_path)[1] == page(lean, tmp_path)[1]


def test_an_hour_at_100_hz_stays_small(tmp_path: Path) -> None:
    _, html = page(factory.full_run(360_000, lasts=3600.0), tmp_path)
    assert len(html.encode()) < 3_000_000


def test_what_is_wrong_stands_first_with_its_evidence_and_fix(tmp_path: Path, lean: Run) -> None:
    x = np.linspace(0.0, 9.0, 10)
    two = (Curve(x=x, y=x + 1.0, name="$a"), Curve(x=x, y=x, drawn=REFUSED))
    bars = (Curve(x=x[:2], y=x[:2], drawn=BARS),)
    drawings = [
        Evidence(x_label="t <s>", y_label="y", curves=two,
                 text="How & far.", at=((9.0, "here"),), levels=((2.0, "gate"),), log_y=True),
        Evidence(x_label="", y_label="n", curves=bars, text="Bars.", names=("p", "q")),
        Evidence(x_label="a", y_label="b", curves=(Curve(x=x, y=x, drawn=POINTS),), text="Square.", square=True),
    ]  # fmt: skip
    found = [
        Finding(severity="warning", code="clock-offset", text=f"seen {k}", fix="turn `it`", evidence=e)
        for k, e in enumerate(drawings)
    ]
    found.append(Finding(severity="info", code="alignment", text="only a remark"))
    parsed, html = check(replace(lean, findings=tuple(found)), tmp_path)
    bare, _ = check(replace(lean, findings=(), outcome=Outcome.OK), tmp_path)
    text = " ".join(parsed.text)
    assert parsed.tags.count("svg") == bare.tags.count("svg") + 3
    for words in (
        "3 warnings, most damaging first.",
        "One source's clock is off",
        "How & far.",
        "here",
        "q",
        "Square.",
    ):
        assert words in text, words
    places = [text.index(w) for w in ("What is wrong with this data", "seen 0", "seen 2", "Remarks", "only a remark")]
    assert places == sorted(places)
    assert text.index("only a remark") < text.rindex("Key figures")
    assert "<code>it</code>" in html
    assert "Nothing wrong was found." in " ".join(bare.text)


def test_every_finding_that_is_drawn_or_ranked_has_a_headline() -> None:
    assert {*SHOWN, *HARM} <= set(HEADLINES)
