"""Reads a recorded mission with the tools that other people have: PyPI's mcap and mcap-protobuf-support.

usage: python3 test_mcap.py MISSION.mcap [VEHICLES]

Checks that every topic is there with its schema, that every message decodes, that times never go back, that every
vehicle has poses that move, and that the event trace holds selections. Exit code 0 if so, 1 if not, 2 on wrong usage.
"""

import re
import sys
from collections import defaultdict

try:
    from mcap.exceptions import McapError
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory
except ImportError as missing:
    print(f"skipped: needs {missing.name} (pip install mcap mcap-protobuf-support)")
    sys.exit(0)

SHARED_TOPICS = {
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/log": "foxglove.Log",
    "/skein/trace": "skein.TraceEvent",
}
VEHICLE_TOPICS = {
    "pose": "foxglove.PoseInFrame",
    "path": "foxglove.SceneUpdate",
    "scan": "foxglove.LaserScan",
}
RAYS = 720


class Failure(Exception):
    """What is wrong with the recording."""


def expect(condition, message):
    """Like assert, but not switched off by -O."""
    if not condition:
        raise Failure(message)


def read(path):
    """All messages by topic as (log time in ns, decoded message), and each topic's schema."""
    messages, schemas = defaultdict(list), {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            schemas[channel.topic] = schema.name
            messages[channel.topic].append((message.log_time, decoded))
    return messages, schemas


def vehicles_in(messages):
    """Names of the vehicles, such as uav/1, in order of their numbers."""
    names = {m.group(1) for m in (re.fullmatch(r"/(uav/\d+)/pose", topic) for topic in messages) if m}
    return sorted(names, key=lambda name: int(name.split("/")[1]))


def check_topics(schemas, vehicles):
    expected = dict(SHARED_TOPICS)
    for vehicle in vehicles:
        expected.update({f"/{vehicle}/{what}": schema for what, schema in VEHICLE_TOPICS.items()})
    for topic, schema in expected.items():
        expect(topic in schemas, f"no messages on {topic}")
        expect(schemas[topic] == schema, f"{topic} has schema {schemas[topic]}, expected {schema}")


def check_times(messages):
    for topic, timed in messages.items():
        times = [time for time, _ in timed]
        expect(times == sorted(times), f"times go back on {topic}")


def check_vehicle(messages, vehicle):
    poses = [decoded.pose.position for _, decoded in messages[f"/{vehicle}/pose"]]
    xs, ys = [p.x for p in poses], [p.y for p in poses]
    span = max(max(xs) - min(xs), max(ys) - min(ys))
    expect(span > 1.0, f"{vehicle} moved over {span:.2f} m only")
    expect(max(p.z for p in poses) > 1.0, f"{vehicle} never flew")
    frames = {decoded.frame_id for _, decoded in messages[f"/{vehicle}/pose"]}
    expect(frames == {"world"}, f"poses of {vehicle} are in frames {frames}, expected world")
    for _, scan in messages[f"/{vehicle}/scan"]:
        expect(len(scan.ranges) == RAYS, f"a scan of {vehicle} has {len(scan.ranges)} rays, expected {RAYS}")
        expect(scan.frame_id == vehicle, f"a scan of {vehicle} is in frame {scan.frame_id}")


def check_transforms(messages, vehicles):
    children = {t.child_frame_id for _, decoded in messages["/tf"] for t in decoded.transforms}
    expect(children == set(vehicles), f"/tf has frames {sorted(children)}, expected {vehicles}")


def check_trace(messages, vehicles):
    events = [decoded for _, decoded in messages["/skein/trace"]]
    nodes = {event.node for event in events}
    expect(all(event.event and event.home for event in events), "an event of the trace has no name or home")
    for vehicle in vehicles:
        expect(vehicle in nodes, f"the trace has no event of {vehicle}")
        takeoffs = [e for e in events if e.event == f"{vehicle}/takeoff"]
        expect(takeoffs, f"the trace has no {vehicle}/takeoff")
    expect(any(event.requested_by for event in events), "no event of the trace says who requested it")


def check(path, count):
    messages, schemas = read(path)
    vehicles = vehicles_in(messages)
    expect(vehicles, "no vehicle has poses")
    expect(count in (None, len(vehicles)), f"{len(vehicles)} vehicles have poses, expected {count}")
    check_topics(schemas, vehicles)
    check_times(messages)
    for vehicle in vehicles:
        check_vehicle(messages, vehicle)
    check_transforms(messages, vehicles)
    check_trace(messages, vehicles)
    total = sum(len(timed) for timed in messages.values())
    print(f"passed: {total} messages on {len(messages)} topics, {len(vehicles)} vehicles")


def main(arguments):
    if len(arguments) not in (1, 2) or not all(a.isdigit() for a in arguments[1:]):
        print(__doc__.strip().splitlines()[2], file=sys.stderr)
        return 2
    try:
        check(arguments[0], int(arguments[1]) if len(arguments) == 2 else None)
    except (Failure, McapError, OSError) as failure:
        print(f"failed: {arguments[0]}: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
