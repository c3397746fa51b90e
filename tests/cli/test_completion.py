"""Completion of a command line, as bash and zsh ask for it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from hsdsl.base.defaults import SCHEMES
from hsdsl.engine.preparation.pipeline import ENGINES
from hsdsl.interface.cli import options

ROOT = Path(__file__).parents[2]
SHELLS = ("bash", "zsh")


def answer(shell: str, line: str, cwd: Path = ROOT) -> str:
    """What the program prints when a shell completes a line, the cursor at its end."""
    words = line.split(" ")
    given = {"_HSDSL_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line}
    given |= {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-m", "hsdsl"], env={**os.environ, **paths, **given}, capture_output=True, text=True, cwd=cwd
    )
    assert not done.stderr and done.returncode == 0
    return done.stdout


def completed(shell: str, line: str, cwd: Path = ROOT) -> set[str]:
    """The candidates for the last word of a line."""
    lines = answer(shell, line, cwd).strip()
    if shell == "bash":
        return set(lines.split())
    if lines == "_files":
        return set()
    listed = lines.removeprefix("_arguments '*: :((").removesuffix("))'")
    return {entry.split('"')[1] for entry in listed.splitlines()}


@pytest.mark.parametrize("shell", SHELLS)
def test_commands_options_and_choices(shell: str) -> None:
    assert completed(shell, "hsdsl val") == {"validate"}
    assert completed(shell, "hsdsl run --eng") == {"--engine"}
    assert completed(shell, "hsdsl run models/thermostat.yaml --scheme ") == set(SCHEMES)
    assert completed(shell, "hsdsl run --method d") == {"dopri5", "dop853"}
    assert completed(shell, "hsdsl distance models/thermostat.yaml --metric rho") == {"rho", "rho-hat"}
    assert completed(shell, "hsdsl lint --format s") == {"sarif"}
    assert completed(shell, "hsdsl nothing x") == set()


@pytest.mark.parametrize("shell", SHELLS)
def test_model_files(shell: str, tmp_path: Path) -> None:
    assert completed(shell, "hsdsl run models/therm") == {"models/thermostat.yaml"}
    oscillators = {f"models/oscillator-with-stop-{n}.yaml" for n in (1, 2)}
    assert completed(shell, "hsdsl validate models/thermostat.yaml models/osc") == oscillators
    for name in ("only/a.yaml", "only/b.yml", "only/c.txt", "only/.hidden.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert completed(shell, "hsdsl lint on", tmp_path) == {"only/a.yaml", "only/b.yml"}
    assert completed(shell, "hsdsl lint nowhere/", tmp_path) == set()


@pytest.mark.parametrize("shell", SHELLS)
def test_names_of_set(shell: str, tmp_path: Path) -> None:
    assert completed(shell, "hsdsl run models/thermostat.yaml --set initial.") == {"initial.mode=", "initial.T="}
    assert {"rate=", "experiment.step="} <= completed(shell, "hsdsl run models/thermostat.yaml --set ")
    assert completed(shell, "hsdsl distance models/thermostat.yaml --set ra") == {"rate="}
    (tmp_path / "bad.yaml").write_text("modes: 3")
    assert completed(shell, "hsdsl run bad.yaml --set ", tmp_path) == set()
    assert completed(shell, "hsdsl run nothing.yaml --set ", tmp_path) == set()


@pytest.mark.parametrize("shell", SHELLS)
def test_codes(shell: str) -> None:
    assert completed(shell, "hsdsl explain HS11") == {f"HS11{n}" for n in range(10)}
    assert completed(shell, "hsdsl lint --select HS401,HS40") >= {"HS401,HS401", "HS401,HS402"}
    assert completed(shell, "hsdsl lint --ignore HS11") == set()  # codes of errors, not of rules


def test_choices_are_what_there_is() -> None:
    assert [*vars(options)["Scheme"]] == [*SCHEMES]
    assert get_args(options.Engine) == ENGINES


@pytest.mark.parametrize(("shell", "script"), [("bash", ".bash_completions/hsdsl.sh"), ("zsh", ".zfunc/_hsdsl")])
def test_install_completion(shell: str, script: str, tmp_path: Path) -> None:
    where = {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "hsdsl", "--install-completion", shell]
    done = subprocess.run(command, env={**os.environ, **paths, **where}, capture_output=True, text=True)
    assert done.returncode == 0 and shell in done.stdout, done.stderr
    assert "_HSDSL_COMPLETE=complete_" + shell in (tmp_path / script).read_text()
