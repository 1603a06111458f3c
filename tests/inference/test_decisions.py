"""Every number that decides stands in `inference/decisions.py`: the code is read, and no other is found."""

import ast
from pathlib import Path

import armid
from armid.inference import decisions

SRC = Path(armid.__file__).parent
NOISE = SRC / "estimation" / "noise_model.py"
FILES = sorted([*(SRC / "loop").glob("*.py"), *(SRC / "inference").rglob("*.py"), NOISE])
MOST = 20
# Constants that are compared with and decide nothing that a user is told, by what they are.
NUMERICS = {
    "rounding": ("DEPENDENT", "NEGLIGIBLE", "ROUNDING_OF_SIGNAL", "ROUNDING_OF_LAW", "ROUGHLY", "LEAST_CHANCE"),
    "whether differences tell a slope": ("BELIEVED", "LEAST_RISE", "BENT_RISE", "FOLLOWED"),
    "convergence of fits and of the engine": ("SETTLED_COST", "NEAR_NOISE", "FURTHER_ERROR",
                                              "WIDE", "FORETOLD", "UNTOLD"),
    "budgets of computing": ("FEWEST_IN_BUNDLES", "MOST_IN_VAIN", "MOST_EFFECTS", "MOST_OF_SIZE", "MOST_RIVALS",
                             "FEWEST_OF_PART", "FEW_PLACES", "SPARED"),
    "estimate of the noise": ("FEWEST_FOR_COLOUR", "FEWEST_ORDINATES", "MOST_LAGS_OF_NOISE",
                              "MOST_BRIDGED", "STILL", "EVEN_SPEED", "MISFIT", "ENGINE_ERRORS", "CHANCE_OF_COLOUR",
                              "CERTAIN", "TRIFLE"),
    "what can be asked of records at all": ("FEWEST_RECORDS", "FEWEST_OTHERS", "MOVED", "SAME_PORT", "SAME_VARIABLE",
                                        "SAME_ORDER", "SAME_LAW", "OF_WAVES", "LARGEST_DRIFT"),
    "layout of pages": ("MOST_DRAWN", "MOST_CONSTANTS", "SHIFTED", "LEAST_SHARE", "WEAK", "REPORT_VERSION"),
}  # fmt: skip
# Plain numbers in comparisons that are no decision either: a half, rounding, and where a series or a range turns.
LITERALS = {0, 1, 2, 3, -1, 0.5, 1.5, 5.0, 0.05, 1e-7, 1e-9, 1e-12, 1e-300}


def numbers_of(tree):
    """Return the names of a module's own numeric constants."""
    found = set()
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(part, ast.Constant) and isinstance(part.value, (int, float)) for part in ast.walk(node.value)
        ):
            found |= {part.id for target in node.targets for part in ast.walk(target) if isinstance(part, ast.Name)}
    return found


def compared(tree, kind):
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            yield from (part for part in ast.walk(node) if isinstance(part, kind))


def test_no_other_constant_and_no_plain_number_decides():
    known = {name for names in NUMERICS.values() for name in names}
    trees = {file: ast.parse(file.read_text()) for file in FILES if file.name != "decisions.py"}
    mine = {name for tree in trees.values() for name in numbers_of(tree) if name.isupper()}
    used = {part.id for tree in trees.values() for part in compared(tree, ast.Name)}
    assert mine & used <= known
    assert known <= used, "a name of the list is compared with nowhere"
    for file in FILES:
        for part in compared(ast.parse(file.read_text()), ast.Constant):
            if isinstance(part.value, (int, float)) and not isinstance(part.value, bool):
                assert part.value in {0, 1, 2, 3, -1} | LITERALS, (
                    f"{file.name}:{part.lineno} compares with {part.value}"
                )


def test_the_list_is_short_and_every_number_of_it_is_used_and_says_why():
    names = [name for name in vars(decisions) if name.isupper()]
    assert len(names) <= MOST
    text = "\n".join(file.read_text() for file in FILES if file.name != "decisions.py")
    assert [name for name in names if name not in text] == []
    lines = Path(decisions.__file__).read_text().splitlines()
    for name in names:
        place = next(i for i, line in enumerate(lines) if line.startswith(f"{name} ="))
        assert lines[place - 1].startswith("# "), name
