"""A process that runs cases and tells what became of each, so that none takes the others along.

It reads lines ``class seed case`` and answers each with a line of JSON.
"""

from __future__ import annotations

import json
import os
import sys

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from .classes import CLASSES, make  # noqa: E402  (after the environment is set)
from .harness import EXAMPLES  # noqa: E402
from .judge import ACCEPTED, Verdict, judge, limit_memory, watch  # noqa: E402

# What has to be compiled or made once is no fault of a case.
FIRST = 600.0  # seconds


def serve() -> None:
    """Answer until the end of the input."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what a case prints is no answer
    watch()
    examples: dict[str, tuple[Verdict, str]] = {}
    for line in sys.stdin:
        name, seed, number = line.split()
        if name not in examples:
            examples[name] = _judge_examples(name)
            limit_memory()
        if int(number) == EXAMPLES:
            verdict, text = examples[name]
        else:
            case = make(name, int(seed), int(number))
            verdict, text = judge(case), case.text
        answers.write(json.dumps([verdict.word, verdict.detail, text]) + "\n")


def _judge_examples(name: str) -> tuple[Verdict, str]:
    """The first of a class's valid examples that is not accepted, if there is one."""
    told = [(judge(example, FIRST), example.text) for example in CLASSES[name].valid()]
    return next((one for one in told if one[0].word != ACCEPTED), told[0])


serve()
