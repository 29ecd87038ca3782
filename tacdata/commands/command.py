"""What a verb's file holds. Copy this shape; no other file needs to change.

A module in this folder named ``my_verb.py`` becomes ``tacdata my-verb``. It holds

- ``ORDER``: its place in ``tacdata --help`` (record 10, check 20, label 30, pack 40, train 50, evaluate 60, view 70;
  tools around the pipeline from 100 on);
- ``PANEL``: ``PIPELINE`` or ``TOOLS``, the heading it stands under;
- ``run(...)``: a Typer command. Its docstring's first line is what ``--help`` shows. Heavy imports stay inside it.
  Bad input raises a `tacdata.errors.TacdataError`; the command line prints it and exits with its code.

A verb joins rooms and prints; if it grows logic, a room is missing a function.
"""

PIPELINE = "The pipeline, in order"
TOOLS = "Around it"
