"""Many runs of one experiment, and the tables of the papers beside ours."""

from outrider.campaign.trials import Row, Trial, Trials, grid, run_trials

__all__ = ["Row", "Trial", "Trials", "grid", "run_trials"]
