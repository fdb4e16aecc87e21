//! The console, driven in a real browser beside real flights, and by whoever else may speak to it.
//!
//! The browser's part is in `tests/console`; it needs Node, Chromium (`SKEIN_CHROMIUM`, or `/usr/bin/chromium`) and
//! `npm ci` there. The flights are in real time, so they take turns.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::MutexGuard;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use skein_sim::summary::{Collisions, Outcome, Summary};
use skein_tests::skipped;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::turn::turn;

/// Other swarms on this computer keep their ports.
const PORT_OFFSET: &str = "3000";
/// No flight here takes longer.
const PATIENCE: Duration = Duration::from_secs(120);
/// The station speaks ten times a second.
const SILENCE: Duration = Duration::from_secs(10);

#[test]
fn hold_stops_and_resume_frees_the_swarm_while_ten_browsers_never_read() {
    let Some(browser) = Browser::find() else { return };
    let flight = Flight::start(&["antipodal", "--vehicles", "4"]);
    let deaf: Vec<Socket> = (0..10).map(|number| deaf_browser(&flight, number % 2 == 0)).collect();
    let reader = Reader::start(&flight);
    browser.run("hold.mjs", &flight);
    let (status, summary) = flight.end();
    assert!(status.success() && summary.succeeded, "{status}: {:?}", summary.reason);
    assert_eq!(summary.collisions, Collisions::default());
    assert!(summary.realtime_factor > 0.95, "{} of real time", summary.realtime_factor);
    reader.judge();
    drop(deaf);
}

#[test]
fn go_to_moves_one_vehicle_and_resume_brings_it_back_to_its_mission() {
    let Some(browser) = Browser::find() else { return };
    let flight = Flight::start(&["open"]);
    browser.run("go-to.mjs", &flight);
    let (status, summary) = flight.end();
    assert!(status.success() && summary.succeeded, "{status}: {:?}", summary.reason);
    assert_eq!(summary.collisions, Collisions::default());
}

#[test]
fn a_zone_is_drawn_by_clicks_confirmed_by_all_flown_round_and_removed() {
    let Some(browser) = Browser::find() else { return };
    let flight = Flight::start(&["open"]);
    browser.run("zone.mjs", &flight);
    let (status, summary) = flight.end();
    assert!(status.success() && summary.succeeded, "{status}: {:?}", summary.reason);
    assert_eq!(summary.collisions, Collisions::default());
}

#[test]
fn a_route_is_drawn_rehearsed_sent_read_back_and_changed_in_flight() {
    let Some(browser) = Browser::find() else { return };
    let field = browser.scripts.join("two-lanes.toml");
    let flight = Flight::start(&[field.to_str().unwrap()]);
    let health = flight.healthy();
    assert!(health.contains("200 OK") && health.contains("{\"ok\":true,\"age_ms\":"), "{health}");
    assert!(
        flight.get("/messages.ts").contains("export type ClientMessage ="),
        "what may be said is published"
    );
    browser.run("route.mjs", &flight);
    let (status, summary) = flight.end();
    assert!(status.success() && summary.succeeded, "{status}: {:?}", summary.reason);
    assert_eq!(summary.collisions, Collisions::default());
}

#[test]
fn without_webgl_some_are_sent_home_or_down_and_the_rest_fly_on() {
    let Some(browser) = Browser::find() else { return };
    let flight = Flight::start(&["open"]);
    browser.run("land-and-return.mjs", &flight);
    let (status, summary) = flight.end();
    assert_eq!(status.code(), Some(1), "not everybody arrived");
    assert_eq!(summary.collisions, Collisions::default());
    let ordered = Some("ordered by Anna".to_owned());
    let outcomes: Vec<_> = summary.per_vehicle.into_iter().map(|each| (each.outcome, each.reason)).collect();
    let down = (Outcome::LandedEarly, ordered);
    assert_eq!(outcomes, [down.clone(), down.clone(), down, (Outcome::Arrived, None)]);
}

#[test]
fn a_script_is_sent_from_a_file_and_withdrawn_and_all_land_together() {
    let Some(browser) = Browser::find() else { return };
    let flight = Flight::start(&["antipodal", "--vehicles", "4"]);
    browser.run("script-and-abort.mjs", &flight);
    let (status, summary) = flight.end();
    assert_eq!(status.code(), Some(1), "nobody arrived");
    assert_eq!(summary.collisions, Collisions::default());
    assert!(summary.per_vehicle.iter().all(|each| each.outcome == Outcome::LandedEarly));
}

#[test]
fn pages_of_others_are_refused_and_nonsense_orders_nothing() {
    let flight = Flight::start(&["open", "--vehicles", "1"]);
    let host = flight.host();
    let own = format!("http://{host}");
    for path in ["/", "/app.js", "/live"] {
        assert_eq!(flight.status_of(path, host, Some("http://evil.example")), 403, "{path}");
        assert_eq!(flight.status_of(path, host, Some("null")), 403, "{path}");
        assert_eq!(flight.status_of(path, "evil.example", None), 403, "{path}");
        assert_eq!(flight.status_of(path, "evil.example", Some("http://evil.example")), 403, "{path}");
        let welcome = if path == "/live" { 101 } else { 200 };
        assert_eq!(flight.status_of(path, host, Some(&own)), welcome, "{path}");
    }

    let deep = "[".repeat(50_000);
    let wide = format!(r#"{{"type":"order","what":"hold","to":"{}"}}"#, "x".repeat(1 << 20));
    for text in [
        "",
        "null",
        "{",
        "[]",
        r#"{"type":"order"}"#,
        r#"{"type":"order","what":"explode","to":"all"}"#,
        r#"{"type":"order","what":"hold","to":"some"}"#,
        r#"{"type":"order","what":"hold","to":[]}"#,
        r#"{"type":"order","what":"hold","to":["uav"]}"#,
        r#"{"type":"order","what":"launch","to":["uav/1"]}"#,
        r#"{"type":"order","what":"goto","to":"all"}"#,
        r#"{"type":"order","what":"goto","to":"all","point":[1e999,0,0]}"#,
        r#"{"type":"order","what":"goto","to":"all","point":[0,0]}"#,
        r#"{"type":"fleet","vehicles":[]}"#,
        &deep,
        &wide,
    ] {
        let mut socket = flight.socket();
        // The station may close the connection before all of it is sent.
        let _ = socket.send(Message::text(text));
        refuses(&mut socket, &text[..text.len().min(80)]);
    }
    let unmasked_text = [0x81, 2, b'{', b'}'];
    let no_utf8 = [0x81, 0x81, 0, 0, 0, 0, 0xff];
    let endless = [0x81, 0xff, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0];
    let unknown_kind = [0x83, 0x80, 0, 0, 0, 0];
    for bytes in [&unmasked_text[..], &no_utf8, &endless, &unknown_kind, b"GET / HTTP/1.1\r\n\r\n"] {
        let mut socket = flight.socket();
        plain(&mut socket).write_all(bytes).unwrap();
        refuses(&mut socket, &format!("{bytes:?}"));
    }

    // The station goes on, and nobody has ordered anything.
    let mut socket = flight.socket();
    let mut fleets = 0;
    while fleets < 5 {
        let message = next(&mut socket).unwrap();
        fleets += u32::from(message["type"] == "fleet");
        assert_ne!(message["orders"].as_array().map_or(0, Vec::len), 1, "{message}");
    }
}

/// The browser's part of the tests.
struct Browser {
    scripts: PathBuf,
}

impl Browser {
    /// What it needs, if it is there; says so if not.
    fn find() -> Option<Self> {
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("console");
        let node = Command::new("node").arg("--version").stdout(Stdio::null()).status();
        let chromium = std::env::var_os("SKEIN_CHROMIUM").unwrap_or_else(|| "/usr/bin/chromium".into());
        if !node.is_ok_and(|status| status.success()) {
            skipped("Node 20 or newer, as `node` on the path");
        } else if !Path::new(&chromium).is_file() {
            skipped("Chromium: SKEIN_CHROMIUM, or /usr/bin/chromium");
        } else if !scripts.join("node_modules/playwright-core").is_dir() {
            skipped("tests/console/node_modules: `npm ci` in tests/console");
        } else {
            return Some(Self { scripts });
        }
        None
    }

    /// Runs a script beside a flight.
    fn run(&self, script: &str, flight: &Flight) {
        let output = Command::new("node").arg(self.scripts.join(script)).arg(&flight.url).output().unwrap();
        let said = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
        assert!(output.status.success(), "{script}: {}\n{}", output.status, said.concat());
    }
}

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// A flight in real time by the real program, which is ended with the test.
struct Flight {
    program: Child,
    url: String,
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Flight {
    fn start(arguments: &[&str]) -> Self {
        let turn = turn();
        let folder = tempfile::tempdir().unwrap();
        let mut program = Command::new(skein_sim())
            .arg("fly")
            .args(arguments)
            .args(["--headless", "--console", "127.0.0.1:0", "--port-offset", PORT_OFFSET, "--out"])
            .arg(folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(program.stderr.take().unwrap()).lines();
        let url = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| Some(line.strip_prefix("console: ")?.to_owned()));
        // So that it never waits for somebody to read what it says.
        std::thread::spawn(move || {
            lines.map_while(Result::ok).for_each(|line| eprintln!("skein-sim: {line}"))
        });
        let flight = Self { program, url: url.unwrap_or_default(), folder, _turn: turn };
        assert!(flight.url.starts_with("http://127.0.0.1:"), "no console is announced: {:?}", flight.url);
        flight
    }

    /// Its exit status and its summary, once it has ended by itself.
    fn end(mut self) -> (ExitStatus, Summary) {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = self.program.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "the flight does not end");
            std::thread::sleep(Duration::from_millis(20));
        };
        let summary = std::fs::read(self.folder.path().join("summary.json")).unwrap();
        (status, serde_json::from_slice(&summary).unwrap())
    }

    fn host(&self) -> &str {
        self.url.strip_prefix("http://").unwrap()
    }

    fn socket(&self) -> Socket {
        let (mut socket, _) = tungstenite::connect(format!("ws://{}/live", self.host())).unwrap();
        plain(&mut socket).set_read_timeout(Some(SILENCE)).unwrap();
        socket
    }

    /// The answer of the health end-point once the station works: it listens before it has done its first step.
    fn healthy(&self) -> String {
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            let said = self.get("/health");
            if said.contains("200 OK") || Instant::now() > deadline {
                return said;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// All that is answered to a request for `path`.
    fn get(&self, path: &str) -> String {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.host()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    /// The status of the answer to a browser that asks for `path` with these headers.
    fn status_of(&self, path: &str, host: &str, origin: Option<&str>) -> u16 {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        let origin = origin.map(|origin| format!("Origin: {origin}\r\n")).unwrap_or_default();
        let upgrade = if path == "/live" {
            "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        } else {
            "Connection: close\r\n"
        };
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n{origin}{upgrade}\r\n").unwrap();
        let mut head = [0; 12];
        stream.read_exact(&mut head).unwrap();
        let head = String::from_utf8_lossy(&head);
        head.strip_prefix("HTTP/1.1 ")
            .and_then(|status| status.parse().ok())
            .unwrap_or_else(|| panic!("{head:?}"))
    }
}

impl Drop for Flight {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// The program, which is built beside this test: `cargo test --workspace` does so, for the program's own tests.
fn skein_sim() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let program = test.ancestors().nth(2).unwrap().join(format!("skein-sim{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is not built: use `cargo test --workspace`", program.display());
    program
}

fn plain(socket: &mut Socket) -> &mut TcpStream {
    match socket.get_mut() {
        MaybeTlsStream::Plain(stream) => stream,
        _ => unreachable!("the console speaks plain HTTP"),
    }
}

/// The next message; `None` once the connection is closed.
fn next(socket: &mut Socket) -> Option<Value> {
    loop {
        match socket.read() {
            Ok(Message::Text(text)) => return Some(serde_json::from_str(&text).unwrap()),
            Ok(_) => {}
            Err(error) if has_waited(&error) => panic!("the station has said nothing for {SILENCE:?}"),
            Err(_) => return None,
        }
    }
}

/// Whether a time limit has passed.
fn has_waited(error: &tungstenite::Error) -> bool {
    use std::io::ErrorKind::{TimedOut, WouldBlock};
    matches!(error, tungstenite::Error::Io(error) if matches!(error.kind(), WouldBlock | TimedOut))
}

/// Reads until the station says what is wrong or closes the connection.
fn refuses(socket: &mut Socket, what: &str) {
    let deadline = Instant::now() + Duration::from_secs(5);
    while let Some(message) = next(socket) {
        assert_ne!(message["type"], "ordered", "{what}");
        if message["type"] == "error" {
            assert!(
                message["message"].as_str().is_some_and(|message| !message.is_empty()),
                "{what}: {message}"
            );
            return;
        }
        assert!(Instant::now() < deadline, "{what}: neither refused nor cut off");
    }
}

/// A browser that never reads. One that is `talking` has been asking for nonsense until its answers fill every buffer
/// on the way, so that the station's next word to it has to wait.
fn deaf_browser(flight: &Flight, talking: bool) -> Socket {
    let mut socket = flight.socket();
    if talking {
        plain(&mut socket).set_write_timeout(Some(Duration::from_millis(200))).unwrap();
        // The answer quotes it.
        let nonsense = json!({ "type": "order", "what": "hold", "to": "x".repeat(60_000) }).to_string();
        let stuck = (0..2_000).find_map(|_| socket.send(Message::text(nonsense.as_str())).err());
        assert!(stuck.as_ref().is_some_and(has_waited), "the station does not wait for it: {stuck:?}");
    }
    socket
}

/// A browser beside the others that reads.
struct Reader {
    heard: JoinHandle<Heard>,
}

/// What it has heard.
#[derive(Default)]
struct Heard {
    fleets: Vec<Instant>,
    orders: Value,
}

impl Reader {
    fn start(flight: &Flight) -> Self {
        let mut socket = flight.socket();
        let heard = std::thread::spawn(move || {
            let mut heard = Heard::default();
            while let Some(mut message) = next(&mut socket) {
                match message["type"].as_str() {
                    Some("fleet") => heard.fleets.push(Instant::now()),
                    Some("orders") => heard.orders = message["orders"].take(),
                    _ => {}
                }
            }
            heard
        });
        Self { heard }
    }

    /// It was told of the swarm ten times a second, and of a hold and a resume that everyone acknowledged at once.
    fn judge(self) {
        let Heard { fleets, orders } = self.heard.join().unwrap();
        let gaps: Vec<_> = fleets.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = gaps.iter().sum::<Duration>().as_secs_f64() / gaps.len() as f64;
        assert!(fleets.len() > 200 && (0.09..0.11).contains(&mean), "{} times, each {mean} s", fleets.len());
        assert!(gaps.iter().all(|gap| *gap < Duration::from_secs(1)), "{:?}", gaps.iter().max());

        let orders = orders.as_array().unwrap();
        let what: Vec<_> = orders.iter().map(|order| order["what"].as_str().unwrap()).collect();
        assert_eq!(what, ["hold", "resume"]);
        for order in orders {
            let answers = order["answers"].as_object().unwrap();
            assert_eq!(answers.len(), 4, "{order}");
            for answer in answers.values() {
                assert!(answer["after_ms"].as_f64().is_some_and(|after| after < 1000.0), "{order}");
            }
        }
    }
}
