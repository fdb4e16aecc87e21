//! What every dialect in the list must hold to.

use skein_mav::messages::{HEARTBEAT_DATA, MavAutopilot, MavCmd};
use skein_mav::{Command, CommandResult, DIALECTS, FlightMode, ParameterValue};

fn heartbeat(autopilot: MavAutopilot) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { autopilot, ..Default::default() }
}

#[test]
fn a_heartbeat_chooses_one_dialect_at_most() {
    for (autopilot, expected) in [
        (MavAutopilot::MAV_AUTOPILOT_PX4, &["PX4"][..]),
        (MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, &["ArduPilot"]),
        (MavAutopilot::MAV_AUTOPILOT_GENERIC, &[]),
        (MavAutopilot::MAV_AUTOPILOT_INVALID, &[]),
    ] {
        let heartbeat = heartbeat(autopilot);
        let chosen = DIALECTS.iter().filter(|dialect| dialect.is_spoken_by(&heartbeat));
        let names: Vec<_> = chosen.map(|dialect| dialect.name()).collect();
        assert_eq!(names, expected, "{autopilot:?}");
    }
}

#[test]
fn a_mode_that_can_be_asked_for_is_recognised_once_it_is_flown() {
    let modes = [
        FlightMode::Offboard,
        FlightMode::Takeoff,
        FlightMode::Hold,
        FlightMode::Land,
        FlightMode::Return,
        FlightMode::Mission,
        FlightMode::Manual,
    ];
    for dialect in DIALECTS {
        for mode in modes {
            let Some((main, sub)) = dialect.mode_numbers(mode) else {
                // It may be a command alone.
                assert_eq!(mode, FlightMode::Takeoff, "{}", dialect.name());
                continue;
            };
            // Some makes have the numbers in the upper bytes of a heartbeat's mode, some only the first.
            let flown = [u32::from(main) << 16 | u32::from(sub) << 24, u32::from(main)];
            let heard = flown.map(|number| dialect.mode(number));
            assert!(heard.contains(&mode), "{}: {mode} is {flown:?}, heard as {heard:?}", dialect.name());
        }
    }
}

#[test]
fn a_launch_arms_once_in_offboard_mode() {
    for dialect in DIALECTS {
        let launch = dialect.launch(3.0);
        assert_eq!(launch.iter().filter(|command| **command == Command::Arm).count(), 1);
        assert_eq!(launch.first(), Some(&Command::Offboard), "{}", dialect.name());
        for command in launch {
            assert!(dialect.encode(command, Some(0.0)).is_ok(), "{}: {command:?}", dialect.name());
        }
    }
}

#[test]
fn a_height_that_is_no_number_is_never_sent() {
    for dialect in DIALECTS {
        let climb = |height_m| dialect.encode(Command::Takeoff { height_m }, Some(488.0));
        assert_eq!(climb(f64::NAN), Err(CommandResult::NotFinite), "{}", dialect.name());
        assert_eq!(climb(2.0).map(|message| message.command), Ok(MavCmd::MAV_CMD_NAV_TAKEOFF));
    }
}

/// Names of a parameter, some safe and some unsafe values of it, and whether an autopilot may lack it.
type Case = (&'static [&'static str], &'static [f32], &'static [f32], bool);

/// Judges all failsafes of this make, for a companion whose system id is 3.
fn judge_failsafes(autopilot: MavAutopilot, cases: &[Case]) {
    let heartbeat = heartbeat(autopilot);
    let dialect = DIALECTS.into_iter().find(|dialect| dialect.is_spoken_by(&heartbeat)).unwrap();
    let names: Vec<_> = dialect.failsafes().iter().map(|failsafe| failsafe.parameters).collect();
    assert_eq!(names, cases.iter().map(|case| case.0).collect::<Vec<_>>());
    for (failsafe, (names, safe, unsafe_, may_lack)) in dialect.failsafes().iter().zip(cases) {
        let judge = |value| failsafe.judge(Some(ParameterValue::Real(value)), 3);
        for value in *safe {
            assert_eq!(judge(*value), Ok(()), "{names:?} {value}");
        }
        for value in unsafe_.iter().chain(&[f32::NAN, -1.0]) {
            let remedy = judge(*value).unwrap_err();
            assert_eq!(remedy, format!("set it to {}: {}", (failsafe.setting)(3), failsafe.expected));
        }
        assert_eq!(judge((failsafe.setting)(3) as f32), Ok(()), "{names:?}: its remedy is none");
        assert_eq!(failsafe.judge(None, 3).is_ok(), *may_lack, "{names:?}");
    }
}

#[test]
fn px4_flies_only_with_failsafes_that_keep_it_in_the_air() {
    judge_failsafes(
        MavAutopilot::MAV_AUTOPILOT_PX4,
        &[
            (&["COM_OF_LOSS_T"], &[0.0, 0.5, 2.0], &[2.5], false),
            (&["COM_OBL_RC_ACT"], &[0.0, 1.0, 3.0, 4.0, 5.0], &[2.0, 6.0, 7.0, 8.0, 3.5], false),
            (&["COM_OBL_ACT"], &[0.0, 1.0, 2.0], &[3.0, 4.0], true),
            (&["BAT1_SOURCE", "BAT_SOURCE"], &[0.0, 1.0, 2.0], &[3.0], true),
        ],
    );
}

#[test]
fn ardupilot_flies_only_with_failsafes_that_bring_it_down() {
    judge_failsafes(
        MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        &[
            (&["GUID_TIMEOUT"], &[0.1, 0.5, 1.0], &[1.1, 3.0], true),
            // 2 goes on with a mission, 6 looks for a landing in it, 7 stands still for ever.
            (&["FS_GCS_ENABLE"], &[1.0, 3.0, 4.0, 5.0], &[0.0, 2.0, 6.0, 7.0], false),
            (&["SYSID_MYGCS", "MAV_GCS_SYSID"], &[3.0], &[1.0, 255.0], false),
            (&["FS_GCS_TIMEOUT"], &[2.0, 5.0], &[10.0], true),
            (&["BATT_MONITOR"], &[3.0, 4.0, 16.0], &[0.0], false),
        ],
    );
}
