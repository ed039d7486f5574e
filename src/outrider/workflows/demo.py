"""`outrider demo`: a patrol with the faults of the field, recorded, fused, and compared with what really happened."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

from outrider.data import Run, Trajectory
from outrider.errors import ExitCode
from outrider.io.record import write_recording
from outrider.io.runs import ensure_free
from outrider.io.tum import write_tum
from outrider.sim import demo_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.evaluate import FileComparison, compare_trajectories
from outrider.workflows.fuse import fuse
from outrider.workflows.fuse_file import Input, document, save
from outrider.workflows.summary import exit_code

RECORDING, TRUTH, MAP = "patrol.mcap", "truth.tum", "map.png"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Demo:
    """What the demo did."""

    run: Run
    summary: dict[str, Any]
    comparison: FileComparison

    @property
    def exit_code(self) -> ExitCode:
        """Of the fusion."""
        return exit_code(self.run)

    def invitations(self, folder: Path) -> tuple[str, ...]:
        """What to look at and to type next."""
        return (
            f"open {folder / 'report.html'} in a browser; {folder / 'run.mcap'} opens in Foxglove",
            f"try: outrider fuse {folder / RECORDING} --withhold /gnss=25",
        )


def run_demo(
    output: Path,
    *,
    seed: int = 1,
    force: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Demo:
    """Simulate, record, read, fuse, compare; write a run's folder with the recording and the truth beside it."""
    ensure_free(output, force=force)
    output.parent.mkdir(parents=True, exist_ok=True)
    holder: list[Demo] = []
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix=f".{output.name}.", dir=output.parent) as room:
        recording = Path(room) / RECORDING
        if progress is not None:
            progress("simulating", 0.0)
        log, world = demo_log(seed)
        write_recording(log, recording)
        truth = world.trajectory()
        source = Input(log=recording)
        read = replace(source.read(progress=progress), path=str(output / RECORDING))
        if progress is not None:
            progress("fusing", 0.0)
        run = fuse(read, FuseConfig(seed=seed), progress=progress)
        done = compare_trajectories(replace(run.fused.pose, datum=run.datum, name="fused"), truth)
        source = replace(source, log=output / RECORDING)
        holder.append(Demo(run=run, summary=document(run, source), comparison=done))

        def beside(folder: Path) -> None:
            recording.replace(folder / RECORDING)
            write_tum(done.reference, folder / TRUTH)
            _write_map(run, done.reference, folder / MAP)

        save(run, output, source, force=force, reference=done.reference, progress=progress, also=beside)
    return holder[0]


def _write_map(run: Run, truth: Trajectory, path: Path) -> None:
    from outrider.plot import map_figure, save_png  # imports matplotlib

    save_png(map_figure(run, reference=truth), path, dpi=110)
