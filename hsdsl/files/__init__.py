"""The bytes of model files and of their data files: read once, capped, none from a device or from a forbidden place."""

from hsdsl.files.data import DataRefused, digest_of, folder_of, read_data
from hsdsl.files.model import is_piped, open_regular, read_bytes

__all__ = ["DataRefused", "digest_of", "folder_of", "is_piped", "open_regular", "read_bytes", "read_data"]
