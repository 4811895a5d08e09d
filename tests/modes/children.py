"""A run in a child process: prints the results, or the name and text of the error, as JSON.

Usage: python children.py METHOD RUN BEFORE with a method of multiprocessing, a run of `whole_runs`, and "run" where the
parent runs it too, before the child is started.
"""

import json
import multiprocessing
import sys

import whole_runs

ANSWER_WITHIN = 120.0


def run(name, answers):
    try:
        answers.put(whole_runs.found(whole_runs.RUNS[name]()))
    except Exception as error:
        answers.put({"error": type(error).__name__, "text": str(error)})


if __name__ == "__main__":
    method, name, before = sys.argv[1:]
    own = whole_runs.found(whole_runs.RUNS[name]()) if before == "run" else None
    context = multiprocessing.get_context(method)
    answers = context.SimpleQueue()
    child = context.Process(target=run, args=(name, answers))
    child.start()
    child.join(ANSWER_WITHIN)
    print(json.dumps({"code": child.exitcode, "child": None if answers.empty() else answers.get(), "parent": own}))
    child.kill()
