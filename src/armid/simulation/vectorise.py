"""Python expressions that hold for one number, rewritten so that they hold for lanes too."""

import ast

# A name that no function can have; it becomes `np` when the names of the function are replaced.
NUMPY = "numpy itself"


def call(function: str, *arguments: ast.expr) -> ast.Call:
    """Return the expression `np.function(...)`."""
    return ast.Call(ast.Attribute(ast.Name(NUMPY, ast.Load()), function, ast.Load()), list(arguments), [])


class Vectorise(ast.NodeTransformer):
    """Turn choices inside expressions into selections, and small whole powers into products."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return call("where", node.test, node.body, node.orelse)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        name = "logical_and" if isinstance(node.op, ast.And) else "logical_or"
        result = node.values[0]
        for value in node.values[1:]:
            result = call(name, result, value)
        return result

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        return call("logical_not", node.operand) if isinstance(node.op, ast.Not) else node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        lefts = [node.left, *node.comparators[:-1]]
        result: ast.expr = ast.Compare(lefts[0], node.ops[:1], node.comparators[:1])
        for left, operator, right in zip(lefts[1:], node.ops[1:], node.comparators[1:], strict=True):
            result = call("logical_and", result, ast.Compare(left, [operator], [right]))
        return result

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not (isinstance(node.op, ast.Pow) and isinstance(node.right, ast.Constant)):
            return node
        square = call("square", node.left)
        simple = {1: node.left, 2: square, 3: ast.BinOp(square, ast.Mult(), node.left), 4: call("square", square),
                  0.5: call("sqrt", node.left), -1: ast.BinOp(ast.Constant(1.0), ast.Div(), node.left)}  # fmt: skip
        value = node.right.value
        return simple.get(value, node) if isinstance(value, (int, float)) else node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """Turn x += y into x = x + y: lanes cannot be changed in place."""
        if not isinstance(node.target, ast.Name):
            return self.generic_visit(node)
        value = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self.visit(value))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Nest min(a, b, c) and max(a, b, c): two at a time."""
        self.generic_visit(node)
        if not (isinstance(node.func, ast.Name) and node.func.id in ("min", "max") and len(node.args) > 2):
            return node
        result: ast.expr = node.args[0]
        for value in node.args[1:]:
            result = ast.Call(node.func, [result, value], [])
        return result
