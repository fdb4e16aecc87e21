"""A pilot takes a flying vehicle over with pymavlink, and its agent lets go of it.

usage: SKEIN_SIM=target/release/skein-sim python3 test_pilot.py

First with `fly`: telemetry of every vehicle is read where QGroundControl would, one vehicle is put on hold, and stays
so whatever the swarm does. Then with the world, the agent and the ground station as processes, and a relay between
agent and autopilot that sees each set-point: the last one leaves within 200 ms of the pilot's command. Exit code 0 if
all of that worked, 1 if not, 2 on wrong usage.
"""

import math
import os
import select
import socket
import sys
import threading
import time

import harness
from harness import Program, expect, wait_until

os.environ["MAVLINK20"] = "1"
try:
    import google.protobuf  # noqa: F401
    import grpc_tools  # noqa: F401
    import zenoh  # noqa: F401
    from pymavlink import mavutil
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install -r tests/python/requirements.txt)")
    sys.exit(0)

mavlink = mavutil.mavlink

LET_GO_S = 0.2
# How long it is watched that the agent does not take the vehicle back.
WATCH_S = 3.0
CUSTOM_MODE = 1
AUTO, AUTO_LOITER, AUTO_LAND = 4, 3, 6
HOLD, LAND, OFFBOARD = AUTO << 16 | AUTO_LOITER << 24, AUTO << 16 | AUTO_LAND << 24, 6 << 16
TELEMETRY = ("HEARTBEAT", "GLOBAL_POSITION_INT", "SYS_STATUS", "ATTITUDE", "BATTERY_STATUS", "EXTENDED_SYS_STATE")


class GroundStation:
    """Listens where ground stations do, and notes when each message came."""

    def __init__(self, offset):
        address = f"udpin:127.0.0.1:{harness.GROUND_STATION_PORT + offset}"
        self.link = mavutil.mavlink_connection(address, source_system=255, source_component=190)
        self.heard = []
        self._closing = False
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._closing = True
        self._thread.join()
        self.link.close()

    def _listen(self):
        while not self._closing:
            message = self.link.recv_match(blocking=True, timeout=0.1)
            if message is not None:
                self.heard.append((time.monotonic(), message))

    def all(self, kind, system, since=0.0):
        """Every message of a kind from a system, with when it came."""
        return [
            (at, message)
            for at, message in list(self.heard)
            if at >= since and message.get_type() == kind and message.get_srcSystem() == system
        ]

    def modes(self, system, since=0.0):
        return [heartbeat.custom_mode for _, heartbeat in self.all("HEARTBEAT", system, since)]

    def set_mode(self, system, main, sub):
        """Returns when the command was accepted."""
        began = time.monotonic()
        number = mavlink.MAV_CMD_DO_SET_MODE
        params = [CUSTOM_MODE, main, sub, 0, 0, 0, 0]
        self.link.mav.command_long_send(system, mavlink.MAV_COMP_ID_AUTOPILOT1, number, 0, *params)
        is_answer = lambda ack: ack.command == number
        acks = lambda: [(at, ack) for at, ack in self.all("COMMAND_ACK", system, began) if is_answer(ack)]
        at, ack = wait_until(f"answer of system {system} to DO_SET_MODE", 2, acks)[0]
        expect(ack.result == mavlink.MAV_RESULT_ACCEPTED, f"DO_SET_MODE is answered with {ack}")
        return at


class Relay:
    """Between an agent and its autopilot: passes everything on, and notes when each set-point left the agent."""

    def __init__(self, autopilot_port):
        self.set_points = []
        self._autopilot = ("127.0.0.1", autopilot_port)
        self._inner, self._outer = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for end in (self._inner, self._outer):
            end.bind(("127.0.0.1", 0))
        self.port = self._inner.getsockname()[1]
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._closing = False
        self._thread = threading.Thread(target=self._pass_on)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._closing = True
        self._thread.join()
        self._inner.close()
        self._outer.close()

    def _pass_on(self):
        agent = None
        while not self._closing:
            for end in select.select([self._inner, self._outer], [], [], 0.1)[0]:
                try:
                    datagram, sender = end.recvfrom(2048)
                    if end is self._inner:
                        agent = sender
                        self._note(datagram)
                        self._outer.sendto(datagram, self._autopilot)
                    elif agent:
                        self._inner.sendto(datagram, agent)
                except ConnectionRefusedError:
                    # The one or the other has not started yet.
                    pass

    def _note(self, datagram):
        at = time.monotonic()
        for message in self._parser.parse_buffer(datagram) or []:
            if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                self.set_points.append(at)


class Occurrences:
    """What has occurred in a swarm, with when it was heard of here."""

    def __init__(self, operator, offset):
        self.heard = []
        self._closing = False
        # The ground station, or all of `fly`; then the first agent of a swarm of processes.
        nodes = ",".join(f"tcp/127.0.0.1:{port + offset}" for port in (7447, 7450))
        self._swarm = operator.Swarm("sim", nodes, ["occ/*/*"])
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._closing = True
        self._thread.join()
        self._swarm.__exit__()

    def _listen(self):
        while not self._closing:
            heard = self._swarm.hear(0.1)
            if heard:
                self.heard.append((time.monotonic(), heard[1].event))

    def first(self, name, since=0.0):
        return next(((at, event) for at, event in list(self.heard) if at >= since and event.name == name), None)


def take_over(station, occurrences, system):
    """Puts a vehicle that flies its mission on hold; returns when that was acknowledged."""
    name = f"uav/{system}"
    wait_until(f"{name} under way", 60, lambda: occurrences.first(f"{name}/advance"))
    wait_until(f"{name} in offboard mode", 5, lambda: station.modes(system)[-1:] == [OFFBOARD])
    wait_until(f"{name} at speed", 10, lambda: speed(station, system) > 1.0)
    acked = station.set_mode(system, AUTO, AUTO_LOITER)
    heard, event = wait_until(f"{name}/pilot", 2, lambda: occurrences.first(f"{name}/pilot", acked - 1))
    took_ms = (heard - acked) * 1000
    expect(heard < acked + LET_GO_S, f"{name}/pilot was heard {took_ms:.0f} ms after the acknowledgement")
    expect(event.data["mode"].text == "hold", f"{name}/pilot says {event.data['mode'].text}")
    print(f"{name} has let go: heard of {took_ms:+.0f} ms after the acknowledgement")
    return acked


def expect_held(station, system, since):
    """From the pilot's command on the vehicle has been in no other mode."""
    modes = set(station.modes(system, since))
    expect(modes == {HOLD}, f"vehicle {system} was put on hold and then in modes {[hex(mode) for mode in modes]}")


def check_telemetry(station, system):
    for kind in TELEMETRY:
        wait_until(f"{kind} of system {system}", 15, lambda: station.all(kind, system))
    wait_until(f"system {system} in the air", 60, lambda: is_in_air(station, system))
    _, status = station.all("SYS_STATUS", system)[-1]
    expect(50 < status.battery_remaining <= 100, f"the battery of system {system} is at {status.battery_remaining} %")


def speed(station, system):
    position = station.all("GLOBAL_POSITION_INT", system)[-1][1]
    return math.hypot(position.vx, position.vy) / 100


def is_in_air(station, system):
    return station.all("EXTENDED_SYS_STATE", system)[-1][1].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR


def check_fly(folder, operator):
    offset = harness.free_port_offset(2)
    options = ["--vehicles", "2", "--headless", "--out", folder, "--port-offset", offset, "--console", "127.0.0.1:0"]
    with GroundStation(offset) as station:
        with Program(folder, "fly", harness.binary(), "fly", "open", *options) as fly:
            with Occurrences(operator, offset) as occurrences:
                for system in (1, 2):
                    check_telemetry(station, system)
                acked = take_over(station, occurrences, 1)
                wait_until("a while", WATCH_S + 1, lambda: time.monotonic() > acked + WATCH_S)
                # The swarm is called off: who has no pilot lands.
                fly.interrupt()
                wait_until("system 2 lands", 5, lambda: station.modes(2)[-1:] == [LAND])
                wait_until("words of system 1", 5, lambda: len(station.modes(1, acked)) >= WATCH_S)
                expect_held(station, 1, acked)
            fly.interrupt()
            expect(fly.exit_code(10) == 1, "a mission that was called off counts as done")


def check_set_points(folder, operator):
    offset = harness.free_port_offset(1)
    configuration = folder / "configuration"
    configure = ["configure", "open", "--vehicles", "1", "--out", configuration, "--port-offset", offset]
    with Program(folder, "configure", harness.binary(), *configure) as configuring:
        expect(configuring.exit_code(10) == 0, "the swarm cannot be configured")
    with GroundStation(offset) as station, Relay(harness.AUTOPILOT_PORTS[0] + offset) as relay:
        agent_file = configuration / "uav-1.toml"
        link = f"udp:127.0.0.1:{harness.COMPANION_PORT + offset}"
        text = agent_file.read_text()
        expect(link in text, f"{link} is not in the agent's configuration")
        agent_file.write_text(text.replace(link, f"udpout:127.0.0.1:{relay.port}"))
        serve = ["serve", "open", "--vehicles", "1", "--port-offset", offset, "--config", configuration / "world.toml"]
        run = ["run", "--config", agent_file]
        ground = ["serve", "--config", configuration / "ground.toml"]
        with (
            Program(folder, "world", harness.binary(), *serve),
            Program(folder, "agent", harness.binary("skein-agent"), *run) as agent,
            Program(folder, "ground", harness.binary("skein-ground"), *ground),
            Occurrences(operator, offset) as occurrences,
        ):
            acked = take_over(station, occurrences, 1)
            wait_until("a while", WATCH_S + 1, lambda: time.monotonic() > acked + WATCH_S)
            before = [at for at in relay.set_points if acked - 0.5 <= at < acked]
            last = max(relay.set_points)
            expect(len(before) >= 15, f"only {len(before)} set-points in the half second before the pilot's command")
            after_ms = (last - acked) * 1000
            expect(last <= acked + LET_GO_S, f"the last set-point left {after_ms:.0f} ms after the acknowledgement")
            expect_held(station, 1, acked)
            expect(not agent.has_ended(), "the agent has ended")
            print(f"{len(relay.set_points)} set-points, the last {after_ms:+.0f} ms after the acknowledgement")


def check(folder):
    for program in ("skein-agent", "skein-ground"):
        if not os.access(harness.binary(program), os.X_OK):
            print(f"skipped: needs {harness.binary(program)} (cargo build --workspace)")
            return
    operator = harness.load_operator(folder)
    for part in (check_fly, check_set_points):
        own = folder / part.__name__
        own.mkdir()
        part(own, operator)


if __name__ == "__main__":
    sys.exit(harness.main(check))
