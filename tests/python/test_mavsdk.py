"""MAVSDK attaches to a flying vehicle and reads its telemetry.

usage: SKEIN_SIM=target/release/skein-sim python3 test_mavsdk.py

Starts `skein-sim fly open --vehicles 1` and listens where QGroundControl would: finds the autopilot, reads position,
battery, flight mode, version and parameters, has the rate of a stream raised, and has the vehicle land, with which the
flight ends. Exit code 0 if all of that worked, 1 if not, 2 on wrong usage.
"""

import math
import sys

import harness
from harness import Program, expect, wait_until

try:
    from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
    from mavsdk.autopilot import Autopilot
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.info import Info
    from mavsdk.plugins.param import Param
    from mavsdk.plugins.telemetry import FlightMode, Telemetry
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install mavsdk)")
    sys.exit(0)
except OSError as missing:
    print(f"skipped: needs MAVSDK's own library: {missing}")
    sys.exit(0)

# Of the scenario's world.
LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M = 47.397742, 8.545594, 488.0
DEGREES_PER_M = 1 / 111_000
HALF_WIDTH_M = 25
FASTER_HZ = 10.0


class Readings:
    """The newest of each kind, and how many came."""

    def __init__(self, telemetry):
        self.newest, self.count = {}, {}
        for kind in ("position", "battery", "flight_mode", "in_air"):
            getattr(telemetry, f"subscribe_{kind}")(lambda value, _, kind=kind: self._note(kind, value))

    def _note(self, kind, value):
        self.newest[kind] = value
        self.count[kind] = self.count.get(kind, 0) + 1

    def await_(self, kind, timeout_s, wanted):
        wait_until(kind, timeout_s, lambda: kind in self.newest and wanted(self.newest[kind]))
        return self.newest[kind]


def check_telemetry(readings):
    # Anything but what the agent flies in would be a pilot's.
    readings.await_("flight_mode", 30, lambda mode: mode == FlightMode.OFFBOARD)
    position = readings.await_("position", 10, lambda position: position.relative_altitude_m > 2)
    off_m = max(abs(position.latitude_deg - LATITUDE_DEG), abs(position.longitude_deg - LONGITUDE_DEG)) / DEGREES_PER_M
    expect(off_m < HALF_WIDTH_M, f"the position is {position}")
    expect(abs(position.absolute_altitude_m - HEIGHT_M - position.relative_altitude_m) < 1, f"the position is {position}")
    battery = readings.await_("battery", 5, lambda battery: battery.remaining_percent > 50)
    expect(12 < battery.voltage_v < 18 and battery.remaining_percent <= 100, f"the battery is {battery}")
    expect(readings.await_("in_air", 5, bool), "it flies on the ground")
    print(f"flies at {position.relative_altitude_m:.1f} m, battery {battery.remaining_percent:.0f} %")


def check_services(system, telemetry, readings):
    """What MAVSDK asks for and waits for the answer."""
    version = Info(system).get_version()
    expect((version.flight_sw_major, version.flight_sw_minor) == (1, 13), f"the version is {version}")
    parameters = Param(system)
    speed = parameters.get_param_float("MPC_XY_VEL_MAX")
    expect(speed > 0 and math.isfinite(speed), f"MPC_XY_VEL_MAX is {speed}")
    names = [parameter.name for parameter in parameters.get_all_params().float_params]
    expect("RTL_RETURN_ALT" in names, f"the parameters are {names}")
    telemetry.set_rate_position(FASTER_HZ)
    before = readings.count["position"]
    wait_until("ten more positions", 1.5, lambda: readings.count["position"] >= before + FASTER_HZ)


def check(folder):
    offset = harness.free_port_offset(1)
    options = ["--vehicles", "1", "--headless", "--out", folder, "--port-offset", offset, "--console", "127.0.0.1:0"]
    with Program(folder, "fly", harness.binary(), "fly", "open", *options) as fly:
        with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
            added = mavsdk.add_any_connection(f"udpin://127.0.0.1:{harness.GROUND_STATION_PORT + offset}")
            expect(added == ConnectionResult.SUCCESS, f"MAVSDK cannot listen: {added}")
            system = wait_until("an autopilot", 20, lambda: mavsdk.first_autopilot(1.0))
            expect(system.get_system_id() == 1, f"the system id is {system.get_system_id()}")
            expect(system.autopilot_type() == Autopilot.PX4, f"the autopilot is {system.autopilot_type()}")
            telemetry = Telemetry(system)
            readings = Readings(telemetry)
            check_telemetry(readings)
            check_services(system, telemetry, readings)
            Action(system).land()
            readings.await_("flight_mode", 3, lambda mode: mode == FlightMode.LAND)
            readings.await_("in_air", 20, lambda in_air: not in_air)
            print("landed by MAVSDK")
        fly.interrupt()
        expect(fly.exit_code(10) == 1, "a mission that a pilot ended counts as done")


if __name__ == "__main__":
    sys.exit(harness.main(check))
