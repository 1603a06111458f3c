"""Check that the tests draw every figure: each function named *_figure must have run to its end.

    python .ci/figures_drawn.py COVERAGE.json

COVERAGE.json is what `coverage json` writes. Exits with 1 and the names of those that no test draws.
"""

import ast
import json
import sys
from pathlib import Path


def last_lines(file: Path) -> dict[str, range]:
    """Return function -> lines of its last statement, of the figure functions of a file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = [f for f in tree.body if isinstance(f, ast.FunctionDef) and f.name.endswith("_figure")]
    return {f.name: range(f.body[-1].lineno, (f.body[-1].end_lineno or f.body[-1].lineno) + 1) for f in found}


def main() -> int:
    """Compare what ran with what there is."""
    told = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))["files"]
    ran = {Path(file).resolve(): set(each["executed_lines"]) for file, each in told.items()}
    files = [f.resolve() for f in sorted(Path("src").rglob("*.py"))]
    figures = [(file, name, lines) for file in files for name, lines in last_lines(file).items()]
    missed = [f"{f.relative_to(Path.cwd())}: {n}" for f, n, lines in figures if not ran.get(f, set()) & set(lines)]
    print(f"{len(figures) - len(missed)} of {len(figures)} figure functions were drawn by the tests")
    print("\n".join(missed))
    return 1 if missed or not figures else 0


if __name__ == "__main__":
    sys.exit(main())
