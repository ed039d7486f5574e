"""Figures 6 to 19 of swarm2023: one flight of each scenario, by the paper's preset and by ours."""

from functools import partial
from typing import Any, Final

from outrider.campaign.papers.model import MakePicture, Picture, Work
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.followed import drawn, pursuers

SHOWN: Final = (
    ("localisation", "Figures 6, 7: localisation, full signal", {"latency_s": 0.2}),
    ("blocked", "Figures 8 to 10: localisation, blocked signal", {"latency_s": 0.2}),
    ("rendezvous", "Figures 11 to 13: rendezvous", {}),
    ("mission", "Figures 14 to 16: full mission", {}),
    ("flight", "Figures 17 to 19: two drones outdoors", {}),
)
CAPTIONS: Final = {
    "paper": "Guided on raw fixes by the paper's laws, no safety filter; its filter only watches.",
    "principled": "Guided on the estimate by the vector law above the safety filter.",
}
ALSO: Final = {
    "flight": " A simulation in place of the real flight: estimates of an autopilot's kind, wind, telemetry."
}


def pictures() -> list[MakePicture]:
    """What draws each of them."""
    return [
        partial(_picture, name=name, title=title, given=given, preset=preset)
        for name, title, given in SHOWN
        for preset in ("paper", "principled")
    ]


def _picture(work: Work, *, name: str, title: str, given: dict[str, Any], preset: str) -> Picture | None:
    if not work.simulates:
        return None

    def draw() -> object:
        from outrider.plot.following import pursuit_figure

        cast = build(*load_scenario(f"swarm2023-{name}", {"preset": preset, **given}))
        run = cast.run()
        return pursuit_figure(drawn(run, "follower", pursuers(cast)["follower"]))

    caption = f"{CAPTIONS[preset]}{ALSO.get(name, '')} Seed 1."
    return Picture(key=f"{name}-{preset}", title=f"{title}, {preset}", draw=draw, caption=caption)
