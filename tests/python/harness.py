"""What the tests beside this share: programs that end with the test, free ports, waiting with deadlines."""

import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHON_FOLDER = ROOT / "protocol" / "python"
OPERATOR = PYTHON_FOLDER / "skein_operator.py"

# Of every swarm, before --port-offset; a vehicle's ports follow the first vehicle's.
ZENOH_PORTS, VEHICLE_ZENOH_PORT = (7446, 7447), 7450
GROUND_STATION_PORT, COMPANION_PORT = 14550, 14540
CONSOLE_PORT = 8700
AUTOPILOT_PORTS = (14580, 18570)


class Failure(Exception):
    """What is not as it should be."""


def expect(condition, message):
    """Like assert, but not switched off by -O."""
    if not condition:
        raise Failure(message)


def wait_until(what, timeout_s, condition, meanwhile=lambda: time.sleep(0.02)):
    """The first value of `condition()` that counts as true."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        meanwhile()
    raise Failure(f"{what}: did not happen within {timeout_s} s")


def binary(name="skein-sim"):
    """A program of Skein's; all are built into one folder."""
    return Path(os.environ["SKEIN_SIM"]).resolve().with_name(name)


def free_port_offset(vehicles):
    """A --port-offset that leads to free ports only, below those that the system gives out by itself."""
    for offset in random.sample(range(300, 12_000, 50), 100):
        tcp = [port + offset for port in (*ZENOH_PORTS, CONSOLE_PORT)]
        tcp += [VEHICLE_ZENOH_PORT + offset + index for index in range(vehicles)]
        udp = [GROUND_STATION_PORT + offset]
        for first in (*AUTOPILOT_PORTS, COMPANION_PORT):
            udp += [first + offset + index for index in range(vehicles)]
        with contextlib.ExitStack() as bound:
            try:
                for kind, ports in ((socket.SOCK_STREAM, tcp), (socket.SOCK_DGRAM, udp)):
                    for port in ports:
                        bound.enter_context(socket.socket(socket.AF_INET, kind)).bind(("127.0.0.1", port))
            except OSError:
                continue
            return offset
    raise Failure("no free ports in a hundred tries")


class Program:
    """A process that is ended with its `with` block. What it says goes to files in `folder`."""

    def __init__(self, folder, name, *command):
        self.name = name
        self._out, self._errors = folder / f"{name}.out", folder / f"{name}.err"
        with open(self._out, "wb") as out, open(self._errors, "wb") as errors:
            self._process = subprocess.Popen([str(word) for word in command], stdout=out, stderr=errors)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            print(f"--- {self.name} said:\n{self.said()[-2000:]}{self.complained()[-2000:]}---")
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def said(self):
        return self._out.read_text()

    def complained(self):
        return self._errors.read_text()

    def json_lines(self):
        """What it has said, one object for each whole line."""
        return [json.loads(line) for line in self.said().splitlines(keepends=True) if line.endswith("\n")]

    def has_ended(self):
        return self._process.poll() is not None

    def interrupt(self):
        """Ctrl-C."""
        self._process.send_signal(signal.SIGINT)

    def exit_code(self, timeout_s):
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise Failure(f"{self.name} does not end within {timeout_s} s") from None


def load_operator(folder):
    """The operator's script as a module, with protobuf bindings made afresh, for processes of this test too."""
    protos = ROOT / "protocol" / "wire" / "proto"
    make = [sys.executable, "-m", "grpc_tools.protoc", f"--proto_path={protos}", f"--python_out={folder}", "skein.proto"]
    made = subprocess.run(make, capture_output=True, text=True)
    expect(made.returncode == 0, f"skein_pb2.py cannot be made: {made.stderr}")
    os.environ["PYTHONPATH"] = str(folder)
    sys.path[:0] = [str(folder), str(PYTHON_FOLDER)]
    import skein_operator

    return skein_operator


def main(check):
    """Runs `check(folder)` with a folder for its files, and says how it went; gives the exit code."""
    if len(sys.argv) > 1 or not os.access(os.environ.get("SKEIN_SIM", ""), os.X_OK):
        print(f"usage: SKEIN_SIM=path/to/skein-sim {sys.argv[0]}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        try:
            check(Path(folder))
        except Failure as failure:
            print(f"FAILED: {failure}")
            return 1
    print("passed")
    return 0
