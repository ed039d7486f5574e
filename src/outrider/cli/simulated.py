"""What a person reads of scenarios and simulations; from the documents that `--json` prints."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.text import Text

from outrider.cli.render import NONE, console, number, print_table, table_of, times

VAIN = ("timed_out", "unreachable")  # states of alerts


def listing(scenarios: Sequence[Mapping[str, Any]]) -> None:
    """Scenarios with what they can be told."""
    out = console()
    for s in scenarios:
        out.print(Text.assemble((s["name"], "bold"), f"  {', '.join(s['tags'])}"))
        out.print(Text(f"  {s['about']}"))
        told = ", ".join(f"{key}={value}" for key, value in s["settings"].items())
        out.print(Text(f"  --set {told}" if told else "", "dim"))


def run(summary: Mapping[str, Any], folder: Path, *, quiet: bool = False) -> None:
    """Outcome, robots, closest approaches, messages."""
    out = console()
    goals = [goal["outcome"] == "arrived" for r in summary["robots"].values() for goal in r["goals"]]
    mission = summary["mission"]
    vain = [a for a in mission["alerts"] if a["state"] in VAIN] if mission else []
    good = summary["outcome"]["code"] in ("goal", "time") and all(goals) and not vain
    text = str(summary["outcome"]["text"])
    out.print(Text(text, "bold green" if good else "bold red"))
    if quiet:
        return
    compiled = f" plus {number(summary['compile_s'])} s compiling" if summary["compile_s"] > 0.0 else ""
    took = f"simulated in {number(summary['wall_s'])} s{compiled}, {number(summary['times_real_time'])} x real time"
    out.print(Text(f"{number(summary['duration_s'])} s, {summary['log']['records']} records, {took}"))
    table = table_of(
        "robot", "moves by", ">distance", ">top speed", ">clearance", "to", ">fence", ">own estimate, RMSE"
    )
    for name, r in summary["robots"].items():
        near, fence, own = r["clearance"], r["fence"], r["estimate"]
        table.add_row(
            escape(name), escape(f"{r['vehicle']}, {r['driven_by']}"), f"{number(r['distance_m'])} m",
            f"{number(r['top_speed_m_s'])} m/s", f"{number(near['distance_m'])} m" if near else NONE,
            escape(f"{near['to']}, {near['t_s']:.1f} s" if near else NONE),
            f"{number(fence['distance_m'])} m" if fence else NONE, f"{number(own['rmse_m'])} m" if own else NONE,
        )  # fmt: skip
    print_table(out, table)
    for name, r in summary["robots"].items():
        if r["fence"] and r["fence"]["distance_m"] < 0.0:
            out.print(Text(f"{name} left the fence, by {number(-r['fence']['distance_m'])} m at worst", "yellow"))
    for name, r in summary["robots"].items():
        for goal in r["goals"]:
            out.print(_goal(name, goal))
        for held in r["safety"]:
            what = f"{name}: {held['text']}: {times(held['times'])}, {held['total_s']:.1f} s"
            out.print(Text(what, "dim"))
    for s in summary["separations"]:
        pair = " and ".join(s["robots"])
        out.print(
            Text(f"{pair} came within {number(s['distance_m'])} m of each other, hull to hull, after {s['t_s']:.1f} s")
        )
    if mission:
        _mission(mission)
    if summary["cooperation"]:
        _cooperation(summary["cooperation"])
    if summary["inspection"]:
        _inspection(summary["inspection"])
    for name, r in (summary["pursuit"] or {}).items():
        _pursuit(name, r)
    sent = summary["messages"]["sent"]
    if sent:
        lost = ", ".join(f"{n} {reason}" for reason, n in summary["messages"]["lost"].items())
        out.print(Text(f"{sent} messages sent, lost: {lost or 'none'}"))
    report = folder / "report.html"
    out.print(Text(f"report: {report}" if report.exists() else f"written to {folder}"))
    out.print(Text(f"try: {_invitation(summary, folder)}"))


def _cooperation(done: Mapping[str, Any]) -> None:
    """Errors and honesty of every robot and pair, what they would have been without the others and without sensors."""
    out = console()
    alone, bare = done["without"].get("exchange"), done["without"].get("exchange, lidar and stereo")
    out.print(Text(f"sharing: {done['method']['code']}: {done['method']['text']}"))
    table = table_of(
        "robot", ">position", ">heading", ">NEES/dof", ">in 95 % band", ">without exchange", ">nor lidar, stereo"
    )
    for name, r in done["robots"].items():
        table.add_row(
            escape(name), f"{number(r['position_m'])} m", f"{number(r['heading_deg'])} deg", f"{r['nees_per_dof']:.2f}",
            f"{r['in_band']:.0%}", f"{number(alone[name]['position_m'])} m" if alone else NONE,
            f"{number(bare[name]['position_m'])} m" if bare else NONE,
        )  # fmt: skip
    for pair in done["pairs"]:
        names = " and ".join(pair["robots"])
        table.add_row(escape(names), "", "", f"{pair['nees_per_dof']:.2f}", f"{pair['in_band']:.0%}", "", "")
    print_table(out, table)
    _sensors(done)
    told = done["exchange"]
    if told:
        lost = ", ".join(f"{n} {why}" for why, n in told["lost"].items()) or "none"
        out.print(Text(f"exchange: {told['telegrams']} telegrams, {told['sent_bytes'] * 1e-6:.1f} MB, lost: {lost}"))
        for r in told["refused"]:
            out.print(Text(f"refused from {r['from']}, {times(r['times'])}: {r['text']}", "yellow"))
        for r in told["isolated"]:
            what = "no longer believes" if r["isolated"] else "believes again"
            out.print(Text(f"{r['by']} {what} {r['robot']}, after {r['t_s']:.1f} s", "yellow"))
    for what in done["unobserved"]:
        out.print(Text(f"warning: {what}", "yellow"))


def _sensors(done: Mapping[str, Any]) -> None:
    """Every sensor's agreement and part; with `ablate` what is lost without it."""
    out = console()
    told = done["sensors"]
    shown = ["sensor", ">used", ">refused", ">NIS/dof", ">in 95 % bound", ">1 s of it is worth"]
    left_out = {(a["robot"], a["sensor"]): a["robots"] for a in done["ablation"] or ()}
    if left_out:
        shown += [f">without it: {name}" for name in done["robots"]]
    table = table_of(*shown)
    for s in told:
        name = f"{s['robot']}/{s['sensor']}" + (f" of {s['partner']}" if s["partner"] else "")
        if sum((x["robot"], x["sensor"], x["partner"]) == (s["robot"], s["sensor"], s["partner"]) for x in told) > 1:
            name += f" {s['kind']}"
        worth = NONE if s["worth_in_1_s"] is None else f"{number(s['worth_in_1_s'])} {s['unit']}"
        agrees = (NONE, NONE) if s["nis_per_dof"] is None else (f"{s['nis_per_dof']:.2f}", f"{s['in_bound']:.0%}")
        row = [escape(name), str(s["used"]), str(s["refused"]), *agrees, worth]
        for n, r in done["robots"].items() if left_out else ():
            other = left_out[s["robot"], s["sensor"]][n]
            row.append(f"{number(other['position_m'])} m, {1e3 * (other['position_m'] - r['position_m']):+.1f} mm")
        table.add_row(*row)
    print_table(out, table)


def _inspection(done: Mapping[str, Any]) -> None:
    """What every robot has seen, and its landings."""
    out = console()
    table = table_of("robot", ">planned", ">seen", ">of reachable", ">path")
    for name, r in done["robots"].items():
        seen = r["coverage"]
        table.add_row(
            escape(name), f"{100.0 * seen['planned']:.1f} %", f"{100.0 * seen['achieved']:.1f} %",
            f"{100.0 * seen['reachable']:.1f} %", f"{number(r['path']['length_m'])} m",
        )  # fmt: skip
    print_table(out, table)
    for name, r in done["robots"].items():
        for landing in r.get("landings", ()):
            what = f"{name} on its pad after {landing['t_s']:.1f} s, {number(landing['off_m'])} m off its middle"
            out.print(Text(what))


def _pursuit(name: str, r: Mapping[str, Any]) -> None:
    """How near a follower came, and what it did why."""
    out = console()
    hulls = r["least_between_hulls_m"]
    told = f"{name} behind {r['leader']}: never nearer than {number(r['least_m'])} m between centres"
    told += "" if hulls is None else f" ({number(hulls)} m hull to hull)"
    told += f", danger zone {r['danger_m']:g} m between centres"
    inside = f", inside it for {number(r['inside_s'])} s" if r["broke_danger"] else ""
    out.print(Text(told + inside, "red" if inside else ""))
    if r["held_after_s"] is not None:
        held = f"at its set-point of {number(r['set_point_m'])} m after {number(r['held_after_s'])} s"
        kept = f"while following {number(r['mean_m'])} m in the mean, spread {number(r['sd_m'])} m"
        out.print(Text(f"{held}, {kept} ({number(r['followed_s'])} s)" if r["mean_m"] is not None else held))
    for spell in r["lost"]:
        far = f"{number(spell['mean_m'])} m from the target in the mean, {number(spell['largest_m'])} m at most"
        out.print(Text(f"{spell['text']}: {number(spell['seconds'])} s, {far}"))
    for c in r["changes"]:
        out.print(Text(f"{c['stage']}, because {c['why']}: {times(c['times'])}", "dim"))
    for h in r["safety"]:
        if h["code"] != "free":
            out.print(Text(f"{h['text']}: {100.0 * h['share']:.1f} % of the commands", "dim"))
        for b in h["because"]:
            out.print(Text(f"  {times(b['times'])} because {b['text']}", "dim"))


def _mission(mission: Mapping[str, Any]) -> None:
    """What became of every alert, and what the robots are about."""
    out = console()
    shown = (">alert", "at", "from", ">raised", "robot", ">sent", ">there", ">response", ">way", ">driven", "end")
    table = table_of(*shown)
    for a in mission["alerts"]:
        table.add_row(
            str(a["alert"]), f"({a['east_m']:.1f}, {a['north_m']:.1f})", escape(a["source"] or NONE),
            _seconds(a["raised_s"]), escape(a["robot"] or NONE), _seconds(a["sent_s"]), _seconds(a["there_s"]),
            _seconds(a["response_s"]), _metres(a["way_m"]), _metres(a["driven_m"]),
            Text(_end(a), "" if a["state"] == "observed" else "yellow" if a["state"] not in VAIN else "red"),
        )  # fmt: skip
    if mission["alerts"]:
        print_table(out, table)
    for a in mission["alerts"]:
        for back in a["returned"]:
            told = f"alert {a['alert']}: given back by {back['robot']} at {back['t_s']:.1f} s: {back['text']}"
            out.print(Text(told, "yellow"))
    for name, r in mission["robots"].items():
        legs = ", ".join(f"{n} over {where}" for where, n in r["legs"].items() if n) or "none"
        out.print(Text(f"{name}: {r['duty']['text']}, battery at {100.0 * r['battery']:.0f} %, legs: {legs}"))
    if mission["bad_lines"]:
        lines = "line" if mission["bad_lines"] == 1 else "lines"
        told = f"{mission['bad_lines']} {lines} of alerts could not be used: see the notes of the report"
        out.print(Text(told, "yellow"))


def _end(a: Mapping[str, Any]) -> str:
    return a["text"] if a["repeats"] is None else f"{a['text']} ({a['repeats']})"


def _seconds(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f} s"


def _metres(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f} m"


def _goal(name: str, goal: Mapping[str, Any]) -> Text:
    """One goal in one line."""
    where = f"{name} to ({goal['east_m']:g}, {goal['north_m']:g})"
    if goal["outcome"] != "arrived":
        return Text(f"{where}: {goal['outcome']}: {goal['reason']}", "yellow")
    parts = f"estimate {number(goal['of_estimate_m'])} m, control {number(goal['of_control_m'])} m"
    return Text(f"{where}: arrived after {goal['t_s']:.1f} s, {number(goal['error_m'])} m off ({parts})")


def _invitation(summary: Mapping[str, Any], folder: Path) -> str:
    """How to fuse the recording in the frame of its truth."""
    robots, site = summary["robots"], summary["datum"]
    best = max(robots, key=lambda name: sum(s["kind"] in ("gnss", "imu") for s in robots[name]["sensors"].values()))
    which = f" --robot {best}" if len(robots) > 1 else ""
    datum = ",".join(f"{site[key]:.12g}" for key in ("lat_deg", "lon_deg", "alt_m"))
    return f"outrider fuse {folder / 'run.mcap'}{which} --datum {datum}"
