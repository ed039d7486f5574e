"""Local planning: the next seconds, many times a second, around what the sensors see."""
