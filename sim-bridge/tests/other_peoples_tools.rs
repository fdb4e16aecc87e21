//! Tools that others wrote read what Skein writes, and fly what it simulates.
//!
//! The tests share the UDP ports of `serve`, so they take turns.

#![allow(clippy::expect_used)]

use std::io::{Read as _, Write as _};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

static PORTS: Mutex<()> = Mutex::new(());

/// The Python that has the packages of `tests/python/requirements.txt`: `SKEIN_PYTHON`, or `python3`.
fn python_with(package: &str) -> Option<String> {
    let python = std::env::var("SKEIN_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found =
        Command::new(&python).args(["-c", &format!("import {package}")]).stderr(Stdio::null()).status();
    if found.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    let _ = writeln!(std::io::stderr(), "skipped: needs Python with {package}");
    None
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
    let Some(python) = python_with("pymavlink") else { return };
    let _turn = PORTS.lock().unwrap_or_else(PoisonError::into_inner);
    let status = Command::new(python)
        .arg(script("test_mavlink.py"))
        .env("SKEIN_SIM", env!("CARGO_BIN_EXE_skein-sim"))
        .status()
        .expect("python starts");
    assert!(status.success());
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
    let _turn = PORTS.lock().unwrap_or_else(PoisonError::into_inner);
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
