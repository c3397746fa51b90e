"""Names: which are legal, which are taken by the language, and which one was probably meant, also in a call."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

from hsdsl.base.errors import UsageError

V = TypeVar("V")
LOOKALIKES = "·²³"  # Unicode allows some of them in names; in mathematics they are operators
# controls, line ends that are none in YAML, marks of direction, and what has no width
INVISIBLE = (  # these are compiled where they are needed, which few runs do
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u00ad\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u2069\ufeff\ufffe\uffff]"
)
_HIDDEN = f"(?:{INVISIBLE}|[\n\r\ud800-\udfff])"  # a surrogate is a byte that is no text
_MEMORY = "@"  # in no name of a file
_STORED = rf".*{_MEMORY}to\.(.+?)(?:\[\d+\])?"
GREEK = "GREEK (?:SMALL|CAPITAL) LETTER ([A-Z]+)"
SINCE = "since"  # the time since the mode was entered, where a file has no such name of its own
INITIAL = "initial."  # before the name of a state: its initial value
NO_FILE = "<text>"  # the path of a model that is in no file
WORDS = ("and", "or", "not", "true", "false")
_SIGNS = {  # signs that Unicode does not take for the ASCII sign they look like, or not for that alone
    **dict.fromkeys("‐‑‒–—―−", "-"),
    **dict.fromkeys("“”„‟″", '"'),
    **dict.fromkeys("‘’‚‛′´", "'"),
    **dict.fromkeys("∗✱", "*"),
    **dict.fromkeys("∕⁄", "/"),
    **dict.fromkeys("∶꞉", ":"),
    "¦": "|",
}
_LETTERS = str.maketrans(  # Cyrillic and Greek letters and the Latin ones they look like
    "аеорсухіјѕԁһԛԝАВЕКМНОРСТУХІЈЅΑΒΕΖΗΙΚΜΝΟΡΤΥΧοανρ", "aeopcyxijsdhqwABEKMHOPCTYXIJSABEZHIKMNOPTYXoavp"
)
_WIDE = "<(?:wide|narrow|small|noBreak|compat)> [0-9A-F]{4,5}"
_LONGEST_TO_COMPARE = 60
_MOST_TO_COMPARE = 300
MOST_LISTED = 8


def normalised(name: str) -> str:
    """The one spelling of a name that Unicode can write in several ways (NFC)."""
    return name if name.isascii() else unicodedata.normalize("NFC", name)


def is_identifier(name: str) -> bool:
    """Whether a text has the form of a name: letters, digits and underscores, no digit first."""
    return normalised(name).isidentifier() and not any(sign in name for sign in LOOKALIKES)


def in_latin(name: str) -> str:
    """A name with the Latin letters that its Cyrillic and Greek ones look like."""
    return name if name.isascii() else name.translate(_LETTERS)


def plain_sign(character: str) -> str | None:
    """The ASCII sign, digit or blank that another character is easily taken for."""
    if character.isascii():
        return None
    wide = re.fullmatch(_WIDE, unicodedata.decomposition(character))
    plain = _SIGNS.get(character) or (unicodedata.normalize("NFKC", character) if wide else "")
    return plain if plain.isascii() and not plain.isalpha() and len(plain) == 1 else None


def told_apart(character: str) -> str:
    """A sentence about a character that looks like an ASCII sign."""
    plain, code = plain_sign(character), f"U+{ord(character):04X}"
    return f"this blank is {code}, not a space" if plain == " " else f"`{character}` ({code}) only looks like `{plain}`"


def closest(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate that looks most like a name, None where none looks like it."""
    if len(name) > _LONGEST_TO_COMPARE:
        return None
    names = [c for c in dict.fromkeys(candidates) if len(c) <= _LONGEST_TO_COMPARE]
    for candidate in names:
        if candidate.lower() == name.lower() and candidate != name:
            return candidate
    plain = _spelled(name)
    for candidate in names:
        if _spelled(candidate) == plain or in_latin(candidate) == in_latin(name):
            return candidate
    if len(names) > _MOST_TO_COMPARE:
        return None
    import difflib  # few names are misspelt

    matches = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return matches[0] if matches else None


def _spelled(name: str) -> str:
    """A name without accents and dots above, Greek letters by their names: what people take for the same."""
    letters: list[str] = []
    for letter in name if name.isascii() else unicodedata.normalize("NFKD", name):
        greek = re.fullmatch(GREEK, unicodedata.name(letter, ""))
        letters.append(greek.group(1) if greek else "" if unicodedata.combining(letter) else letter)
    return "".join(letters).lower().replace("_", "")


def memory(owner: str, part: str) -> str:
    """The name of a state that remembers what an event did: readers see it only where they name it."""
    return f"{owner}{_MEMORY}{part}"


def nth_memory(state: str, number: int) -> str:
    """What the state of an execution that waits is called of the one with a number, from 1, in their order."""
    return state if number == 1 else f"{state}[{number}]"


def remembered_state(name: str) -> str:
    """The state whose later value a state of an event's memory is, as x of ``NAME@to.x[2]``; none is ``""``."""
    found = re.fullmatch(_STORED, name)
    return found[1] if found else ""


def without_memory(names: Iterable[str]) -> tuple[str, ...]:
    """The names of states that readers see: those of the file."""
    return tuple(name for name in names if _MEMORY not in name)


def counted(number: int, noun: str) -> str:
    """A number with its noun."""
    return f"{number} {noun}{'s' * (number != 1)}"


def seen(values: Mapping[str, V]) -> Mapping[str, V]:
    """Values by name without the memory of events."""
    names = without_memory(values)
    return values if len(names) == len(values) else {name: values[name] for name in names}


def listed(names: Iterable[str]) -> str:
    """Names as a sentence has them: ``'a', 'b' and 'c'``."""
    *some, last = (f"'{name}'" for name in names)
    return f"{', '.join(some)} and {last}" if some else last


def called(title: str | None, path: str) -> str:
    """What a model is called: by its title, else by its file."""
    return title or ("a model without a file" if path.rpartition("/")[2] == NO_FILE else path)


def did_you_mean(name: str, candidates: Iterable[str], otherwise: str | None = None) -> str | None:
    """A hint with the closest candidate, or with all of them where they are few; memory of events is none.

    Of many candidates with none close the hint is the other one, or the first few.
    """
    names = list(dict.fromkeys(without_memory(candidates)))
    best = closest(name, names)
    if best is not None and best != name and in_latin(best) == in_latin(name):
        one, other = next((a, b) for a, b in zip(name, best, strict=True) if a != b)
        strange = other if one.isascii() else one
        return f"did you mean '{best}'? `{strange}` is U+{ord(strange):04X}, another letter that looks the same"
    if best is not None:
        return f"did you mean '{best}'?"
    if names and (len(names) <= MOST_LISTED or otherwise is None):
        more = len(names) - MOST_LISTED
        return "known here: " + ", ".join(names[:MOST_LISTED]) + f" and {more} more" * (more > 0)
    return otherwise


def visible(text: str) -> str:
    """A text as one line, character by character, without any that steer a terminal or hide from a reader."""
    return text if text.isprintable() else re.sub(_HIDDEN, "\ufffd", text)


def visible_lines(text: str) -> str:
    """A text of several lines, each of them visible."""
    if text.replace("\n", "").isprintable():  # a whole answer, of which nearly all are
        return text
    return "\n".join(map(visible, text.split("\n")))


def shown(text: str, limit: int | None = 60) -> str:
    """A text as a sentence can carry it: in one line, and cut."""
    text = visible(" ".join(re.sub(INVISIBLE, "\ufffd", text).split()))
    return text if limit is None or len(text) <= limit else text[: limit - 3] + "..."


P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)
TAKES_ANY = 0x08  # a flag of code: `**options`, which it hands on
Elsewhere = Callable[..., str | None]  # of a method's object and the name: the hint, where there is one


def nowhere(*_: object) -> None:
    """No hint."""


def checks_arguments(function: Callable[P, R], name: str = "", elsewhere: Elsewhere = nowhere) -> Callable[P, R]:
    """Let a function raise UsageError for an argument that it does not have; ``elsewhere`` may have a hint."""
    code = cast(FunctionType, function).__code__
    if code.co_flags & TAKES_ANY:
        return function
    own = frozenset(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
    others = [each for each in code.co_varnames[: len(own)] if each != "self"]
    name = name or code.co_name

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        if not own.issuperset(kwargs):
            key = next(key for key in kwargs if key not in own)
            hint = (elsewhere(args[0], key) if args else None) or did_you_mean(key, others)
            hint = hint or f"its arguments are {', '.join(others)}"
            raise UsageError(f"{name} has no argument '{key}'", hint)
        return function(*args, **kwargs)

    return checked


def checks_methods(kind: C, elsewhere: Elsewhere = nowhere, name: str = "") -> C:
    """Let a class and its methods raise UsageError for arguments that are none of theirs."""
    for key in list(vars(kind)):
        value: Any = kind.__init__ if key == "__init__" else vars(kind)[key]  # a data class compiles its own then
        if isinstance(value, FunctionType) and (key == "__init__" or not key.startswith("_")):
            of = name or kind.__name__
            setattr(kind, key, checks_arguments(value, of if key == "__init__" else f"{of}.{key}", elsewhere))
    return kind
