"""Commands run in this process, Python in another one, refusals in one sentence, and figures that are not drawn."""

import subprocess
import sys
from contextlib import contextmanager

import pytest

from armid.cli.main import main
from armid.errors import ArmidError
from armid.report.style import pyplot


def ended(*arguments):
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as left:
        main([str(a) for a in arguments])
    return int(left.value.code or 0)


def python(*words, **options):
    """Run Python in a process of its own; return what it left."""
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def remount(folder, option):
    """Give a file system that the fixture `disk` has made another size, or make it read-only."""
    subprocess.run(["mount", "-o", f"remount,{option}", str(folder)], check=True)


@contextmanager
def refusing(*fragments):
    """Expect a refusal in one sentence that holds some fragments."""
    with pytest.raises(ArmidError) as caught:
        yield
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert [fragment for fragment in fragments if fragment not in sentence] == [], sentence


def not_drawn(figure, *paths):
    """Stand in for the function that saves a figure, or for the one that returns its SVG."""
    pyplot().close(figure)
    for path in paths:
        path.write_text("<svg/>")
    return "<svg/>"
