"""The text of the generated module: the composed equations and the loop that integrates them.

Classical fourth-order Runge-Kutta on lanes of candidates, a fixed number of steps between samples; on request one
stabilised step in place of many where motion decays faster than a step, as where friction holds. Where a guard
changes its sign inside a step, the step is cut there: a quadratic through the guard at both ends and in the middle
(cubic Hermite of the states) gives the instant. Only lanes with a change take the cut, so a candidate's result does
not depend on its neighbours. The loop stands in templates/kernel.py.jinja.

Effects that a whole group of candidates leaves at their null are not evaluated. A model that holds the whole library,
one or two effects of it in use, then takes four times as long as the plant alone (measured on the arm with 47 effects;
fifteen times where all are evaluated). Effects without states of their own cost half of that. The choice is one branch
for all lanes and all samples of a group. In a lane at the null an effect adds exactly 0 and its states rest, whatever
the neighbours do.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armid.engine.transpile import SourceText, local_name
from armid.model import Model
from armid.model.graph import LATE_LEAVES, Node

# Samples that are gathered before they are copied to the rows of the candidates; times that one step may be cut; sample
# intervals that one step may span.
BLOCK = 256
MAX_CUTS = 8
LONGEST_SPAN = 8
# Below so many effects a model is what a user asked for, every effect in use; the choice would only cost.
FEWEST_IDLE = 8
# What a node of an effect is where the effect is not used; a guard never crosses 0.
IDLE = {"term": 0.0, "late": 0.0, "rate": 0.0, "guard": 1.0}
# The time is the one argument of the equations that holds one value.
TIME = {"v_time": ["v_time"]}
TEMPLATE = Path(__file__).parent / "templates" / "kernel.py.jinja"
TEMPLATES = (TEMPLATE, TEMPLATE.with_name("history.py.jinja"))


@dataclass(frozen=True)
class Late:
    """Hold one late input or state: its local name, that of the input or state, and the number of its delay.

    place: number of the input, or of the state among those that are remembered.
    """

    name: str
    of: str
    place: int
    delay: int


@dataclass(frozen=True)
class KernelParts:
    """Hold what the template is filled with: local names of one model, and its equations.

    equations: text of the functions `fixed_values`, `start_values`, `rates`, `guards`, `recorded` and what they call.
    parameters, constants: what each candidate is given, in order. used: which effects any candidate of a group uses,
    empty for so few effects that all are evaluated; where there are more, what is rarely needed is compiled but once.
    states, inputs, latches: what moves, each in its order. outputs: recorded signals. kinks: guards that are not those
    of latches. jumping_guards: whether a kink may jump at a sample, as only inputs do. delays: sums of parameters by
    which inputs and states are late; the motion sees the first n_moving of them, and they cut each sample interval
    where inputs drive it, as what is late jumps or bends there. late_inputs, late_states: what is late, by which delay.
    """

    equations: str
    parameters: list[str]
    constants: list[str]
    used: list[str]
    states: list[str]
    inputs: list[str]
    latches: list[str]
    outputs: list[str]
    kinks: list[str]
    jumping_guards: bool
    delays: list[str]
    n_moving: int
    late_inputs: list[Late]
    late_states: list[Late]


def kernel_parts(model: Model) -> KernelParts:
    """Return what the module of a model is made of; its text is made only where the cache does not hold it."""
    return Emitter(model).parts()


def kernel_text(parts: KernelParts) -> str:
    """Return the text of the module."""
    # Imported here: a module that is in the cache is not generated again.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        variable_start_string="{", variable_end_string="}", trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, undefined=StrictUndefined, loader=FileSystemLoader(TEMPLATE.parent),
    )  # fmt: skip
    environment.filters |= {"comma_ended": comma_ended, "nested": nested}
    late_of = parts.late_states
    remembered = {one.place: one.of for one in late_of}
    count_of = Counter(one.delay for one in late_of)
    return environment.get_template(TEMPLATE.name).render(
        vars(parts), block=BLOCK, max_cuts=MAX_CUTS, longest=LONGEST_SPAN, wide=bool(parts.used),
        guards=[*parts.latches, *parts.kinks], driven=[*parts.inputs, *(one.name for one in parts.late_inputs)],
        remembered=[remembered[i] for i in sorted(remembered)], numbers_of_delays=range(len(parts.delays)),
        count_of=count_of, delays_of_states=sorted(count_of), felt=sorted(j for j in count_of if j < parts.n_moving),
        n_cutting=parts.n_moving if parts.inputs else 0,
    )  # fmt: skip


def comma_ended(names: Iterable[Any], prefix: str = "") -> str:
    return "".join(f"{prefix}{n}, " for n in names)


def nested(names: Sequence[Any], function: str, prefix: str) -> str:
    first = f"{prefix}{names[0]}" if names else ""
    return f"{function}(" * (len(names) - 1) + first + "".join(f", {prefix}{n})" for n in names[1:])


def variable(key: str) -> str:
    """Return the local name of a key; the prefix keeps a plant's `g` or `h` apart from the loop's own names."""
    return f"v_{key.replace('.', '__')}"


def tuple_of(values: list[str]) -> str:
    return f"({comma_ended(values)})"


def bundle_of(values: list[str]) -> str:
    return f"bundle({tuple_of(values)})"


def strengths_of(model: Model) -> dict[str, dict[str, float]]:
    """Return effect -> {key of a strength: its null} of the effects that may be inactive, none in a small model."""
    if len(model.effects) < FEWEST_IDLE:
        return {}
    nulls = {e.name: {f"{e.name}__{p.name}": p.null for p in e.parameters if p.null is not None} for e in model.effects}
    return {name: strengths for name, strengths in nulls.items() if strengths}


def use_lines(effect: str, nulls: Mapping[str, float]) -> list[str]:
    """Return the lines that tell which lanes use an effect: those with a strength that is not its null, or is NaN."""
    away = " + ".join(f"np.abs({variable(key)} - {null!r})" for key, null in nulls.items())
    return [
        f"using_{effect} = 1.0 - select(1e-300, {away}, 1.0, 0.0)",
        f"used_{effect} = any_above(using_{effect}, 0.5)",
    ]


class Emitter:
    def __init__(self, model: Model) -> None:
        self.model, self.graph = model, model.graph
        self.sources = SourceText()
        self.called: set[str] = set()
        self.strengths = strengths_of(model)

    def parts(self) -> KernelParts:
        model = self.model
        rates = [f"rate__{k.replace('.', '__')}" for k in model.states]
        latch_guards = [f"guard__{k.replace('.', '__')}" for k in model.latches]
        kinks = [n.key for n in self.graph.of_kind("guard") if n.key not in latch_guards]
        guards, inputs = [*latch_guards, *kinks], [i.name for i in model.plant.inputs]
        recorded = [o.signal for o in model.plant.outputs]
        fixed = self.fixed_keys([*rates, *guards, *recorded])
        delays, n_moving, late_inputs, late_states = self.late_leaves([*rates, *guards], recorded)
        using, used = ([f"{word}_{effect}" for effect in self.strengths] for word in ("using", "used"))
        given = [variable(k) for k in (*model.parameters, *model.constants)]
        starts = [n.replace("rate__", "initial__", 1) for n in rates]
        names = {"states": model.states, "inputs": inputs, "latches": model.latches, "kinks": kinks}
        named = {kind: [variable(k) for k in keys] for kind, keys in names.items()}
        moving = {
            "latches": named["latches"], "x": named["states"],
            "u": [*named["inputs"], *(one.name for one in late_inputs)],
            **({"l": [one.name for one in late_states]} if late_states else {}),
            "fixed": [*map(variable, fixed), *using], **({"used": used} if used else {}),
        }  # fmt: skip
        switches = [line for effect, nulls in self.strengths.items() for line in use_lines(effect, nulls)]
        constant = bundle_of([variable(k) for k in fixed] + using)
        texts = [
            self.function("fixed_values", {"given": given}, self.assignments(fixed, True) + switches,
                          f"{constant}, {tuple_of(used)}" if used else constant),
            self.evaluation("start_values", {"given": given, **TIME, "u": moving["u"]}, starts, True),
            *(self.evaluation(name, TIME | moving, keys)
              for name, keys in (("rates", rates), ("guards", guards), ("recorded", recorded))),
        ]  # fmt: skip
        if delays:
            texts.append(self.function("delay_values", {"given": given}, [], bundle_of(delays)))
        equations = self.function_texts() + "\n\n".join(texts)
        jumping = bool(kinks) and self.uses(guards, [*inputs, *(n.key for n in self.graph.of_kind("late_input"))])
        return KernelParts(
            equations, [variable(k) for k in model.parameters], [variable(k) for k in model.constants], used=used,
            outputs=[o.name for o in model.plant.outputs], **named, jumping_guards=jumping, delays=delays,
            n_moving=n_moving, late_inputs=late_inputs, late_states=late_states,
        )  # fmt: skip

    def late_leaves(self, moving: list[str], recorded: list[str]) -> tuple[list[str], int, list[Late], list[Late]]:
        """Return the delays of a model, how many of them the motion sees, and what is late by them.

        moving: keys of rates and guards; recorded: of what is recorded alone.
        """
        keys: dict[str, None] = {}
        for wanted in (moving, recorded):
            keys |= dict.fromkeys(k for n in self.graph.order(wanted) for k in n.needs)
            if wanted is moving:
                seen = list(keys)
        late = [self.graph.nodes[k] for k in keys if self.graph.nodes[k].kind in LATE_LEAVES]
        by = list(dict.fromkeys(node.by for node in late))
        inputs = [i.name for i in self.model.plant.inputs]
        states = list(dict.fromkeys(n.needs[0] for n in late if n.kind == "late_state"))
        made = {kind: [
            Late(variable(n.key), variable(n.needs[0]), known.index(n.needs[0]), by.index(n.by))
            for n in sorted(late, key=lambda n: by.index(n.by)) if n.kind == kind
        ] for kind, known in (("late_input", inputs), ("late_state", states))}  # fmt: skip
        n_moving = len({n.by for n in late if n.key in seen})
        delays = [" + ".join(map(variable, terms)) for terms in by]
        return delays, n_moving, made["late_input"], made["late_state"]

    def uses(self, keys: list[str], wanted: list[str]) -> bool:
        return any(k in wanted or self.uses(list(self.graph.nodes[k].needs), wanted) for k in keys)

    def fixed_keys(self, moving: list[str]) -> list[str]:
        """Return keys that do not move, which the moving equations use, or which stand where something may move."""
        needed = {k for n in self.graph.order(moving) if not self.graph.is_static(n.key) for k in n.needs} | {*moving}
        return [k for k in self.graph.nodes if k in needed and self.graph.is_static(k) and not self.empty_port(k)]

    def empty_port(self, key: str) -> bool:
        return self.graph.nodes[key].kind == "port" and not self.graph.nodes[key].terms

    def assignments(self, wanted: list[str], static: bool) -> list[str]:
        nodes = [n for n in self.graph.order(wanted)
                 if self.graph.is_static(n.key) == static or n.kind == "initial" or self.empty_port(n.key)]  # fmt: skip
        if static:
            return [self.line(n.key, static) for n in nodes]
        users = Counter(key for node in nodes for key in node.needs)
        terms = (key for n in nodes if n.kind == "port" for key in n.terms)
        spared = {key for key in terms if self.is_optional(key) and users[key] == 1}
        lines: list[str] = []
        for n in nodes:
            if n.key not in spared:
                lines += self.sum_lines(n, spared) if spared.intersection(n.terms) else [self.line(n.key, static)]
        return lines

    def is_optional(self, key: str) -> bool:
        """Tell whether a term moves and belongs to an effect that may be inactive."""
        node = self.graph.nodes[key]
        return node.kind == "term" and node.owner in self.strengths and not self.graph.is_static(key)

    def sum_lines(self, port: Node, spared: set[str]) -> list[str]:
        """Return the lines that sum what acts at a port: an inactive effect costs a glance, not a sum."""
        name = variable(port.key)
        lines = [f"{name} = splat(0.0)"]
        for key in port.terms:
            if key in spared:
                lines.append(f"if used_{self.graph.nodes[key].owner}: {name} = {name} + {self.where_used(key)}")
            else:
                lines.append(f"{name} = {name} + {variable(key)}")
        return lines

    def line(self, key: str, static: bool) -> str:
        """Return the line that gives a node its value; what moves in an effect that no lane uses is left out."""
        node = self.graph.nodes[key]
        if static or node.owner not in self.strengths or node.kind not in IDLE:
            return f"{variable(key)} = {self.expression(key)}"
        return f"{variable(key)} = {self.where_used(key)} if used_{node.owner} else splat({IDLE[node.kind]})"

    def where_used(self, key: str) -> str:
        """Return the value of a node of an effect in the lanes that use it, in the others what it is where it rests."""
        node = self.graph.nodes[key]
        return f"select(using_{node.owner}, 0.5, {self.expression(key)}, {IDLE[node.kind]})"

    def expression(self, key: str) -> str:
        node = self.graph.nodes[key]
        if node.function is None:
            return " + ".join(map(variable, node.terms)) or "0.0"
        name = f"f__{key}"
        self.called.add(name)
        if name not in self.sources.definitions:
            self.sources.add(name, node.function)
        return f"{name}({', '.join(f'{local_name(argument)}={variable(bound)}' for argument, bound in node.arguments)})"

    def evaluation(
        self, name: str, given: Mapping[str, list[str]], wanted: list[str], static: bool = False
    ) -> str:  # fmt: skip
        return self.function(name, given, self.assignments(wanted, static), bundle_of([variable(k) for k in wanted]))

    def function(self, name: str, given: Mapping[str, list[str]], lines: list[str], result: str) -> str:
        """Return the text of a function; given: argument -> names of what it holds; those in use are read."""
        body = [*lines, f"return {result}"]
        spoken = set(re.findall(r"\w+", "\n".join(body)))
        for argument, names in given.items():
            whole = argument if argument == "used" else f"parts({argument})"
            known = [f"{n} = of_{argument}[{i}]" for i, n in enumerate(names) if n in spoken and argument != n]
            body = [f"of_{argument} = {whole}", *known, *body] if known else body
        return f"@compiled\ndef {name}({', '.join(given)}):\n" + "\n".join(f"    {line}" for line in body) + "\n"

    def function_texts(self) -> str:
        """Return the plain functions of plant and effects, those with control flow wrapped lane by lane."""
        by_lane = self.sources.by_lane & self.called
        texts = [wrapped_by_lane(name, definition) if name in by_lane else f"@compiled\n{ast.unparse(definition)}\n"
                 for name, definition in self.sources.definitions.items()]  # fmt: skip
        return "\n\n".join(texts) + "\n\n\n"


def wrapped_by_lane(name: str, definition: ast.FunctionDef) -> str:
    arguments = ast.unparse(definition.args)
    lanes = ", ".join(f"lane({a.arg}, i)" for a in definition.args.args)
    scalar = ast.unparse(definition).replace(f"def {name}(", f"def {name}__scalar(", 1)
    return (
        f"@compiled\n{scalar}\n\n@compiled\ndef {name}({arguments}):\n"
        f"    result = splat(0.0)\n    for i in range(WIDTH):\n"
        f"        result = with_lane(result, i, {name}__scalar({lanes}))\n    return result\n"
    )
