"""Design search: the best bodies for a task, certified, and how good any body could get."""
