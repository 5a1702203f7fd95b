"""What is asked of a system: its capabilities, return map and sizes, and the budget of what asks."""
