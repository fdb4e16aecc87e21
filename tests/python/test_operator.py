"""The operator's script, protocol/python/skein_operator.py, with flying swarms.

usage: SKEIN_SIM=target/release/skein-sim python3 test_operator.py

In one flight the script lists the vehicles, watches them, and holds them in the air for four seconds; in another one it
has them land. Exit code 0 if all of that worked, 1 if not, 2 on wrong usage.
"""

import json
import math
import subprocess
import sys

import harness
from harness import Program, expect, wait_until

try:
    import google.protobuf  # noqa: F401
    import grpc_tools  # noqa: F401
    import zenoh  # noqa: F401
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install -r protocol/python/requirements.txt)")
    sys.exit(0)

VEHICLES = ["uav/1", "uav/2", "uav/3", "uav/4"]
MOVING_M_S, STANDING_M_S = 1.0, 0.3
HOLD_S = 4.0
# From the last acknowledgement until everybody has come to a stop.
STOPPING_S = 2.0


class Watcher:
    """What the vehicles say of themselves."""

    def __init__(self, swarm):
        self.swarm = swarm
        self.states = {}

    def look(self):
        heard = self.swarm.hear(0.02)
        if heard:
            node, state = heard
            self.states[node] = state

    def wait_until(self, what, timeout_s, condition):
        return wait_until(what, timeout_s, condition, self.look)

    def speed(self, node):
        velocity = self.states[node].velocity
        return math.hypot(velocity.x, velocity.y, velocity.z)

    def under_way(self):
        """Those that fly by themselves towards a waypoint."""
        flies = lambda state: state.mode == "offboard" and state.task.startswith("leg")
        return [node for node, state in self.states.items() if flies(state)]

    def moving(self):
        return [node for node in self.under_way() if self.speed(node) > MOVING_M_S]


def script(*arguments):
    """The script, run to its end."""
    command = [sys.executable, str(harness.OPERATOR), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=20)


def running_script(folder, name, *arguments):
    return Program(folder, name, sys.executable, harness.OPERATOR, *arguments)


def flight(folder, offset, *options):
    fixed = ["--headless", "--json", "--out", folder / "run", "--port-offset", offset, "--console", "127.0.0.1:0"]
    return Program(folder, "fly", harness.binary(), "fly", "open", *fixed, *options)


def check_usage():
    for wrong in (["dance"], ["hold", "--seconds", "-1"], ["land"], ["land", "3"], ["list", "--fleet", "a/b"]):
        ended = script(*wrong)
        expect(ended.returncode == 2, f"{wrong} ends with {ended.returncode}, expected 2")
    elsewhere = script("list", "--connect", "tcp/192.0.2.1:7447")
    expect(elsewhere.returncode == 2, "another computer is spoken to without certificates")


def check_list(connect):
    def listed():
        ended = script("list", "--json", *connect)
        return ended if ended.returncode == 0 and len(json.loads(ended.stdout)["vehicles"]) == len(VEHICLES) else None

    rows = json.loads(wait_until("all vehicles in the list", 20, listed).stdout)["vehicles"]
    expect([row["vehicle"] for row in rows] == VEHICLES, f"the list has {rows}")
    expect(all(0.5 < row["battery"] <= 1 and row["mode"] and row["task"] for row in rows), f"the list has {rows}")
    table = script("list", *connect)
    expect(table.returncode == 0 and all(node in table.stdout for node in VEHICLES), f"the table is {table.stdout}")


def check_roster(connect):
    """Joint events get a new roster: everybody takes it, the station too."""
    ordered = script("roster", "--term", 2, "--coordinator", "ground/main", "--json", *VEHICLES, *connect)
    expect(ordered.returncode == 0, f"the roster ended with {ordered.returncode}: {ordered.stderr}")
    taken = {line["vehicle"] for line in map(json.loads, ordered.stdout.splitlines()) if line["taken"]}
    expect(taken == {"ground/main", *VEHICLES}, f"the roster was taken by {taken}")


def check_takeoffs(watch):
    """Every take-off was watched, and the ground station requested it."""
    takeoffs = {line["event"]: line for line in watch.json_lines() if line["event"].endswith("/takeoff")}
    for node in VEHICLES:
        requested_by = takeoffs.get(f"{node}/takeoff", {}).get("requested_by", [])
        by_ground = any(who.startswith("ground/main#") for who in requested_by)
        expect(by_ground, f"the take-off of {node} was requested by {requested_by}")


def check_hold(folder, connect, watcher):
    """All acknowledge; those who fly stop until the hold is lifted, and then go on."""
    watcher.wait_until("three vehicles under way", 60, lambda: len(watcher.moving()) >= 3)
    with running_script(folder, "hold", "hold", "--seconds", HOLD_S, "--json", *connect) as hold:
        said = lambda: {line["vehicle"] for line in hold.json_lines() if line.get("hold") == "acknowledged"}
        watcher.wait_until("everybody's acknowledgement", HOLD_S, lambda: said() == set(VEHICLES))
        began_s = watcher.swarm.now_s()
        held = watcher.under_way()
        expect(len(held) >= 2, f"only {held} are under way when they are held")
        watcher.wait_until("coming to a stop", HOLD_S, lambda: watcher.swarm.now_s() > began_s + STOPPING_S)
        stood = 0
        while not hold.has_ended():
            watcher.look()
            if "lifting" in hold.json_lines()[-1] or "lifted" in hold.json_lines()[-1]:
                break
            for node in held:
                speed, waiting_for = watcher.speed(node), watcher.states[node].waiting_for
                expect(speed < STANDING_M_S, f"{node} moves at {speed:.2f} m/s while it is held")
                expect("script/operator#hold" in waiting_for, f"{node} waits for {waiting_for!r} while it is held")
            stood += 1
        expect(stood > 10, "the hold ended before anything was to be seen of it")
        expect(hold.exit_code(5) == 0, "the hold ended with a fault")
        last = hold.json_lines()[-1]
        expect(last == {"lifted": VEHICLES, "missing": []}, f"the hold ended with {last}")
    watcher.wait_until("going on", 5, lambda: set(held) <= set(watcher.moving()))
    print(f"held: {', '.join(held)} stood")


def check_interrupted_hold(folder, connect):
    """Ctrl-C lifts it."""
    with running_script(folder, "hold-2", "hold", "--json", *connect) as hold:
        wait_until("acknowledgements", 5, lambda: len(hold.json_lines()) >= len(VEHICLES))
        hold.interrupt()
        expect(hold.exit_code(5) == 0, "the hold ended with a fault after Ctrl-C")
        expect(hold.json_lines()[-1].get("lifted") == VEHICLES, f"the hold was lifted at {hold.json_lines()[-1]}")
        expect(not hold.complained(), f"the script complained: {hold.complained()}")


def check_flight(folder, operator):
    offset = harness.free_port_offset(len(VEHICLES))
    connect = ["--connect", f"tcp/127.0.0.1:{7447 + offset}"]
    with flight(folder, offset) as fly, running_script(folder, "watch", "watch", "--json", *connect) as watch:
        check_list(connect)
        check_roster(connect)
        with operator.Swarm("sim", connect[1], ["state/*/*"]) as swarm:
            watcher = Watcher(swarm)
            check_hold(folder, connect, watcher)
            check_interrupted_hold(folder, connect)
            watcher.wait_until("the end of the flight", 60, fly.has_ended)
        expect(fly.exit_code(0) == 0, "the flight failed")
        check_takeoffs(watch)
        watch.interrupt()
        expect(watch.exit_code(5) == 0 and not watch.complained(), "the watch did not end well")
    gone = script("list", *connect)
    expect(gone.returncode == 1 and "no vehicle" in gone.stderr, f"with nobody there, `list` says {gone.stderr!r}")


def check_orders(folder, operator):
    offset = harness.free_port_offset(2)
    connect = ["--connect", f"tcp/127.0.0.1:{7447 + offset}"]
    with flight(folder, offset, "--vehicles", "2") as fly:
        with operator.Swarm("sim", connect[1], ["state/*/*"]) as swarm:
            watcher = Watcher(swarm)
            watcher.wait_until("two vehicles under way", 60, lambda: len(watcher.moving()) == 2)
            for what, node, begins in (("return", "uav/1", "returning"), ("land", "all", "landing")):
                ordered = script(what, node, *connect)
                expect(ordered.returncode == 0, f"the order to {what} ended with {ordered}")
                for node in ["uav/1", "uav/2"] if node == "all" else [node]:
                    follows = lambda: watcher.states[node].task.startswith((begins, "flying home"))
                    watcher.wait_until(f"{node} obeys: {what}", 3, follows)
            watcher.wait_until("the end of the flight", 30, fly.has_ended)
        expect(fly.exit_code(0) == 1, "a mission that was called off counts as done")
    print("ordered to return and to land")


def check(folder):
    operator = harness.load_operator(folder)
    check_usage()
    for part in (check_flight, check_orders):
        own = folder / part.__name__
        own.mkdir()
        part(own, operator)


if __name__ == "__main__":
    sys.exit(harness.main(check))
