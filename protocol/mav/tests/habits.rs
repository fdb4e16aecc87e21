//! The companion adapts to what an autopilot will not do: stream its heartbeat, or speak MAVLink 2.

use std::time::Duration;

use mavlink::MavlinkVersion;
use skein_mav::messages::{COMMAND_ACK_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavResult};
use skein_mav::{Address, Companion, CompanionConfig, Datum, FlightMode, FrameReader, FrameWriter, MavEvent};

const TICK: Duration = Duration::from_millis(20);
const HEARTBEAT: f32 = 0.0;

/// An autopilot that writes a heartbeat a second, denies to stream it, and sends it when asked singly.
struct Autopilot {
    writer: FrameWriter,
    reader: FrameReader,
    version: MavlinkVersion,
    custom_mode: u32,
    heard: Vec<MavlinkVersion>,
}

impl Autopilot {
    fn speaking(version: MavlinkVersion) -> Self {
        let mut writer = FrameWriter::new(Address::autopilot(1));
        writer.speak(version);
        Self { writer, reader: FrameReader::default(), version, custom_mode: 6 << 16, heard: Vec::new() }
    }

    fn beat(&mut self) {
        self.writer.write(&HEARTBEAT_DATA {
            custom_mode: self.custom_mode,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            ..Default::default()
        });
    }

    fn answer(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
        while let Some(frame) = self.reader.next_frame() {
            self.heard.push(frame.version);
            let MavMessage::COMMAND_LONG(asked) = frame.message else { continue };
            if frame.version != self.version {
                continue;
            }
            let result = match (asked.command, asked.param1) {
                (MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, HEARTBEAT) => MavResult::MAV_RESULT_DENIED,
                (MavCmd::MAV_CMD_REQUEST_MESSAGE, HEARTBEAT) => {
                    self.beat();
                    MavResult::MAV_RESULT_ACCEPTED
                }
                _ => MavResult::MAV_RESULT_ACCEPTED,
            };
            self.writer.write(&COMMAND_ACK_DATA {
                command: asked.command,
                result,
                target_system: 1,
                target_component: 191,
                ..Default::default()
            });
        }
    }
}

/// Both ends from one time to another; returns the companion's events, each with its time.
fn run(
    companion: &mut Companion,
    autopilot: &mut Autopilot,
    times: std::ops::Range<Duration>,
) -> Vec<(Duration, MavEvent)> {
    let mut events = Vec::new();
    let mut now = times.start;
    while now < times.end {
        if now.subsec_millis() == 0 {
            autopilot.beat();
        }
        companion.receive(now, &autopilot.writer.take());
        companion.tick(now);
        autopilot.answer(&companion.take_output());
        events.extend(std::iter::from_fn(|| companion.poll_event()).map(|event| (now, event)));
        now += TICK;
    }
    events
}

fn companion() -> Companion {
    Companion::new(CompanionConfig::new(1, Datum::from_degrees(47.4, 8.5, 488.0)))
}

#[test]
fn a_mode_change_is_seen_within_200_ms_of_an_autopilot_that_streams_no_heartbeat() {
    let (mut companion, mut autopilot) = (companion(), Autopilot::speaking(MavlinkVersion::V2));
    run(&mut companion, &mut autopilot, Duration::ZERO..Duration::from_millis(5020));
    // The next heartbeat of its own is due at 6 s.
    autopilot.custom_mode = 3 << 16;
    let since = Duration::from_millis(5020);
    let events = run(&mut companion, &mut autopilot, since..Duration::from_secs(6));
    let change = MavEvent::ModeChanged { from: FlightMode::Offboard, to: FlightMode::Manual };
    let (at, _) = events.iter().find(|(_, event)| *event == change).expect("not seen");
    assert!(*at - since <= Duration::from_millis(200), "{at:?}");
}

#[test]
fn one_that_knows_mavlink_1_only_is_answered_in_it_and_one_that_knows_2_in_2() {
    for (spoken, knows_1_only) in [(MavlinkVersion::V1, true), (MavlinkVersion::V2, false)] {
        let (mut companion, mut autopilot) = (companion(), Autopilot::speaking(spoken));
        run(&mut companion, &mut autopilot, Duration::ZERO..Duration::from_secs(5));
        assert_eq!(autopilot.heard.first(), Some(&MavlinkVersion::V2), "it may learn better");
        assert_eq!(autopilot.heard.last(), Some(&spoken));
        assert_eq!(companion.telemetry().knows_mavlink_1_only, knows_1_only);
    }
    // Its answers in 2 count at once.
    let (mut companion, mut autopilot) = (companion(), Autopilot::speaking(MavlinkVersion::V1));
    run(&mut companion, &mut autopilot, Duration::ZERO..Duration::from_secs(5));
    autopilot.writer.speak(MavlinkVersion::V2);
    run(&mut companion, &mut autopilot, Duration::from_secs(5)..Duration::from_secs(7));
    assert_eq!(autopilot.heard.last(), Some(&MavlinkVersion::V2));
}
