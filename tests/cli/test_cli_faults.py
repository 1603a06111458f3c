"""Folders that cannot be written and disks that are full: one sentence, and what was there stays as it was."""

import shutil
import subprocess

import pytest

LOOP = ("--candidates", "viscous", "--threads", "1")


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    """A small campaign."""
    from armid.cli.new import campaign_text, synthetic_records
    from armid.record import write_campaign

    return write_campaign(tmp_path_factory.mktemp("campaign") / "axis", campaign_text("axis"), synthetic_records())


@pytest.fixture
def disk(tmp_path):
    """Return a function that makes a file system of some size, which only root may do."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mounted(size, *, read_only=False):
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
        if shutil.which("mount") is None or subprocess.run(command, check=False, capture_output=True).returncode:
            pytest.skip("a small file system cannot be mounted here")
        if read_only:
            (folder / "kept").write_text("kept")
            subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
        return folder

    yield mounted
    subprocess.run(["umount", str(folder)], check=False, capture_output=True)


def commands(axis, out):
    """Command and its words, each of which writes into a folder."""
    return {
        "identify": (axis, "--identifier", "least_squares", "--fitness", "rmse", "--out", out),
        "close-loop": (axis, *LOOP, "--out", out),
        "identifiability": (axis, "--out", out),
        "simulate": (axis, "--set", "inertia=0.05", "--out", out),
        "new": ("effect", "mine", "--out", out),
    }


WRITING = ("identify", "close-loop", "identifiability", "simulate", "new")


@pytest.mark.parametrize("command", WRITING)
def test_a_read_only_folder_is_refused_before_the_work(refused, axis, disk, command):
    folder = disk("1m", read_only=True)
    sentence = refused(command, *commands(axis, folder)[command])
    assert "Read-only file system" in sentence
    assert [p.name for p in folder.iterdir()] == ["kept"]


def test_a_page_for_a_read_only_folder(run, refused, axis, disk):
    folder = disk("20m")
    assert run("identify", *commands(axis, folder / "out")["identify"]).code == 0
    before = {p.name: p.read_bytes() for p in (folder / "out").iterdir()}
    subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
    assert "Read-only file system" in refused("report", folder / "out")
    assert {p.name: p.read_bytes() for p in (folder / "out").iterdir()} == before


@pytest.mark.parametrize("command", ["identify", "simulate", "new", pytest.param("close-loop", marks=pytest.mark.slow)])
def test_a_full_disk_leaves_nothing_half_written(run, axis, disk, command):
    folder = disk("40k")
    (folder / "kept").write_bytes(b"k" * (40_960 if command == "new" else 24_000))
    ran = run(command, *commands(axis, folder)[command])
    assert ran.code == 2, ran
    assert ran.err.count("\n") == 1
    assert "No space left on device" in ran.err
    assert [p.name for p in folder.iterdir()] == ["kept"]


def test_a_campaign_for_a_full_disk(refused, disk):
    folder = disk("12k")
    assert "No space left on device" in refused("new", "campaign", "mine", "--out", folder)
    assert list(folder.iterdir()) == []
