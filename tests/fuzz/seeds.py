"""What fuzzing starts from: the models, the conformance cases, the bad models, and payloads that would do something."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from shipped import bad_models

TESTS = Path(__file__).resolve().parents[1]
FOLDERS = (TESTS.parent / "models", TESTS / "conformance" / "cases", TESTS / "fuzz" / "crashes")
CANARY = "hsdsl_canary"

# each would leave a file or an attribute called CANARY behind if anything evaluated it
PAYLOADS = (
    f"__import__('os').system('touch {CANARY}')",
    f"open('{CANARY}','w')",
    f"exec(\"open('{CANARY}','w')\")",
    f"setattr(__import__('builtins'),'{CANARY}',1)",
    f"().__class__.__base__.__subclasses__()[-1]('touch {CANARY}',shell=1)",
    f"sin.__globals__['__builtins__']['open']('{CANARY}','w')",
    f"(lambda: open('{CANARY}','w'))()",
    f"x.__class__.__init__.__globals__['os'].system('touch {CANARY}')",
    f"[open('{CANARY}','w') for _ in (1,)]",
    f"f\"{{open('{CANARY}','w')}}\"",
    f"x); open('{CANARY}','w') #",
    f"x\n    open('{CANARY}','w')",
    f"x, open('{CANARY}','w')",
    f"1 if open('{CANARY}','w') else 2",
    f'system("touch {CANARY}")',
    f"`touch {CANARY}`",
    f"$(touch {CANARY})",
    f"!!python/object/apply:os.system ['touch {CANARY}']",
    f"!!python/object/new:os.system ['touch {CANARY}']",
    "!!python/name:os.system",
    f"!!python/object/apply:subprocess.Popen [['touch','{CANARY}']]",
    f"{{{{ open('{CANARY}','w') }}}}",
    "../../../../../../etc/passwd",
    "/etc/passwd",
    "link.csv",
    "outside/secret.csv",
    "../secret.csv",
    "/dev/zero",
    "/proc/self/mem",
)

# names that mean something to a language into which a model may be translated
NAMES = (
    "__import__", "__builtins__", "__class__", "__name__", "eval", "exec", "open", "print", "lambda", "class", "def",
    "import", "return", "yield", "None", "True", "False", "self", "int", "double", "void", "static", "while", "struct",
    "main", "printf", "malloc", "NULL", "I", "E", "S", "N", "O", "Q", "pi", "zoo", "oo", "nan", "inf", "x0", "p0",
    "q_1_1",
    "bind", "flow", "t", "T", "e", "j", "α", "x\u0301", "ﬁ", "𝑥", "_", "__", "a" * 300, "mode", "constructor",
    "__proto__",
)  # fmt: skip


@cache
def documents(legal: bool = False) -> tuple[bytes, ...]:
    """Every YAML file that there is, small enough to be worth mutating; on request only those that are models."""
    paths = [path for folder in FOLDERS[: 2 if legal else 3] for path in sorted(folder.glob("*.yaml"))]
    found = [path.read_bytes() for path in paths if not path.name.endswith(".expect.yaml")]
    return tuple(data for data in (*found, *(() if legal else bad_models().values())) if len(data) < 20_000)


@cache
def expressions() -> tuple[str, ...]:
    """The expressions of the models and the conformance cases."""
    from hsdsl.language.source import Composer, Mapping, Node, Scalar, Sequence, decode

    found: dict[str, None] = {}

    def gather(node: Node) -> None:
        match node:
            case Scalar():
                found[node.value] = None
            case Sequence():
                for item in node.items:
                    gather(item)
            case Mapping():
                for _, value in node:
                    gather(value)

    for folder in FOLDERS[:2]:
        for path in sorted(folder.glob("*.yaml")):
            gather(Composer(decode(path.name, path.read_bytes())).document())
    return tuple(text for text in found if len(text) < 400)
