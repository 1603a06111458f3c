"""The text of the generated module: the composed equations and the loop that integrates them.

Classical fourth-order Runge-Kutta on lanes of candidates, a fixed number of steps between samples. Where a guard
changes its sign inside a step, the step is cut there: a quadratic through the guard at both ends and in the middle
(cubic Hermite of the states) gives the instant. Only lanes with a change take the cut, so a candidate's result does
not depend on its neighbours.
"""

import ast
from collections.abc import Iterable, Mapping

from armid.engine.kernel import Parts, module_text
from armid.engine.transpile import SourceText, local_name
from armid.model import Model

# Effects that a whole group of candidates leaves at their null are passed over: their equations are not evaluated.
#
# A model that holds the whole library, one or two effects of it in use, then takes three times as long as the plant
# alone instead of fifteen times (measured on the arm with 38 effects). The choice is one branch for all lanes and all
# samples of a group. In a lane at the null an effect adds exactly 0 and its states rest, whatever the neighbours do.

# Below so many effects a model is what a user asked for, every effect in use; the choice would only cost.
FEWEST = 8
# What a node of an effect is where the effect is not used; a guard never crosses 0.
IDLE = {"term": 0.0, "rate": 0.0, "guard": 1.0}


def variable(key: str) -> str:
    """Return the local name of a key; the prefix keeps a plant's `g` or `h` apart from the loop's own names."""
    return f"v_{key.replace('.', '__')}"


def strengths_of(model: Model) -> dict[str, dict[str, float]]:
    """Return effect -> {key of a strength: its null} of the effects that can be passed over, none in a small model."""
    if len(model.effects) < FEWEST:
        return {}
    found = {e.name: {f"{e.name}__{p.name}": p.null for p in e.parameters if p.null is not None} for e in model.effects}
    return {name: strengths for name, strengths in found.items() if strengths}


def using(effect: str) -> str:
    """Return the local name of what is 1 in lanes that use an effect, else 0."""
    return f"using_{effect}"


def used(effect: str) -> str:
    """Return the local name of what tells whether any lane uses an effect."""
    return f"used_{effect}"


def use_lines(effect: str, nulls: Mapping[str, float]) -> list[str]:
    """Return the lines that tell which lanes use an effect: those with a strength that is not its null, or is NaN."""
    away = " + ".join(f"np.abs({variable(key)} - {null!r})" for key, null in nulls.items())
    return [
        f"{using(effect)} = 1.0 - select(1e-300, {away}, 1.0, 0.0)",
        f"{used(effect)} = any_above({using(effect)}, 0.5)",
    ]


INDENT = "    "


def parenthesised(items: list[str]) -> str:
    """Return a tuple expression."""
    return f"({', '.join(items)}{',' if len(items) == 1 else ''})"


class Emitter:
    """Write the parts of one model's module; `parts` holds local names, private lists hold keys of the graph."""

    def __init__(self, model: Model) -> None:
        self.model, self.graph = model, model.graph
        self.sources = SourceText()
        self.called: set[str] = set()
        states, latches = ([k.replace(".", "__") for k in keys] for keys in (model.states, model.latches))
        self._rates, self._initials = [f"rate__{k}" for k in states], [f"initial__{k}" for k in states]
        self._latch_guards = [f"guard__{k}" for k in latches]
        self._kinks = [n.key for n in self.graph.of_kind("guard") if n.key not in self._latch_guards]
        self._guards = [*self._latch_guards, *self._kinks]
        self._output = model.plant.output
        self._fixed = self._fixed_keys([*self._rates, *self._guards, self._output])
        self._strengths = strengths_of(model)
        self.parts = self._parts()

    def _parts(self) -> Parts:
        """Return the local names."""
        inputs = [i.name for i in self.model.plant.inputs]
        lists: dict[str, Iterable[str]] = {
            "parameters": self.model.parameters, "constants": self.model.constants, "fixed": self._fixed,
            "states": self.model.states, "inputs": inputs, "latches": self.model.latches,
            "latch_guards": self._latch_guards, "guards": self._kinks,
        }  # fmt: skip
        names = {name: [variable(k) for k in keys] for name, keys in lists.items()}
        names["fixed"] += [name for e in self._strengths for name in (using(e), used(e))]
        # Only an input may jump at a sample: a guard that depends on it is then evaluated anew.
        return Parts(**names, guards_use_inputs=self._uses(self._guards, inputs), wide=bool(self._strengths))

    def _uses(self, keys: list[str], wanted: list[str]) -> bool:
        return any(k in wanted or self._uses(list(self.graph.nodes[k].needs), wanted) for k in keys)

    def _fixed_keys(self, moving: list[str]) -> list[str]:
        """Keys that do not move, which the moving equations use, or which stand where something may move."""
        needed = {k for n in self.graph.order(moving) if not self.graph.is_static(n.key) for k in n.needs} | {*moving}
        return [k for k in self.graph.nodes if k in needed and self.graph.is_static(k) and self._valued(k)]

    def _valued(self, key: str) -> bool:
        """Tell whether a node is more than an empty port."""
        return not (self.graph.nodes[key].kind == "port" and not self.graph.nodes[key].terms)

    def assignments(self, wanted: list[str], static: bool) -> list[str]:
        """Return one line for each node that leads to the wanted ones."""
        return [self.line(n.key, static) for n in self.graph.order(wanted)
                if self.graph.is_static(n.key) == static or n.kind == "initial" or not self._valued(n.key)]  # fmt: skip

    def line(self, key: str, static: bool) -> str:
        """Return the line that gives a node its value; what moves in an effect that no lane uses is passed over."""
        node, value = self.graph.nodes[key], self.expression(key)
        if static or node.owner not in self._strengths or node.kind not in IDLE:
            return f"{variable(key)} = {value}"
        taken = f"select({using(node.owner)}, 0.5, {value}, {IDLE[node.kind]})"
        return f"{variable(key)} = {taken} if {used(node.owner)} else splat({IDLE[node.kind]})"

    def expression(self, key: str) -> str:
        """Return the right-hand side of a node."""
        node = self.graph.nodes[key]
        if node.kind == "port":
            return " + ".join(map(variable, node.terms)) or "0.0"
        assert node.function is not None
        name = f"f__{key}"
        self.called.add(name)
        if name not in self.sources.definitions:
            self.sources.add(name, node.function)
        return f"{name}({', '.join(f'{local_name(argument)}={variable(bound)}' for argument, bound in node.arguments)})"

    def function(self, name: str, arguments: list[str], lines: list[str], result: list[str]) -> str:
        """Return a compiled function that evaluates lines and returns a tuple."""
        body = "\n".join(INDENT + line for line in [*lines, f"return {parenthesised(result)}"])
        return f"@compiled\ndef {name}({', '.join(arguments)}):\n{body}\n"

    def equations(self) -> str:
        """Return every function that evaluates the composed equations."""
        parts = self.parts
        moving = [variable("time"), *parts.latches, *parts.states, *parts.inputs, *parts.fixed]
        given = [*parts.parameters, *parts.constants]
        starts, rates, guards = ([variable(k) for k in keys] for keys in (self._initials, self._rates, self._guards))
        fixed = [f"1.0 * {variable(k)}" for k in self._fixed]
        fixed += [name for e in self._strengths for name in (using(e), used(e))]
        switches = [line for e, strengths in self._strengths.items() for line in use_lines(e, strengths)]
        texts = [
            self.function("fixed_values", given, self.assignments(self._fixed, True) + switches, fixed),
            self.function("start_values", given, self.assignments(self._initials, True), starts),
            self.function("rates", moving, self.assignments(self._rates, False), rates),
            self.function("guards", moving, self.assignments(self._guards, False), guards),
            self.function("recorded", moving, self.assignments([self._output], False), [variable(self._output)]),
        ]
        return self.function_texts() + "\n\n".join(texts)

    def function_texts(self) -> str:
        """Return the plain functions of plant and effects, those with control flow wrapped lane by lane."""
        texts = []
        for name, definition in self.sources.definitions.items():
            if name in self.sources.by_lane & self.called:
                texts.append(by_lane(name, definition))
            else:
                texts.append(f"@compiled\n{ast.unparse(definition)}\n")
        return "\n\n".join(texts) + "\n\n\n"


def by_lane(name: str, definition: ast.FunctionDef) -> str:
    """Return a function with control flow, called once for each lane."""
    arguments = ast.unparse(definition.args)
    lanes = ", ".join(f"lane({a.arg}, i)" for a in definition.args.args)
    scalar = ast.unparse(definition).replace(f"def {name}(", f"def {name}__scalar(", 1)
    return (
        f"@compiled\n{scalar}\n\n@compiled\ndef {name}({arguments}):\n"
        f"    result = splat(0.0)\n    for i in range(WIDTH):\n"
        f"        result = with_lane(result, i, {name}__scalar({lanes}))\n    return result\n"
    )


def generate_module(model: Model, width: int) -> str:
    """Return the self-contained text of the module that simulates a model, `width` candidates side by side."""
    emitter = Emitter(model)
    equations = emitter.equations()
    return module_text(emitter.parts, equations, width)
