"""Where a magnet is that spins about an axis across its moment, from what three-axis sensors see of its field."""
