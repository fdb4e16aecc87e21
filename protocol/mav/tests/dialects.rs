//! What every dialect in the list must hold to.

use skein_mav::messages::{HEARTBEAT_DATA, MavAutopilot, MavCmd};
use skein_mav::{Command, CommandResult, DIALECTS, FlightMode};

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
fn a_launch_arms_once_and_ends_with_the_climb() {
    let height_m = 3.0;
    for dialect in DIALECTS {
        let launch = dialect.launch(height_m);
        assert_eq!(launch.iter().filter(|command| **command == Command::Arm).count(), 1);
        assert_eq!(launch.last(), Some(&Command::Takeoff { height_m }));
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

#[test]
fn px4_flies_only_with_failsafes_that_keep_it_in_the_air() {
    let heartbeat = heartbeat(MavAutopilot::MAV_AUTOPILOT_PX4);
    let px4 = DIALECTS.into_iter().find(|dialect| dialect.is_spoken_by(&heartbeat)).unwrap();
    let judge = |parameter: &str, value: Option<f32>| {
        let failsafe = px4.failsafes().iter().find(|failsafe| failsafe.parameter == parameter).unwrap();
        failsafe.judge(value.map(skein_mav::ParameterValue::Real))
    };
    for (parameter, safe, unsafe_) in [
        ("COM_OF_LOSS_T", &[0.0, 0.5, 2.0][..], &[2.5, -1.0, f32::NAN][..]),
        ("COM_OBL_RC_ACT", &[0.0, 1.0, 3.0, 4.0, 5.0], &[2.0, 6.0, 7.0, 8.0, -1.0, 3.5, f32::NAN]),
    ] {
        for value in safe {
            assert_eq!(judge(parameter, Some(*value)), Ok(()), "{parameter} {value}");
        }
        for value in unsafe_ {
            let complaint = judge(parameter, Some(*value)).unwrap_err();
            assert!(complaint.starts_with(&format!("{parameter} is {value}, expected ")), "{complaint}");
        }
        assert!(judge(parameter, None).is_err_and(|complaint| complaint.contains("cannot be read")));
    }
}
