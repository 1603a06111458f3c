"""Generated modules: named by their text, compiled once and for all, and made of packed instructions."""

import importlib
import json
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest
from numba.core import codegen

from armid.engine import cache_folder, compile_model, simulate
from armid.engine import compile as compiler
from armid.engine.compile import keep, load_module, module_name, read_whole, unusable, write_whole
from armid.engine.generate import kernel_parts
from armid.engine.simd import LINKED, RARE, LinkedLibrary
from armid.model import EFFECTS, PLANTS, Effect, Manoeuvre, Model, Parameter

SCRIPT = """
import json
import numpy as np
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model
from armid.engine import compile_model, simulate
model = Model(PLANTS["driven_axis"]) + EFFECTS["viscous"]
found = simulate(model, Manoeuvre(0.01, 50, inputs={"u": np.ones(50)}), [[1.0, 0.5]])
kernel = compile_model(model)
hits, misses = (sum(n.values()) for n in (kernel.stats.cache_hits, kernel.stats.cache_misses))
print(json.dumps({"hits": hits, "misses": misses, "last": found.output[0, -1]}))
"""


def start(folder):
    """Simulate in a process of its own, with a cache folder."""
    paths = [str(Path(__file__).parents[2] / "src"), os.environ.get("PYTHONPATH", "")]
    told = os.environ | {"ARMID_CACHE": str(folder), "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    return subprocess.Popen([sys.executable, "-W", "error", "-c", SCRIPT], env=told, text=True, stdout=subprocess.PIPE)


def result(process):
    out, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    return dict(json.loads(out))


def listing(folder):
    return {str(p): (p.stat().st_size, p.stat().st_mtime_ns) for p in folder.rglob("*") if p.is_file()}


@pytest.mark.nightly
def test_a_second_process_compiles_nothing_and_damaged_code_is_compiled_again(tmp_path):
    """No other number, no traceback, whatever became of the files; and they are mended."""
    folder = tmp_path / "new" / "cache"
    both = [start(folder), start(folder)]
    first = [result(p) for p in both]
    kept = listing(folder)
    again = result(start(folder))
    assert any(f["misses"] == 1 for f in first)
    assert (again["hits"], again["misses"]) == (1, 0)
    assert listing(folder) == kept
    assert len(list(folder.rglob("*.py.bin"))) == 1
    assert not list(folder.rglob("*.part"))
    assert {f["last"] for f in first} == {again["last"]}
    for file in listing(folder):
        Path(file).write_bytes(damaged(Path(file).read_bytes())[3])
    mended, then = result(start(folder)), result(start(folder))
    assert (mended["misses"], then["hits"]) == (1, 1)
    assert mended["last"] == then["last"] == again["last"]


def effect_of(folder, text):
    """An effect whose equation is read from a file of that text."""
    names = {}
    file = folder / f"user_{abs(hash(text))}.py"
    file.write_text(text, encoding="utf-8")
    exec(compile(text, str(file), "exec"), names)
    return Effect("own", (Parameter("level", "effort", 0, 1, null=0.0),), {"torque": names["torque"]})


def test_a_module_is_named_by_its_equations(tmp_path):
    """By what they compute and what they take from their file, not by the words beside them."""
    head = "def torque(omega, level):\n    return -level * "
    texts = [
        f"{head}omega\n", f"{head}omega * 2\n", f"F = 4\n{head}omega * F\n", f"F = 3\n{head}omega * F\n",
        f"def f(x):\n    return x\n{head}f(omega)\n", f"def f(x):\n    return -x\n{head}f(omega)\n",
        'def torque(omega: float, level: float) -> float:\n    """Say something."""\n    return -level*omega  # so\n',
    ]  # fmt: skip
    models = [Model(PLANTS["driven_axis"]) + effect_of(tmp_path, t) for t in texts]
    names = [module_name(kernel_parts(m)) for m in models]
    assert len(set(names[:-1])) == len(texts) - 1
    assert names[-1] == names[0]


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    (tmp_path / "a file").write_text("")
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path / "a file" / "cache"))
    parts = kernel_parts(Model(PLANTS["driven_axis"]))
    monkeypatch.delitem(sys.modules, module_name(parts), raising=False)
    with pytest.warns(UserWarning, match=r"compiled code is not kept: .*cannot be used \(Not a directory\)"):
        assert load_module(parts).simulate


def damaged(content):
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 4
    return [b"", content[: len(content) // 2], bytes(len(content)), bytes(flipped), b"raise SystemExit"]


def test_ctrl_c_that_numba_loses_ends_all_the_same(tmp_path, monkeypatch):
    """An interrupt while LLVM hands over the machine code ends in its callback, and numba is left without the code."""
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path))
    monkeypatch.setattr(codegen.CodeLibrary, "_compiled_object", property(lambda _: None, lambda *_: None), False)
    with pytest.raises(KeyboardInterrupt):
        keep(numba.njit(lambda x: x + 1.0), "a name")(1.0)
    assert not list(cache_folder().iterdir())


def test_a_damaged_module_is_written_again(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path))
    parts = kernel_parts(Model(PLANTS["driven_axis"]))
    name = module_name(parts)
    monkeypatch.delitem(sys.modules, name, raising=False)
    load_module(parts)
    file = cache_folder() / f"{name}.py.bin"
    whole = file.read_bytes()
    other = file.with_name("armid_code_other.bin")
    write_whole(other, b"simulate = None")
    for content in (*damaged(whole), other.read_bytes()):
        monkeypatch.delitem(sys.modules, name, raising=False)
        file.write_bytes(content)
        load_module(parts)
        assert file.read_bytes() == whole


def test_code_that_another_user_may_have_written_is_not_run(tmp_path, monkeypatch):
    """Whatever the type of the entry, and whenever it was put there; the own code takes its place."""
    path, elsewhere = tmp_path / "armid_code_x.bin", tmp_path / "elsewhere"
    elsewhere.mkdir()
    write_whole(elsewhere / path.name, b"code")

    def link():
        path.symlink_to(elsewhere / path.name)

    def open_to_others():
        os.link(elsewhere / path.name, path)
        path.chmod(0o620)

    for plant in (link, lambda: os.mkfifo(path), path.mkdir, open_to_others):
        plant()
        assert read_whole(path) is None
        if path.is_dir():
            path.rmdir()
        write_whole(path, b"own")
        assert read_whole(path) == b"own"
        path.unlink()
    write_whole(path, b"code")
    uid = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    assert read_whole(path) is None
    assert path.exists()


def test_where_the_cache_is(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path / f"armid-{os.getuid()}"
    monkeypatch.delenv("ARMID_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "armid"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert cache_folder() == tmp_path / "home" / ".cache" / "armid"
    # What ARMID_CACHE names may be /var/tmp: its permissions and its other files stay as they are.
    (tmp_path / "letters.txt").write_text("")
    tmp_path.chmod(0o1777)
    monkeypatch.setenv("ARMID_CACHE", str(tmp_path))
    folder = cache_folder()
    assert unusable(folder) == ""
    assert [path.stat().st_mode & 0o7777 for path in (tmp_path, folder)] == [0o1777, 0o700]
    assert sorted(tmp_path.iterdir()) == [folder, tmp_path / "letters.txt"]
    uid = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    assert unusable(tmp_path) == "it is somebody else's"


def test_models_run_in_packed_instructions(monkeypatch):
    features = llvm.get_host_cpu_features()
    if not (features.get("avx2") or features.get("avx512f")):
        pytest.skip("this processor has neither AVX2 nor AVX-512, whose instructions are looked for")
    # A kernel that comes from the cache cannot show its instructions: it is compiled anew.
    model = Model(PLANTS["driven_axis"]) + EFFECTS["coulomb"] + EFFECTS["viscous"]
    fresh = numba.njit(error_model="numpy", nogil=True)(compile_model(model).py_func)
    monkeypatch.setattr(importlib.import_module("armid.engine.simulate"), "compile_model", lambda _: fresh)
    simulate(model, Manoeuvre(0.001, 9, inputs={"u": np.ones(9)}), [[1.0, 0.5, 0.01, 0.5]])
    text = "\n".join(fresh.inspect_asm().values())
    arithmetic = r"\bv(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d+)"
    packed, scalar = (len(re.findall(arithmetic + end, text)) for end in (r"pd\s.*[yz]mm", r"sd\s"))
    assert packed > max(100, 4 * scalar)


def test_a_linked_function_has_no_code_of_its_own_and_what_is_shared_or_rare_stays_a_call():
    inner = numba.njit(**LINKED)(lambda x: 2.0 * x + 1.0)
    middle = numba.njit(**LINKED)(lambda x: inner(x) ** 2)
    outer = numba.njit(lambda x: middle(x) + inner(x))
    assert outer(3.0) == 56.0
    for function in (inner, middle):
        (compiled,) = function.overloads.values()
        assert isinstance(compiled.library, LinkedLibrary)
        assert not compiled.library.codegen._engine.is_symbol_defined(compiled.fndesc.mangled_name)
    # Numba hands the option of a caller on to what it calls, which made a model many times as large.
    shared, rare = numba.njit(**LINKED, forceinline=False)(lambda x: 2.0 * x + 1.0), numba.njit(**RARE)(lambda x: x**2)
    caller = numba.njit(**LINKED, forceinline=True)(lambda x: shared(x) + rare(x))
    outer = numba.njit(lambda x: caller(x) + 1.0)
    assert outer(3.0) == 17.0
    texts = [str(next(iter(f.overloads.values())).library._final_module) for f in (shared, rare, caller)]
    assert ["alwaysinline" in text for text in texts] == [False, False, True]
    assert ["noinline" in text for text in texts[:2]] == [False, True]


def test_one_of_two_threads_that_wait_for_the_same_kernel_says_so(monkeypatch):
    said = []
    monkeypatch.setattr(compiler, "announced", lambda sentence: nullcontext(said.append(sentence)))
    model, kernel = Model(PLANTS["rotary_arm"]), SimpleNamespace(signatures=[])
    with compiler.compiling(model, kernel), compiler.compiling(model, kernel):
        pass
    assert [s.partition(";")[0] for s in said] == ["compiling rotary_arm"]
