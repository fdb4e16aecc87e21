"""The b-programs of `skein-lab bench bp`, run by BPpy (https://pypi.org/project/bppy).

Reads from the command line how many times each is run and for how many CPU seconds, and prints as JSON the events per
CPU second of each time. Events are made once, which is the fastest BPpy can have it.
"""

import json
import sys
import time

import bppy as bp

BATCH = 10  # events between two looks at the clock
HOT, COLD, TICK = bp.BEvent("hot"), bp.BEvent("cold"), bp.BEvent("tick")


@bp.thread
def requester(event):
    while True:
        yield bp.sync(request=event)


@bp.thread
def alternator():
    while True:
        yield bp.sync(waitFor=COLD, block=HOT)
        yield bp.sync(waitFor=HOT, block=COLD)


@bp.thread
def waiter(event):
    while True:
        yield bp.sync(waitFor=event)


def hot_cold(idle):
    taps = [requester(HOT), requester(COLD), alternator()]
    return taps + [waiter(bp.BEvent(f"never/{n}")) for n in range(idle)]


def woken(waiters):
    return [requester(TICK)] + [waiter(TICK) for _ in range(waiters)]


PROGRAMS = {
    "hot_cold": lambda: hot_cold(0),
    "idle_100": lambda: hot_cold(100),
    "idle_1000": lambda: hot_cold(1000),
    "woken_1000": lambda: woken(1000),
}


def events_per_s(bthreads, seconds):
    """What BPpy's own `run` does, without its listener, until the time is over."""
    program = bp.BProgram(bthreads=bthreads, event_selection_strategy=bp.SimpleEventSelectionStrategy())
    program.setup()
    events, since, cpu_s = 0, time.process_time(), 0.0
    while cpu_s < seconds:
        for _ in range(BATCH):
            program.advance_bthreads(program.tickets, program.next_event())
        events, cpu_s = events + BATCH, time.process_time() - since
    return events / cpu_s


repetitions, seconds = int(sys.argv[1]), float(sys.argv[2])
measured = {name: [] for name in PROGRAMS}
for _ in range(repetitions):
    for name, bthreads in PROGRAMS.items():
        measured[name].append(events_per_s(bthreads(), seconds))
print(json.dumps(measured))
