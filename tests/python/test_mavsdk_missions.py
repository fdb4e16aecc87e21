"""MAVSDK uploads a mission, a geofence, rally points and parameters to a simulated autopilot, and reads them back.

usage: SKEIN_SIM=target/release/skein-sim python3 test_mavsdk_missions.py

Starts `skein-sim serve open --vehicles 1`. Exit code 0 if what is read back is what was sent, 1 if not, 2 on wrong usage.
"""

import sys

import harness
from harness import Program, expect, wait_until

try:
    from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
    from mavsdk.plugins.mission_raw import MissionItem, MissionRaw, MissionRawError
    from mavsdk.plugins.param import Param
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install mavsdk)")
    sys.exit(0)
except OSError as missing:
    print(f"skipped: needs MAVSDK's own library: {missing}")
    sys.exit(0)

LATITUDE_E7, LONGITUDE_E7 = 473977420, 85455940
WAYPOINT, CORNER, RALLY_POINT, NOBODYS = 16, 5001, 5100, 42702
MISSION, FENCE, RALLY = 0, 1, 2
CORNERS = [(-1, -1), (1, -1), (1, 1), (-1, 1)]


def items(command, kind, count, first=0.0, height_m=0.0):
    """A list around the place where the vehicle stands."""
    listed = []
    for seq in range(count):
        east, north = CORNERS[seq % 4]
        x, y = LATITUDE_E7 + north * 5000, LONGITUDE_E7 + east * 5000
        frame = 6 if kind == MISSION else 0
        current = int(kind == MISSION and seq == 0)
        listed.append(MissionItem(seq, frame, command, current, 1, first, 0.0, 0.0, 0.0, x, y, height_m, kind))
    return listed


def of(listed):
    return [(item.command, item.param1, item.x, item.y, item.z, item.mission_type) for item in listed]


def check_lists(raw):
    mission = items(WAYPOINT, MISSION, 6, first=2.0, height_m=5.0)
    fence, rally = items(CORNER, FENCE, 4, first=4.0), items(RALLY_POINT, RALLY, 2)
    raw.upload_mission(mission)
    raw.upload_geofence(fence)
    raw.upload_rally_points(rally)
    for sent, read in ((mission, raw.download_mission), (fence, raw.download_geofence), (rally, raw.download_rallypoints)):
        expect(of(read()) == of(sent), f"{read.__name__} gives {of(read())}")
    try:
        raw.upload_mission(items(NOBODYS, MISSION, 1, height_m=5.0))
        expect(False, "a command of nobody is taken")
    except MissionRawError as refused:
        print(f"refused as it must: {refused}")
    expect(of(raw.download_mission()) == of(mission), "the mission before it is gone")
    raw.clear_mission()
    expect(raw.download_mission() == [], "the mission is not cleared")


def check_parameters(parameters):
    parameters.set_param_float("RTL_RETURN_ALT", 12.5)
    parameters.set_param_int("GF_ACTION", 3)
    expect(parameters.get_param_float("RTL_RETURN_ALT") == 12.5, "a real parameter is not kept")
    expect(parameters.get_param_int("GF_ACTION") == 3, "a whole parameter is not kept")


def check(folder):
    offset = harness.free_port_offset(1)
    serve = (harness.binary(), "serve", "open", "--vehicles", 1, "--port-offset", offset)
    with Program(folder, "serve", *serve):
        with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
            added = mavsdk.add_any_connection(f"udpin://127.0.0.1:{harness.GROUND_STATION_PORT + offset}")
            expect(added == ConnectionResult.SUCCESS, f"MAVSDK cannot listen: {added}")
            system = wait_until("an autopilot", 20, lambda: mavsdk.first_autopilot(1.0))
            check_lists(MissionRaw(system))
            check_parameters(Param(system))


if __name__ == "__main__":
    sys.exit(harness.main(check))
