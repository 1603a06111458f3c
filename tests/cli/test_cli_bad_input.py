"""Files and options that cannot be used: one sentence, exit code 2, nothing written, whichever command reads them."""

import json
import os
import re
import shlex
from pathlib import Path

import pytest

from armid.errors import LONGEST_SENTENCE

OUT = {"close-loop": ["--out", "out"], "simulate": ["--out", "out"]}
COMMANDS = ("identify", "close-loop", "identifiability", "simulate", "check")
CAMPAIGNS = {
    "nowhere": "does not exist", "empty": "key 'name' is missing", "binary": "line 2: not readable as text",
    "folder": "holds no campaign.toml", "loop": "does not exist", "": "holds no campaign.toml", "/dev/null": "holds no",
    "folder/no.toml": "does not exist",
}  # fmt: skip


@pytest.fixture(autouse=True)
def things(tmp_path, monkeypatch):
    """A working folder with files that are none of ours; nothing may be added to it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").write_text("")
    (tmp_path / "binary").write_bytes(bytes(range(256)) * 4)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "report.json").write_text("{}")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "text.json").write_text('{"parameters": {"p0": {"value": "high"}}}')
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "nan.json").write_text(json.dumps({"parameters": {n: {"value": float("nan")} for n in (
        "p0", "k", "eta3", "n")}}))  # fmt: skip
    (tmp_path / "long.json").write_text('{"parameters": {"p0": {"value": 1' + "0" * 5000 + "}}}")
    before = sorted(os.listdir(tmp_path))
    yield
    assert sorted(os.listdir(tmp_path)) == before


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("campaign", "says"), CAMPAIGNS.items())
def test_what_is_no_campaign(refused, command, campaign, says):
    if (command, campaign) == ("check", ""):
        says = "does not exist"
    elif (command, campaign) == ("check", "/dev/null"):
        says = "/dev/null"
    assert says in refused(command, campaign, *OUT.get(command, []))


@pytest.mark.slow
def test_refusals(refused, small_folder, mine):
    lines = (Path(__file__).parent / "refusals.txt").read_text(encoding="utf-8").splitlines()
    told = [line for line in lines if line and not line.startswith("#")]
    assert len(told) > 130
    for line in told:
        command, _, fragments = line.partition(" => ")
        words = [word.replace("MINE", str(mine)) for word in shlex.split(command)]
        sentence = refused(*[small_folder if word == "ARM" else word for word in words])
        for fragment in fragments.split(" | "):
            assert fragment in sentence, f"{command}\n{sentence}"


@pytest.mark.parametrize("words", [
    ["identify", "n" * 5_000], ["identify", "/".join(["folder"] * 400)], ["identify", "ARM", "--" + "o" * 900],
    ["identify", "ARM", "--fitness", "f" * 900], ["identify", "ARM", "--bounds", "p0=" + "1" * 900 + ":x"],
    ["identify", "ARM", "--identifier", "multistart:" * 1000 + "bobyqa"], ["report", "n" * 900],
    ["study", "\n" * 900], ["new", "effect", "e" * 900], ["n" * 900],
])  # fmt: skip
def test_a_long_word_makes_no_long_sentence(refused, small_folder, words):
    """What is expected stands at the end, and is kept."""
    sentence = refused(*[small_folder if word == "ARM" else word for word in words])
    assert re.search(r"expect|known|did you mean|plug-in|--help|too long", sentence[-LONGEST_SENTENCE // 2 :]), sentence


def test_memory_that_is_not_there_is_told(refused, monkeypatch):
    def greedy(*_, **__):
        raise MemoryError("Unable to allocate 3 PiB")

    monkeypatch.setattr("armid.cli.listing.load_registry", greedy)
    assert "not enough memory: Unable to allocate 3 PiB" in refused("list", "effects")
