"""Arithmetic on columns, as a mapping writes it: ``set_point - position_error``. Only the operators below, no code."""

import ast
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.source_table import SourceTable, numbers, single

OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "abs": (1, np.abs),
    "sign": (1, np.sign),
    "sqrt": (1, np.sqrt),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
"""Name -> number of arguments, and the function of arrays."""
ALLOWED = "numbers, columns (`in backticks` where their names have blanks), + - * / ** and " + ", ".join(FUNCTIONS)
LONGEST, MOST_PARTS = 300, 100
"""Letters of an expression, and its parts."""


def evaluated(table: SourceTable, text: str, where: str) -> tuple[np.ndarray, str]:
    """Return the value of an expression in each row, shape (rows,), and its unit.

    The unit is that of its columns if all have the same and nothing is multiplied or divided, else "".

    Args:
        table: The file's columns.
        text: The expression.
        where: Names the place in the mapping in errors.

    Raises:
        FormatError: If it is no arithmetic, or names a column that is not there.
    """
    quoted: list[str] = []

    def placeholder(match: re.Match[str]) -> str:
        quoted.append(match[1])
        return f"_column_{len(quoted) - 1}"

    try:
        # Cut before it is parsed: a long expression can exhaust the parser itself.
        tree = ast.parse(re.sub(r"`([^`]+)`", placeholder, text[: LONGEST + 1]).strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise _refusal(text, where) from None
    if len(text) > LONGEST or sum(1 for _ in ast.walk(tree)) > MOST_PARTS:
        raise FormatError(f"{where}: an expression of {len(text)} letters", f"{LONGEST} letters", "shorten it")
    units: set[str] = set()
    kinds: set[type[ast.operator]] = set()

    def value(node: ast.AST) -> Any:
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
            return float(node.value)
        if isinstance(node, ast.Name):
            name = quoted[int(node.id[8:])] if re.fullmatch(r"_column_\d+", node.id) else node.id
            column = single(table, name, where)
            units.add(table.units.get(column, ""))
            return numbers(table, [column], [], where)[:, 0]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return -value(node.operand) if isinstance(node.op, ast.USub) else value(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            kinds.add(type(node.op))
            return OPERATORS[type(node.op)](value(node.left), value(node.right))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            count, function = FUNCTIONS.get(node.func.id, (-1, np.abs))
            if count == len(node.args):
                return function(*(value(argument) for argument in node.args))
        raise _refusal(text, where)

    with np.errstate(all="ignore"):
        result = np.broadcast_to(np.asarray(value(tree.body), dtype=float), (table.rows,)).copy()
    # A division by zero is a missing value, and no reading of infinity.
    result[~np.isfinite(result)] = np.nan
    plain = len(units) == 1 and not kinds - {ast.Add, ast.Sub}
    return result, units.pop() if plain else ""


def _refusal(text: str, where: str) -> FormatError:
    return FormatError(f"{where}: {text[:80]!r} is no arithmetic of columns", ALLOWED, "correct the expression")


def with_derived(table: SourceTable, derived: dict[str, str], where: str) -> SourceTable:
    """Return a table with further columns, each by an expression of those before it."""
    for name, text in derived.items():
        values, unit = evaluated(table, text, f"{where}: {name}")
        table = replace(
            table, columns={**table.columns, name: values}, units={**table.units, **({name: unit} if unit else {})}
        )
    return table
