"""Coverage-guided fuzzing with atheris (not a dependency: ``pip install atheris``).

python tests/fuzz/coverage_guided.py bytes|expressions|documents [libFuzzer options, such as -runs=100000]

The fuzzer's bytes are the file itself, the expression, or the randomness that a document is made from. An exception
that is no refusal stops it and leaves the input in ``crash-...``.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from random import Random

import atheris

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2])]

with atheris.instrument_imports(include=["hsdsl"]):
    from fuzz import generators, seeds, targets


class Drawn(Random):
    """Randomness that is read from the fuzzer's bytes; once they are spent, always the same."""

    def __init__(self, data: bytes) -> None:
        self._provider = atheris.FuzzedDataProvider(data)
        super().__init__(0)

    def random(self) -> float:
        """A number in [0, 1)."""
        if self._provider.remaining_bytes():
            return self._provider.ConsumeIntInRange(0, 2**32 - 1) / 2**32
        return super().random()

    def getrandbits(self, k: int) -> int:
        """``k`` bits."""
        if self._provider.remaining_bytes() and k < 64:
            return self._provider.ConsumeIntInRange(0, 2**k - 1)
        return super().getrandbits(k)


def main() -> None:
    """Fuzz one kind until stopped."""
    kind = sys.argv.pop(1) if len(sys.argv) > 1 else "bytes"
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as corpus:
        inside = targets.prepared(Path(folder))
        guard = targets.Guard(inside)
        texts = [text.encode() for text in seeds.expressions()]
        for number, data in enumerate(texts if kind == "expressions" else seeds.documents()):
            (Path(corpus) / str(number)).write_bytes(data)

        def one(data: bytes) -> None:
            given: str | bytes = data
            if kind == "expressions":
                given = data.decode("utf-8", "replace")
            elif kind == "documents":
                given = generators.document(Drawn(data))
            with guard.watch():
                targets.feed(kind, given, Random(0), inside, 0.0)

        atheris.Setup([sys.argv[0], corpus, f"-artifact_prefix={os.getcwd()}/", *sys.argv[1:]], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
