"""Two stock ground stations at one simulated autopilot, with pymavlink.

usage: SKEIN_SIM=target/release/skein-sim python3 test_stations.py

Starts `skein-sim serve open --vehicles 1`. Each of two stations uploads a mission, a geofence and rally points, reads them
back and clears them, one after the other and both at once; whoever is told "accepted" finds its own list there. Sets
parameters of both types and reads them back. Every command is acknowledged, whoever's it is. Exit code 0 if all of that
worked, 1 if not, 2 on wrong usage.
"""

import os
import sys
import threading

import harness
from harness import Failure, Program, expect

os.environ["MAVLINK20"] = "1"
try:
    from pymavlink import mavutil
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install pymavlink)")
    sys.exit(0)

mav = mavutil.mavlink
LATITUDE_E7, LONGITUDE_E7 = 473977420, 85455940
STEP_E7 = 900
ACCEPTED, UNSUPPORTED, DENIED = mav.MAV_MISSION_ACCEPTED, mav.MAV_MISSION_UNSUPPORTED, mav.MAV_MISSION_DENIED
LISTS = {
    mav.MAV_MISSION_TYPE_MISSION: (mav.MAV_CMD_NAV_WAYPOINT, 0.0, 5),
    mav.MAV_MISSION_TYPE_FENCE: (mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 4.0, 4),
    mav.MAV_MISSION_TYPE_RALLY: (mav.MAV_CMD_NAV_RALLY_POINT, 0.0, 2),
}


class Station:
    """A ground station with a link of its own."""

    def __init__(self, number, port):
        self.number = number
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=number, source_component=190)
        self.link.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        expect(self.link.wait_heartbeat(timeout=10), "no heartbeat within 10 s")
        self.target = (self.link.target_system, 1)

    def hear(self, *kinds, timeout_s=5, wanted=lambda _: True):
        """The next message of these kinds that is for this station."""
        while message := self.link.recv_match(type=list(kinds), blocking=True, timeout=timeout_s):
            if getattr(message, "target_system", self.number) in (0, self.number) and wanted(message):
                return message
        raise Failure(f"station {self.number}: none of {kinds} within {timeout_s} s")

    def upload(self, kind):
        """Uploads the station's own list; gives the result that it is told."""
        command, first, count = LISTS[kind]
        self.link.mav.mission_count_send(*self.target, count, kind)
        while True:
            message = self.hear(
                "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK", wanted=lambda told: told.mission_type == kind
            )
            if message.get_type() == "MISSION_ACK":
                return message.type
            x, y = self.corner(message.seq)
            height, frame = (5.0, 3) if kind == mav.MAV_MISSION_TYPE_MISSION else (0.0, 0)
            self.link.mav.mission_item_int_send(
                *self.target, message.seq, frame, command, 0, 1, first, 0, 0, 0, x, y, height, kind
            )

    def corner(self, seq):
        """Corners of a square, of which each station has its own."""
        east, north = [(-1, -1), (1, -1), (1, 1), (-1, 1)][seq % 4]
        size = STEP_E7 * (self.number - 200)
        return LATITUDE_E7 + north * size, LONGITUDE_E7 + east * size

    def read_back(self, kind):
        """The places of the list that the vehicle has."""
        self.link.mav.mission_request_list_send(*self.target, kind)
        count = self.hear("MISSION_COUNT", wanted=lambda told: told.mission_type == kind).count
        places = []
        for seq in range(count):
            self.link.mav.mission_request_int_send(*self.target, seq, kind)
            item = self.hear("MISSION_ITEM_INT", wanted=lambda told: (told.mission_type, told.seq) == (kind, seq))
            places.append((item.x, item.y))
        self.link.mav.mission_ack_send(*self.target, ACCEPTED, kind)
        return places

    def own(self, kind):
        return [self.corner(seq) for seq in range(LISTS[kind][2])]

    def clear(self, kind):
        self.link.mav.mission_clear_all_send(*self.target, kind)
        return self.hear("MISSION_ACK", wanted=lambda told: told.mission_type == kind).type

    def set_parameter(self, name, value, kind):
        """The value that the parameter then has."""
        self.link.mav.param_set_send(*self.target, name.encode(), value, kind)
        return self.hear("PARAM_VALUE", wanted=lambda told: told.param_id == name).param_value

    def command(self, number):
        self.link.mav.command_long_send(*self.target, number, 0, *[0] * 7)
        return self.hear("COMMAND_ACK", wanted=lambda told: told.command == number).result


def check_lists(one, other):
    for kind in LISTS:
        for station in (one, other):
            expect(station.upload(kind) == ACCEPTED, f"list {kind} of station {station.number} is refused")
            for reader in (one, other):
                expect(reader.read_back(kind) == station.own(kind), f"list {kind} is not what {station.number} sent")
        expect(other.clear(kind) == ACCEPTED, f"list {kind} is not cleared")
        expect(one.read_back(kind) == [], f"list {kind} is still there")


def check_both_at_once(one, other):
    for kind in LISTS:
        results = {}

        def run(station, kind=kind):
            results[station.number] = station.upload(kind)

        threads = [threading.Thread(target=run, args=(station,)) for station in (one, other)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        expect(set(results) == {one.number, other.number}, f"list {kind}: a station was told nothing: {results}")
        expect(set(results.values()) <= {ACCEPTED, DENIED}, f"list {kind}: {results}")
        taken = [station for station in (one, other) if results[station.number] == ACCEPTED]
        expect(taken, f"list {kind}: nobody's upload was taken")
        found = one.read_back(kind)
        expect(any(found == station.own(kind) for station in taken), f"list {kind} is nobody's: {found}")
        one.clear(kind)


def check_refusals(one):
    kind = mav.MAV_MISSION_TYPE_FENCE
    one.upload(kind)
    LISTS[kind] = (mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 5.0, 4)
    expect(one.upload(kind) == UNSUPPORTED, "a polygon without its last corner is taken")
    expect(len(one.read_back(kind)) == 4, "the fence before it is gone")
    one.clear(kind)
    for number in (31010, 42428, 60000):
        expect(one.command(number) == mav.MAV_RESULT_UNSUPPORTED, f"command {number} is not called unsupported")


def check_parameters(one, other):
    real, whole = mav.MAV_PARAM_TYPE_REAL32, mav.MAV_PARAM_TYPE_INT32
    expect(one.set_parameter("RTL_RETURN_ALT", 12.5, real) == 12.5, "a real parameter is not set")
    bits = lambda number: mavutil.mavlink.struct.unpack("<f", number.to_bytes(4, "little"))[0]
    told = one.set_parameter("GF_ACTION", bits(3), whole)
    expect(mavutil.mavlink.struct.pack("<f", told) == (3).to_bytes(4, "little"), "a whole parameter is not set")
    expect(one.set_parameter("RTL_RETURN_ALT", 1e6, real) == 12.5, "a value out of range is taken")
    other.link.mav.param_request_read_send(*other.target, b"RTL_RETURN_ALT", -1)
    told = other.hear("PARAM_VALUE", wanted=lambda told: told.param_id == "RTL_RETURN_ALT")
    expect(told.param_value == 12.5, "the other station reads another value")


def check(folder):
    offset = harness.free_port_offset(1)
    port = harness.AUTOPILOT_PORTS[1] + offset
    serve = (harness.binary(), "serve", "open", "--vehicles", 1, "--port-offset", offset)
    with Program(folder, "serve", *serve) as world:
        harness.wait_until("the world is up", 30, lambda: "The world is up" in world.said())
        one, other = Station(250, port), Station(251, port)
        check_lists(one, other)
        check_both_at_once(one, other)
        check_refusals(one)
        check_parameters(one, other)


sys.exit(harness.main(check))
