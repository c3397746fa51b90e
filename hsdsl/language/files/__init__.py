"""The bytes of model files and of their data files: read once, capped, none from a device or from a forbidden place."""

from hsdsl.language.files.data import DataRefused, ModelFiles
from hsdsl.language.files.model import is_piped, open_regular, read_bytes

__all__ = ["DataRefused", "ModelFiles", "is_piped", "open_regular", "read_bytes"]
