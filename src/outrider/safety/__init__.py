"""What holds whichever planner drives: limits of command, collision monitor, watchdog."""
