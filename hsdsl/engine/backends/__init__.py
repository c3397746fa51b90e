"""Back ends: each turns a `Program` into a `Kernel`."""
