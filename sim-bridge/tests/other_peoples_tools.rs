//! Tools that others wrote read what Skein writes, and fly what it simulates; scripts of one's own take part.

use std::io::{Read as _, Write as _};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::turn::turn;

/// The Python that has the packages of `tests/python/requirements.txt`: `SKEIN_PYTHON`, or `python3`.
fn python_with(packages: &str) -> Option<String> {
    let python = std::env::var("SKEIN_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found =
        Command::new(&python).args(["-c", &format!("import {packages}")]).stderr(Stdio::null()).status();
    if found.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    let _ = writeln!(std::io::stderr(), "skipped: needs Python with {packages}");
    None
}

/// Runs a script that starts the simulator itself, if there is a Python that has what it needs.
fn run_script(name: &str, packages: &str) {
    let Some(python) = python_with(packages) else { return };
    let _turn = turn();
    let status = Command::new(python)
        .arg(script(name))
        .env("SKEIN_SIM", env!("CARGO_BIN_EXE_skein-sim"))
        .status()
        .expect("python starts");
    assert!(status.success());
}

fn script(name: &str) -> String {
    format!("{}/../tests/python/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// A program that is ended with the test.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn pymavlink_arms_takes_off_flies_offboard_and_lands() {
    run_script("test_mavlink.py", "pymavlink");
}

#[test]
fn two_stations_with_pymavlink_are_told_the_truth() {
    run_script("test_stations.py", "pymavlink");
}

#[test]
fn mavsdk_uploads_and_reads_back_missions_fences_and_parameters() {
    run_script("test_mavsdk_missions.py", "mavsdk");
}

#[test]
fn mavsdk_attaches_to_a_flying_vehicle() {
    run_script("test_mavsdk.py", "mavsdk");
}

#[test]
fn a_pilot_with_pymavlink_gets_the_vehicle_at_once() {
    run_script("test_pilot.py", "pymavlink, zenoh, google.protobuf, grpc_tools");
}

#[test]
fn an_operators_script_lists_watches_holds_and_orders() {
    run_script("test_operator.py", "zenoh, google.protobuf, grpc_tools");
}

#[test]
fn pdfium_and_opencv_read_printed_markers_and_a_photograph_tells_where_it_was_taken() {
    run_script("test_markers.py", "cv2.aruco, pypdfium2");
}

#[test]
fn pypi_mcap_reads_a_mission() {
    let Some(python) = python_with("mcap_protobuf") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let flown = Command::new(env!("CARGO_BIN_EXE_skein-sim"))
        .args(["fly", "window", "--clock", "lockstep", "--headless", "--out"])
        .arg(folder.path())
        .status()
        .expect("the program starts");
    assert!(flown.success());
    let read = Command::new(python)
        .arg(script("test_mcap.py"))
        .arg(folder.path().join("mission.mcap"))
        .status()
        .expect("python starts");
    assert!(read.success());
}

#[test]
fn garbage_on_a_mavlink_socket_has_no_effect() {
    let _turn = turn();
    let mut serve = Ended(
        Command::new(env!("CARGO_BIN_EXE_skein-sim"))
            .args(["serve", "open", "--vehicles", "1"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts"),
    );
    // Its first word is that the port is open.
    let mut first = [0; 4];
    serve.0.stdout.as_mut().expect("piped").read_exact(&mut first).expect("it says where it listens");
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.set_read_timeout(Some(Duration::from_secs(1))).expect("a time-out");
    let mut number = 12_345_u32;
    for length in 0..300 {
        let garbage: Vec<u8> = (0..length)
            .map(|index| {
                number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Some of it begins as a frame does.
                if index == 0 && length % 3 == 0 { 0xFD } else { (number >> 24) as u8 }
            })
            .collect();
        socket.send_to(&garbage, "127.0.0.1:14580").expect("sent");
    }
    let began = Instant::now();
    let mut datagram = [0; 2048];
    let mut heard = 0;
    while heard < 50 && began.elapsed() < Duration::from_secs(20) {
        heard += u32::from(socket.recv(&mut datagram).is_ok_and(|length| length > 8 && datagram[0] == 0xFD));
    }
    assert_eq!(heard, 50, "the autopilot goes on speaking");
    assert!(serve.0.try_wait().expect("its state").is_none(), "the program goes on");
}
