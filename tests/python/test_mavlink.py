"""Flies a simulated vehicle with pymavlink, as anybody's ground station or script would.

usage: SKEIN_SIM=target/release/skein-sim python3 test_mavlink.py

Starts `skein-sim serve open --vehicles 1`, reads the parameters, uploads a mission and reads it back, arms, takes off,
flies to a point with offboard set-points, and lands. Exit code 0 if all of that worked, 1 if not, 2 on wrong usage.
Needs UDP ports 14540 and 14580 of this host.
"""

import math
import os
import subprocess
import sys
import time

os.environ["MAVLINK20"] = "1"
try:
    from pymavlink import mavutil
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install pymavlink)")
    sys.exit(0)

mavlink = mavutil.mavlink

TAKEOFF_HEIGHT_M = 3.0
GOAL_NORTH_M, GOAL_EAST_M = 4.0, 3.0
ARRIVED_WITHIN_M = 0.4
SET_POINT_INTERVAL_S = 0.05
OFFBOARD_MAIN_MODE = 6
POSITION_AND_YAW_ONLY = 0b0000_1001_1111_1000


class Failure(Exception):
    """What did not work."""


class Vehicle:
    """The autopilot at the other end of the link."""

    def __init__(self):
        self.link = mavutil.mavlink_connection("udpin:127.0.0.1:14540", source_system=255, source_component=190)
        heartbeat = self.link.wait_heartbeat(timeout=30)
        if heartbeat is None:
            raise Failure("no heartbeat on UDP port 14540 within 30 s")
        if heartbeat.autopilot != mavlink.MAV_AUTOPILOT_PX4:
            raise Failure(f"the heartbeat names autopilot {heartbeat.autopilot}, expected PX4 ({mavlink.MAV_AUTOPILOT_PX4})")
        self.target = (self.link.target_system, self.link.target_component)

    def wait_for(self, kind, what, timeout_s, wanted=lambda message: True, meanwhile=lambda: None):
        """The next message of that kind that is wanted; texts are shown on the way."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            meanwhile()
            message = self.link.recv_match(type=[kind, "STATUSTEXT"], blocking=True, timeout=SET_POINT_INTERVAL_S)
            if message is None:
                continue
            if message.get_type() == "STATUSTEXT":
                print(f"  autopilot: {message.text}")
            if message.get_type() == kind and wanted(message):
                return message
        raise Failure(f"{what}: did not happen within {timeout_s} s")

    def command(self, number, *params):
        """Gives a command and insists on its acceptance, repeating it with the confirmation counter."""
        name = mavlink.enums["MAV_CMD"][number].name
        params = list(params) + [0.0] * (7 - len(params))
        for confirmation in range(3):
            self.link.mav.command_long_send(*self.target, number, confirmation, *params)
            try:
                ack = self.wait_for("COMMAND_ACK", name, 2, lambda ack: ack.command == number)
            except Failure:
                continue
            if ack.result != mavlink.MAV_RESULT_ACCEPTED:
                raise Failure(f"{name}: {mavlink.enums['MAV_RESULT'][ack.result].name}")
            return
        raise Failure(f"{name}: no acknowledgement")


def check_parameters(vehicle):
    """The whole list comes, and one set by name comes back."""
    vehicle.link.mav.param_request_list_send(*vehicle.target)
    found = {}

    def is_last(value):
        found[value.param_id] = value.param_value
        return len(found) == value.param_count

    vehicle.wait_for("PARAM_VALUE", "the list of parameters", 10, is_last)
    for name in ("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "MPC_XY_VEL_MAX", "RTL_RETURN_ALT"):
        if name not in found:
            raise Failure(f"parameter {name} is not in the list of {len(found)}")
    wish = 7.5
    vehicle.link.mav.param_set_send(*vehicle.target, b"RTL_RETURN_ALT", wish, mavlink.MAV_PARAM_TYPE_REAL32)
    vehicle.wait_for(
        "PARAM_VALUE",
        "setting RTL_RETURN_ALT",
        3,
        lambda value: value.param_id == "RTL_RETURN_ALT" and value.param_value == wish,
    )
    print(f"parameters: {len(found)} listed, one set")


def check_mission(vehicle):
    """A mission is taken in item by item and read back unchanged."""
    latitude_e7, longitude_e7 = 473977420, 85455940
    send = vehicle.link.mav
    route = [(latitude_e7 + 500 * index, longitude_e7 - 300 * index, 5.0 + index) for index in range(4)]

    def send_item(seq):
        x, y, z = route[seq]
        send.mission_item_int_send(
            *vehicle.target,
            seq,
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            mavlink.MAV_CMD_NAV_WAYPOINT,
            0,
            1,
            float(seq),
            0.5,
            0.0,
            0.0,
            x,
            y,
            z,
        )

    send.mission_count_send(*vehicle.target, len(route))
    for _ in route:
        send_item(vehicle.wait_for("MISSION_REQUEST_INT", "the request of a mission item", 5).seq)
    ack = vehicle.wait_for("MISSION_ACK", "the acknowledgement of the mission", 5)
    if ack.type != mavlink.MAV_MISSION_ACCEPTED:
        raise Failure(f"the mission was refused: {mavlink.enums['MAV_MISSION_RESULT'][ack.type].name}")

    send.mission_request_list_send(*vehicle.target)
    count = vehicle.wait_for("MISSION_COUNT", "the length of the mission", 5).count
    if count != len(route):
        raise Failure(f"the mission has {count} items, expected {len(route)}")
    for seq, (x, y, z) in enumerate(route):
        send.mission_request_int_send(*vehicle.target, seq)
        item = vehicle.wait_for("MISSION_ITEM_INT", f"mission item {seq}", 5, lambda item: item.seq == seq)
        if (item.x, item.y, item.z, item.param1) != (x, y, z, float(seq)):
            raise Failure(f"mission item {seq} came back as {item}, expected {(x, y, z)}")
    send.mission_ack_send(*vehicle.target, mavlink.MAV_MISSION_ACCEPTED)
    print(f"mission: {count} items uploaded and read back")


def take_off(vehicle):
    """Arms as soon as the autopilot is ready and climbs."""
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    vehicle.wait_for(
        "SYS_STATUS",
        "ready to arm",
        30,
        lambda status: status.onboard_control_sensors_health & ready,
    )
    vehicle.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    home = vehicle.wait_for("HOME_POSITION", "home", 5)
    vehicle.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    nan = math.nan
    height_m = home.altitude * 1e-3 + TAKEOFF_HEIGHT_M
    vehicle.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, height_m)
    vehicle.wait_for(
        "GLOBAL_POSITION_INT",
        f"climb to {TAKEOFF_HEIGHT_M} m",
        20,
        lambda position: position.relative_alt > 900 * TAKEOFF_HEIGHT_M,
    )
    print(f"took off to {TAKEOFF_HEIGHT_M} m")


def fly_offboard(vehicle):
    """Streams position set-points, enters offboard, and waits for the arrival."""
    start = vehicle.wait_for("LOCAL_POSITION_NED", "position", 5)
    goal = (start.x + GOAL_NORTH_M, start.y + GOAL_EAST_M, start.z)
    next_set_point = time.monotonic()

    def send_set_point():
        nonlocal next_set_point
        if time.monotonic() >= next_set_point:
            next_set_point = time.monotonic() + SET_POINT_INTERVAL_S
            vehicle.link.mav.set_position_target_local_ned_send(
                0,
                *vehicle.target,
                mavlink.MAV_FRAME_LOCAL_NED,
                POSITION_AND_YAW_ONLY,
                *goal,
                *(0.0,) * 6,
                math.pi / 2,
                0.0,
            )

    end_of_prelude = time.monotonic() + 1.0
    vehicle.wait_for(
        "LOCAL_POSITION_NED", "prelude", 5, lambda _: time.monotonic() > end_of_prelude, send_set_point
    )
    vehicle.command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, OFFBOARD_MAIN_MODE)
    vehicle.wait_for(
        "HEARTBEAT",
        "offboard mode",
        3,
        lambda heartbeat: heartbeat.custom_mode >> 16 & 0xFF == OFFBOARD_MAIN_MODE,
        send_set_point,
    )
    vehicle.wait_for(
        "LOCAL_POSITION_NED",
        f"arrival at {goal}",
        30,
        lambda position: math.dist((position.x, position.y, position.z), goal) < ARRIVED_WITHIN_M,
        send_set_point,
    )
    vehicle.wait_for(
        "ATTITUDE", "nose to the east", 15, lambda attitude: abs(attitude.yaw - math.pi / 2) < 0.1, send_set_point
    )
    print(f"flew offboard to {GOAL_NORTH_M} m north, {GOAL_EAST_M} m east")


def land(vehicle):
    """Lands and waits until the motors have stopped."""
    vehicle.command(mavlink.MAV_CMD_NAV_LAND)
    vehicle.wait_for(
        "EXTENDED_SYS_STATE",
        "touchdown",
        30,
        lambda state: state.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND,
    )
    vehicle.wait_for(
        "HEARTBEAT",
        "disarming",
        10,
        lambda heartbeat: not heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
    )
    print("landed and disarmed")


def main():
    """Runs the whole flight against a simulator of its own."""
    binary = os.environ.get("SKEIN_SIM")
    if not binary or not os.access(binary, os.X_OK):
        print(f"usage: SKEIN_SIM=path/to/skein-sim {sys.argv[0]} (SKEIN_SIM is {binary!r}, not a program)", file=sys.stderr)
        return 2
    simulator = subprocess.Popen([binary, "serve", "open", "--vehicles", "1"], stdout=subprocess.DEVNULL)
    try:
        vehicle = Vehicle()
        check_parameters(vehicle)
        check_mission(vehicle)
        take_off(vehicle)
        fly_offboard(vehicle)
        land(vehicle)
    except Failure as failure:
        ended = simulator.poll()
        print(f"FAILED: {failure}" + (f" (the simulator ended with code {ended})" if ended is not None else ""))
        return 1
    finally:
        simulator.terminate()
        simulator.wait()
    print("passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
