"""What a newcomer tries first, with nothing but the README, `help()` and the TAB key."""

import pydoc
import subprocess
import sys

import pytest

import granforce as gf
from granforce.cli.parser import main


def test_tab_and_help_list_the_public_names_and_nothing_else():
    names = [name for name in dir(gf) if not name.startswith("_")]
    assert names == sorted(gf.__all__)
    assert all(getattr(gf, name) is not None for name in names)
    told = pydoc.render_doc(gf, renderer=pydoc.plaintext)
    assert "    pack(" in told and "class Packing(" in told and "find_a_place" not in told


def test_the_version_is_said_by_library_and_command(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"granforce {gf.__version__}\n"
    run = [sys.executable, "-m", "granforce", "--version"]
    assert subprocess.run(run, capture_output=True, text=True).stdout.split()[1] == gf.__version__


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_every_shell_gets_a_script_that_completes(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "limit-loads" in script and "ensemble-mu" in script


def test_bash_completes_options_choices_and_files(capsys, tmp_path):
    assert main(["completion", "bash"]) == 0
    (tmp_path / "granforce.bash").write_text(capsys.readouterr().out)
    (tmp_path / "packing.npz").touch()

    def completed(*words):
        line = " ".join(f"'{word}'" for word in words)
        ask = f"""
            source granforce.bash
            COMP_WORDS=({line}) COMP_CWORD={len(words) - 1} COMP_LINE="{" ".join(words)}"
            COMP_POINT=${{#COMP_LINE}}
            $(complete -p granforce | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
            printf '%s\\n' "${{COMPREPLY[@]}}"
        """
        run = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True)
        return run.stdout.split()

    assert "intervals" in completed("granforce", "int")
    assert "--ensemble-mu" in completed("granforce", "intervals", "--ens")
    assert completed("granforce", "walk", "--relax", "gauss_seidel_o") == ["gauss_seidel_only"]
    assert "packing.npz" in completed("granforce", "intervals", "--packing", "pack")
