"""What the figures look like: the only part of `hsdsl.paper` that knows Matplotlib."""
