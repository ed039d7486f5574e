"""What a robot is to do next: missions and orders as pure transition functions."""
