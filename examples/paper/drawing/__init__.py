"""What the figures look like: the only part of `paper` that knows Matplotlib."""
