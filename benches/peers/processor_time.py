"""Processor time of one thread, of calls and of whole programs."""
import json
import os
import resource
import subprocess
import sys

# Read by the libraries when they are loaded: import this module before any of them.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


def used(who=resource.RUSAGE_SELF):
    """User and system seconds so far."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def best_of(rounds, call):
    """Least processor seconds of some calls, and what the last one gave."""
    seconds = []
    for _ in range(rounds):
        start = used()
        result = call()
        seconds.append(used() - start)
    return min(seconds), result


def of_program(command, **options):
    """Processor seconds of one run of a program, and its output."""
    start = used(resource.RUSAGE_CHILDREN)
    output = subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE, **options).stdout
    return used(resource.RUSAGE_CHILDREN) - start, output


def report(what, seconds, **more):
    print(json.dumps({"what": what, "processor_s": round(seconds, 4), **more}), flush=True)


def each_in_its_own_process(cases):
    """Runs the case that the last argument names, or all, each in a process of its own, with the arguments before it."""
    *arguments, last = sys.argv[1:] or sys.exit(sys.modules["__main__"].__doc__)
    if last in cases:
        return cases[last](*arguments)
    for name in cases:
        subprocess.run([sys.executable, sys.argv[0], *sys.argv[1:], name], check=True)
