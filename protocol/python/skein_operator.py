#!/usr/bin/env python3
"""An operator's script: looks at a swarm over Zenoh, holds it, and gives orders to its vehicles.

  skein_operator.py list                   the vehicles, what they do and what they wait for
  skein_operator.py watch                  what happens, with who requested it, until Ctrl-C
  skein_operator.py hold                   nobody moves on, until Ctrl-C
  skein_operator.py hold --seconds 5 uav/1 uav/2
  skein_operator.py return uav/3           also: land, resume; `all` for every vehicle
  skein_operator.py take uav/3             hold it from now on: it sets out for nobody else; also: ask, release, give
  skein_operator.py roster --term 2 --coordinator ground/main uav/1 uav/2    who decides together from now on
  skein_operator.py load curfew.toml --with for_s=60 --with 'min=[0,0,0]' --with 'max=[9,9,9]' all
  skein_operator.py unload curfew all

It speaks as the node `script/operator`, which must be in the vehicles' rosters. Only one such script has a say at a
time: `hold`, `land`, `return` and `resume` end what an earlier one still holds at the vehicles that they speak to.
Every order names who gives it, `--by`. A vehicle takes orders that set it going from one holder; whoever gives the first
holds it, and for 30 s after the last. It is held, sent home and landed by anybody.

Needs eclipse-zenoh, protobuf, and skein_pb2.py beside it: README.md says how that is made.
Exit codes: 0 done, 1 nobody is there or somebody did not acknowledge, 2 wrong usage.
"""

import signal

if __name__ == "__main__":
    # Ctrl-C while the packages are being loaded ends it silently.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import getpass
import ipaddress
import json
import math
import os
import queue
import re
import sys
import time
import tomllib
from pathlib import Path

try:
    import zenoh
    from google.protobuf.message import DecodeError

    import skein_pb2 as wire
except ImportError as missing:
    print(f"skein_operator: needs {missing.name}: protocol/python/README.md says how to get it", file=sys.stderr)
    sys.exit(2)

NODE = "script/operator"
VERSION = 1

# A block holds for this long after the last word from this script.
LEASE_MS = 1000
RENEW_S = 0.3
# A record that has not been acknowledged is repeated this often.
REPEAT_S = 0.1
# The block counts as kept for so much of the lease, from when the acknowledged copy was sent.
KEPT_S = 0.9 * LEASE_MS / 1000

# How long to wait for the first vehicle, and for acknowledgements.
PATIENCE_S = 3.0
LISTEN_S = 1.0
TICK_S = 0.02

# Words of the catalogue of events:
ORDER = "order"
HANDOVER = "handover"
LOAD = "load"
UNLOAD = "unload"
SCRIPT = "script"
ADVANCE = "advance"
HOMEWARD = "homeward"
ROSTER = "roster"
TO_HOLD = "hold"
TO_LAND = "land"
TO_RETURN = "return"
TO_RESUME = "resume"
TO_ASK = "ask"
TO_GIVE = "give"
TO_TAKE = "take"
TO_RELEASE = "release"
ACCEPTED = "accepted"
REFUSED = "refused"
WITHDRAWN = "withdrawn"
# End of the words.

# Who holds a vehicle.
HANDOVERS = (TO_ASK, TO_GIVE, TO_TAKE, TO_RELEASE)

# Leave to move, ten times a second for each vehicle in flight: too much for people to read.
LEAVE = (ADVANCE, HOMEWARD)

CHUNK = r"[A-Za-z0-9_.-]+"


class Unreachable(Exception):
    """Why there is no connection."""


class Swarm:
    """This script's place in a fleet: hears what others say on some topics, and speaks under the name of `NODE`."""

    def __init__(self, fleet, connect, topics, certificates=None):
        self.root = f"skein/{fleet}"
        self.incarnation = time.time_ns() // 1_000_000
        self._began = time.monotonic()
        self._inbox = queue.SimpleQueue()
        settings = {
            "mode": "peer",
            "scouting/multicast/enabled": False,
            "scouting/delay": 0,
            "listen/endpoints": [],
            "connect/endpoints": connect.split(","),
            # Whoever is not there yet is tried again.
            "connect/timeout_ms": -1,
            "connect/exit_on_failure": False,
            "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5},
        }
        if certificates:
            own = str(Path(certificates) / NODE.replace("/", "-"))
            settings |= {
                "transport/link/protocols": ["tls"],
                "transport/link/tls/root_ca_certificate": str(Path(certificates) / "authority.pem"),
                "transport/link/tls/connect_certificate": f"{own}.pem",
                "transport/link/tls/connect_private_key": f"{own}.key",
                "transport/link/tls/enable_mtls": True,
            }
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(config)
            for topic in topics:
                self._session.declare_subscriber(f"{self.root}/{topic}", self._inbox.put)
        except zenoh.ZError as error:
            raise Unreachable(str(error)) from error

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._session.close()

    def now_s(self):
        """Time since this script began."""
        return time.monotonic() - self._began

    def hear(self, timeout_s):
        """The next message as its sender and its body (a State, a BidAck, ...); None if none has come in time."""
        try:
            sample = self._inbox.get(timeout=timeout_s)
        except queue.Empty:
            return None
        packet = wire.Packet()
        try:
            packet.ParseFromString(bytes(sample.payload))
        except DecodeError:
            return None
        body = packet.WhichOneof("body")
        if packet.version != VERSION or body is None:
            return None
        # The key says who speaks: access control binds it to a certificate.
        _, _, _, kind, name = str(sample.key_expr).split("/")[:5]
        return f"{kind}/{name}", getattr(packet, body)

    def put(self, key, **body):
        """Puts a message: `put("bid/script/operator/uav/1", bid=record)`."""
        self._session.put(f"{self.root}/{key}", wire.Packet(version=VERSION, **body).SerializeToString())


class Outbox:
    """What this script bids at one home: a record that is repeated, so that it stays in force, until it is empty.

    `epoch` numbers the record's content. The home acknowledges the epoch that it has taken in, with the time at which
    that copy was sent: from there the lease counts, on the clock of this script.
    """

    def __init__(self, swarm, home):
        self.swarm, self.home = swarm, home
        self.epoch, self.bids = 0, []
        self.home_incarnation, self.applied = None, 0
        self.sent_at_s = -math.inf
        self.acked_epoch, self.acked_sent_at_s = 0, -math.inf
        self.refusals = []

    def state(self, *bids):
        """From now on these are the bids; none of them withdraws all."""
        self.epoch += 1
        self.bids = bids
        self._send()

    def renew(self):
        """Sends the record again if that is due."""
        period_s = RENEW_S if self.is_acknowledged() else REPEAT_S
        if self.swarm.now_s() >= self.sent_at_s + period_s and (self.bids or not self.is_acknowledged()):
            self._send()

    def take_in(self, ack):
        """Notes the home's answer, if it answers this script and not an earlier one."""
        if ack.incarnation == self.swarm.incarnation and self.acked_epoch <= ack.epoch <= self.epoch:
            self.acked_epoch = ack.epoch
            self.acked_sent_at_s = max(self.acked_sent_at_s, ack.sent_at_ns * 1e-9)
            self.refusals = [name_of(wire.RefusalReason, refusal.reason) for refusal in ack.refused]

    def is_acknowledged(self):
        """Whether the home has taken in the present bids."""
        return self.acked_epoch == self.epoch

    def is_kept(self):
        """Whether the present bids are sure to be in force now."""
        in_time = self.swarm.now_s() < self.acked_sent_at_s + KEPT_S
        return self.is_acknowledged() and in_time and not self.refusals

    def _send(self):
        self.sent_at_s = self.swarm.now_s()
        record = wire.BidRecord(
            node=NODE,
            incarnation=self.swarm.incarnation,
            home=self.home,
            home_incarnation=self.home_incarnation,
            epoch=self.epoch,
            sent_at_ns=int(self.sent_at_s * 1e9),
            applied=self.applied,
            lease_ms=LEASE_MS,
            bids=self.bids,
        )
        self.swarm.put(f"bid/{NODE}/{self.home}", bid=record)


class Interrupted:
    """True once Ctrl-C has been pressed."""

    def __init__(self):
        self._is = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def __bool__(self):
        return self._is

    def _note(self, *_):
        self._is = True


class Output:
    """Lines for people, or with `--json` one object a line."""

    def __init__(self, as_json):
        self.as_json = as_json

    def tell(self, line, **fields):
        """Says the same in the one way or the other. What others have named cannot move the cursor."""
        if self.as_json:
            print(json.dumps(fields), flush=True)
        else:
            print("".join(letter if letter.isprintable() else "?" for letter in line), flush=True)


def name_of(enum, number):
    """The word for a number, which may come from a later version."""
    return enum.Name(number).lower() if number in enum.values() else str(number)


def is_vehicle(node):
    return node.startswith("uav/")


def ordered(nodes):
    """Names in order, uav/2 before uav/10."""
    return sorted(nodes, key=lambda node: [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", node)])


def list_vehicles(options, output, interrupted):
    """`list`: every vehicle that is heard within a second of the first."""
    states = {}
    with Swarm(options.fleet, options.connect, ["state/*/*"], options.certificates) as swarm:
        end_s = PATIENCE_S
        while swarm.now_s() < end_s and not interrupted:
            heard = swarm.hear(TICK_S)
            if heard and isinstance(heard[1], wire.State):
                if not states:
                    end_s = swarm.now_s() + LISTEN_S
                states[heard[0]] = heard[1]
    rows = [
        {
            "vehicle": node,
            "mode": state.mode,
            "armed": state.armed,
            "battery": round(state.battery, 3),
            "task": state.task,
            "waiting_for": state.waiting_for,
            "holder": state.holder,
            "mission": name_of(wire.Mission, state.mission),
            "position": [round(number, 2) for number in (state.position.x, state.position.y, state.position.z)],
        }
        for node, state in ((node, states[node]) for node in ordered(states))
    ]
    if options.json:
        output.tell("", vehicles=rows)
    elif rows:
        heads = {"vehicle": "VEHICLE", "mode": "MODE", "battery": "BATTERY", "task": "TASK", "waiting_for": "WAITS FOR"}
        cells = [list(heads.values())]
        cells += [[f"{row[key]:.0%}" if key == "battery" else row[key] for key in heads] for row in rows]
        widths = [max(map(len, column)) for column in zip(*cells)]
        for line in cells:
            output.tell("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
    return None if rows else nobody(options)


def watch(options, output, interrupted):
    """`watch`: occurrences as they come."""
    with Swarm(options.fleet, options.connect, ["occ/*/*"], options.certificates) as swarm:
        while not interrupted:
            heard = swarm.hear(TICK_S)
            if not heard or not isinstance(heard[1], wire.Occurrence):
                continue
            occurrence = heard[1]
            event, at_s = occurrence.event, occurrence.at_ns * 1e-9
            if event.name.rsplit("/", 1)[-1] in LEAVE and not options.all:
                continue
            data = {key: getattr(value, value.WhichOneof("kind") or "text") for key, value in event.data.items()}
            shown = ", ".join(f"{key}: {value}" for key, value in sorted(data.items()))
            requested_by = list(occurrence.requested_by)
            output.tell(
                f"{at_s:9.3f} s  {event.name}"
                + (f" {{{shown}}}" if shown else "")
                + (f"  requested by {', '.join(requested_by)}" if requested_by else ""),
                home=heard[0],
                seq=occurrence.seq,
                at_s=at_s,
                event=event.name,
                data=data,
                requested_by=requested_by,
            )
    return None


def hold(options, output, interrupted):
    """`hold`: blocks `uav/*/advance` at every vehicle, which each requests before it moves on."""
    bthread = f"hold by {options.by}" if options.by else "hold"
    block = wire.RemoteBid(bthread=bthread, sync=1, block=wire.EventSet(named=f"uav/*/{ADVANCE}"))
    wanted = named(options)
    outboxes, said, faults = {}, {}, set()

    topics = ["state/*/*", "presence/*/*", f"ack/*/*/{NODE}"]
    with Swarm(options.fleet, options.connect, topics, options.certificates) as swarm:

        def ask(node):
            outboxes[node] = Outbox(swarm, node)
            outboxes[node].state(block)

        def turn():
            """Listens for a moment, and sends what is due."""
            heard = swarm.hear(TICK_S)
            if heard:
                node, body = heard
                if node not in outboxes and is_vehicle(node) and not wanted:
                    ask(node)
                if isinstance(body, wire.BidAck) and node in outboxes:
                    outboxes[node].take_in(body)
            for outbox in outboxes.values():
                outbox.renew()

        def tell(node):
            """Says how a vehicle takes the hold, when that is new."""
            outbox, before = outboxes[node], said.get(node)
            if outbox.refusals:
                how, line = "refused", f"{node} refuses: {', '.join(outbox.refusals)}"
            elif outbox.is_kept():
                how, line = "acknowledged", f"{node} acknowledges the hold"
            elif before in ("acknowledged", "lost"):
                how, line = "lost", f"{node} may move: it is out of reach, or another script has taken over"
            elif swarm.now_s() > PATIENCE_S:
                how, line = "missing", f"{node} is missing: no acknowledgement"
            else:
                return
            if how != before:
                said[node] = how
                output.tell(line, vehicle=node, hold=how, after_ms=round(swarm.now_s() * 1000))
            if how != "acknowledged":
                faults.add(node)

        for node in wanted:
            ask(node)
        while not interrupted and swarm.now_s() < options.seconds:
            turn()
            for node in outboxes:
                tell(node)
            if not outboxes and swarm.now_s() > PATIENCE_S:
                return nobody(options)
        held = [node for node in outboxes if outboxes[node].is_kept()]
        faults.update(outboxes.keys() - held)

        # Said before it is done: whoever has not heard this sees vehicles that are held.
        output.tell(f"lifting the hold of {', '.join(ordered(held)) or 'nobody'}", lifting=ordered(held))
        wanted = list(outboxes)
        for outbox in outboxes.values():
            outbox.state()
        end_s = swarm.now_s() + LEASE_MS / 1000
        while swarm.now_s() < end_s and not all(outboxes[node].is_acknowledged() for node in held):
            turn()
        # Where this has not been acknowledged, the lease has run out by now.
        output.tell(f"lifted: {', '.join(ordered(held)) or 'nowhere'}", lifted=ordered(held), missing=ordered(faults))
    if not outboxes:
        return nobody(options)
    return f"not held all the time: {', '.join(ordered(faults))}" if faults else None


def order(options, output, interrupted):
    """`land`, `return`, `resume`: requests `uav/N/order`, which the vehicle's operator b-thread turns into its own event;
    `load` and `unload` request `uav/N/load` and `uav/N/unload`, and the vehicle tells what becomes of the script;
    `roster` requests `<node>/roster` of every member, which begins a new term of joint events there.

    A request counts only for the present life of its home, and together with how far this script has heard the home's
    occurrences. Both are learnt from the answer to an empty record.
    """
    what, wanted = options.command, named(options)
    if what == ROSTER and options.coordinator not in wanted:
        wanted.append(options.coordinator)
    verb, data = verb_and_data(options)
    outboxes, taken, unwilling, holders = {}, set(), {}, {}

    topics = ["state/*/*", "occ/*/*", f"occ/*/*/{NODE}", f"ack/*/*/{NODE}"]
    with Swarm(options.fleet, options.connect, topics, options.certificates) as swarm:

        def ask(node):
            outboxes[node] = Outbox(swarm, node)
            outboxes[node].state()

        def take_in_ack(node, ack):
            outbox = outboxes[node]
            outbox.take_in(ack)
            if outbox.home_incarnation != ack.home_incarnation:
                outbox.home_incarnation, outbox.applied = ack.home_incarnation, ack.latest_seq
                outbox.state(wire.RemoteBid(bthread=f"order {what}", sync=1, requests=[event(node)]))
            elif ack.latest_seq > outbox.applied:
                # Something has occurred there, perhaps the order, and may have been lost on the way.
                repair = wire.Repair(
                    home=node,
                    incarnation=ack.home_incarnation,
                    from_seq=outbox.applied + 1,
                    to_seq=ack.latest_seq,
                    requester=NODE,
                )
                swarm.put(f"repair/{NODE}/{node}", repair=repair)

        def take_in_occurrence(node, occurrence):
            outbox = outboxes[node]
            is_new = occurrence.incarnation == outbox.home_incarnation and occurrence.seq > outbox.applied
            if not is_new:
                return
            if verb in (ORDER, HANDOVER, ROSTER):
                is_taken = occurrence.event == event(node)
            else:
                told = {key: value.text for key, value in occurrence.event.data.items()}
                if occurrence.event.name != f"{node}/{SCRIPT}" or told.get("name") != script_name(options):
                    return
                if told.get("state") == REFUSED:
                    unwilling[node] = told.get("why", "")
                is_taken = told.get("state") == {LOAD: ACCEPTED, UNLOAD: WITHDRAWN}[verb]
            if is_taken:
                taken.add(node)
                output.tell(f"{node} takes the order: {what}", vehicle=node, order=what, taken=True)

        def event(node):
            if what != ROSTER:
                return wire.Event(
                    name=f"{node}/{verb}", data={key: wire.Value(text=text) for key, text in data.items()}
                )
            roster = {
                "term": wire.Value(integer=options.term),
                "coordinator": wire.Value(text=options.coordinator),
                "members": wire.Value(text=" ".join(ordered(wanted))),
            }
            return wire.Event(name=f"{node}/{ROSTER}", data=roster)

        def is_complete():
            # Not named, the vehicles are those that are heard within a second.
            settled = taken | unwilling.keys()
            return outboxes and settled == outboxes.keys() and (wanted or swarm.now_s() > LISTEN_S)

        for node in wanted:
            ask(node)
        while not (interrupted or is_complete()) and swarm.now_s() < PATIENCE_S:
            heard = swarm.hear(TICK_S)
            if heard:
                node, body = heard
                if node not in outboxes and is_vehicle(node) and not wanted:
                    ask(node)
                if isinstance(body, wire.State):
                    holders[node] = body.holder
                if node in outboxes and node not in taken:
                    if isinstance(body, wire.BidAck):
                        take_in_ack(node, body)
                    elif isinstance(body, wire.Occurrence):
                        take_in_occurrence(node, body)
            for node in outboxes.keys() - taken:
                outboxes[node].renew()
        # What was not taken shall not be taken later.
        for outbox in outboxes.values():
            outbox.state()
    missing = ordered(outboxes.keys() - taken)
    for node in missing:
        why = unwilling.get(node) or ", ".join(outboxes[node].refusals) or overruled(holders.get(node), options) or "no answer"
        output.tell(f"{node} has not taken the order: {why}", vehicle=node, order=what, taken=False)
    if not outboxes:
        return nobody(options)
    return f"not taken by {', '.join(missing)}" if missing else None


def verb_and_data(options):
    """The event that is requested, and what it carries: always the name of whoever requests it."""
    what = options.command
    if what in (LOAD, UNLOAD):
        return what, {**script_data(options), "by": options.by}
    if what in HANDOVERS:
        to = {"to": options.to} if what == TO_GIVE else {}
        return HANDOVER, {"what": what, "by": options.by, **to}
    return (ROSTER, {}) if what == ROSTER else (ORDER, {"what": what, "by": options.by})


def overruled(holder, options):
    """Why a vehicle that somebody else holds does not take an order."""
    if not holder or holder == options.by or options.command not in (TO_RESUME, LOAD, UNLOAD):
        return None
    return f"{holder} holds it: `ask` for it, or `take` it, which {holder} sees"


def script_data(options):
    """What a request of `load` or `unload` carries beside the name of whoever requests it."""
    if options.command == UNLOAD:
        return {"name": options.name}
    assignment = {"script": options.script, "with": dict(options.values)}
    if options.called:
        assignment["as"] = options.called
    return {"name": script_name(options), "script": json.dumps(assignment)}


def script_name(options):
    """The name that the script runs under."""
    return options.name if options.command == UNLOAD else options.called or options.script.get("name")


def script_file(path):
    """A script, from TOML or JSON; the vehicle says what is wrong with it."""
    try:
        with open(path, "rb") as file:
            return json.load(file) if path.endswith(".json") else tomllib.load(file)
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{path}: {error}") from None


def script_value(text):
    """`NAME=VALUE`, with the value in JSON; anything else is a text."""
    name, separator, value = text.partition("=")
    if not separator:
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME=VALUE")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def named(options):
    """The vehicles that were named; none for all."""
    return [] if "all" in options.vehicles else list(dict.fromkeys(options.vehicles))


def nobody(options):
    return f"no vehicle of fleet `{options.fleet}` is heard through {options.connect}"


def fleet_name(text):
    if not re.fullmatch(CHUNK, text):
        raise argparse.ArgumentTypeError(f"{text!r}: expected letters, digits, `_`, `.` or `-`, such as sim")
    return text


def endpoints(text):
    """Without certificates only this computer is spoken to, as everywhere in Skein."""
    return ",".join(endpoint(part) for part in text.split(","))


def endpoint(text):
    parts = re.fullmatch(r"(tcp|tls)/(\[[0-9a-f:]+\]|[^:/\[\]]+):(\d{1,5})", text)
    if parts and 0 < int(parts[3]) < 65536:
        if parts[1] == "tls":
            return text
        host = parts[2].strip("[]")
        try:
            if host == "localhost" or ipaddress.ip_address(host).is_loopback:
                return text
        except ValueError:
            pass
    raise argparse.ArgumentTypeError(f"{text!r}: expected a TCP port of this computer, such as tcp/127.0.0.1:7447, "
                                     "or, with --certificates, tls/ADDRESS:PORT")


def giver(text):
    """The name of a person or program, as the console takes it."""
    name = text.strip()
    if not 0 < len(name.encode()) <= 64 or not name.isprintable() or set(name) & set("/#"):
        raise argparse.ArgumentTypeError(f"{text!r}: expected 1 to 64 bytes in one line, without / and #, such as Anna")
    return name


def account():
    """The name of this account, if it has one that an order can tell."""
    try:
        return giver(getpass.getuser())
    except (argparse.ArgumentTypeError, OSError, KeyError):
        return None


def duration(text):
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of seconds above 0")
    return seconds


def vehicle(text):
    if text != "all" and (not re.fullmatch(f"uav/{CHUNK}", text) or len(text) > 64):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a vehicle such as uav/3, or all")
    return text


def node(text):
    if not re.fullmatch(f"{CHUNK}/{CHUNK}", text) or len(text) > 64:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a node such as uav/3 or ground/main")
    return text


def term(text):
    number = int(text) if text.isdecimal() else 0
    if not 0 < number < 2**62:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number above that of the present term")
    return number


def read_arguments(arguments):
    # They may stand before the command or after it. Defaults are those of the first place, or the second would undo it.
    def common(**defaults):
        options = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
        options.add_argument("--fleet", type=fleet_name, help="the fleet's name (default: sim)")
        options.add_argument(
            "--connect",
            type=endpoints,
            metavar="ENDPOINT,...",
            help="where nodes of the fleet listen: one that relays, or all (default: tcp/127.0.0.1:7447)",
        )
        options.add_argument("--certificates", metavar="DIR", help="folder of authority, certificate and key, for tls/")
        options.add_argument("--by", type=giver, metavar="NAME", help="who gives orders (default: this account's name)")
        options.add_argument("--json", action="store_true", help="one JSON object a line on standard output")
        options.set_defaults(**defaults)
        return options

    about, _, rest = __doc__.partition("\n\n")
    parser = argparse.ArgumentParser(
        prog="skein_operator.py",
        description=about,
        epilog=rest,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[common(fleet="sim", connect="tcp/127.0.0.1:7447", certificates=None, json=False, by=account())],
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name, run, about):
        added = commands.add_parser(name, parents=[common()], help=about, description=about)
        added.set_defaults(run=run)
        return added

    command("list", list_vehicles, "the vehicles, and what they do")
    watching = command("watch", watch, "what happens, until Ctrl-C")
    watching.add_argument("--all", action="store_true", help="also each leave to move, ten a second for each vehicle")
    holding = command(TO_HOLD, hold, "nobody moves on, until Ctrl-C")
    holding.add_argument("--seconds", type=duration, default=math.inf, metavar="S", help="end by itself after so long")
    holding.add_argument("vehicles", type=vehicle, nargs="*", default=["all"], metavar="uav/N", help="only these")
    for what, about in (
        (TO_LAND, "land where they are"),
        (TO_RETURN, "fly home and land there"),
        (TO_RESUME, "go on after an order to hold"),
        (TO_ASK, "ask whoever holds them for them"),
        (TO_GIVE, "give them to somebody else"),
        (TO_TAKE, "hold them from now on, whoever holds them"),
        (TO_RELEASE, "hold them no more"),
    ):
        added = command(what, order, about)
        added.add_argument("vehicles", type=vehicle, nargs="+", metavar="uav/N", help="these, or `all`")
        if what == TO_GIVE:
            added.add_argument("--to", type=giver, required=True, metavar="NAME", help="who shall hold them")
    electing = command(ROSTER, order, "who decides on joint events from now on, and who coordinates them")
    electing.add_argument("--term", type=term, required=True, help="the new term: above the present one, which is 1 at first")
    electing.add_argument("--coordinator", type=node, required=True, metavar="NODE", help="where joint events are decided")
    electing.add_argument("vehicles", type=node, nargs="+", metavar="NODE", help="without whom nothing is decided")
    loading = command(LOAD, order, "run a script")
    loading.add_argument("script", type=script_file, metavar="FILE", help="TOML or JSON, such as agent/scripts/curfew.toml")
    loading.add_argument(
        "--with", type=script_value, action="append", default=[], dest="values", metavar="NAME=VALUE", help="a parameter"
    )
    loading.add_argument("--as", dest="called", metavar="NAME", help="run it under another name")
    unloading = command(UNLOAD, order, "run a script no more")
    unloading.add_argument("name", metavar="NAME", help="the name it runs under")
    for added in (loading, unloading):
        added.add_argument("vehicles", type=vehicle, nargs="+", metavar="uav/N", help="these, or `all`")
    options = parser.parse_args(arguments)
    if options.by is None and options.run is order:
        parser.error("nobody is named who gives this order: add --by NAME")
    return options


def main(arguments):
    options = read_arguments(arguments)
    interrupted = Interrupted()
    try:
        fault = options.run(options, Output(options.json), interrupted)
    except Unreachable as error:
        fault = f"no connection: {error}"
    except BrokenPipeError:
        # Whoever read this has heard enough; the interpreter shall not complain at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    if fault:
        print(f"skein_operator: {fault}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
