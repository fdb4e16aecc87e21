//! From an operator's Hold in the console to the last vehicle's acknowledgement there.
//!
//! World, ground station and every agent run as processes over Zenoh on loopback; the operator is a WebSocket client of
//! the ground station's console, like a browser. A hold is acknowledged once its block is sure to be kept (G3).

use std::net::TcpStream;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket, stream::MaybeTlsStream};

use crate::cli::Network;
use crate::processes::{Processes, Setup};
use crate::scenario::{Overrides, Scenario};

/// How long the swarm may take to be in the air, and an order to be acknowledged.
const PATIENCE: Duration = Duration::from_secs(120);
/// Between two orders, a time that is no multiple of any period in the system.
const PAUSE: Duration = Duration::from_millis(137);

pub(super) fn run(vehicles: usize, holds: usize, port_offset: u16, as_json: bool) -> anyhow::Result<()> {
    let overrides = Overrides { vehicles: Some(vehicles), ..Overrides::default() };
    // Nobody sets out there before everybody is in the air.
    let scenario = Scenario::open("antipodal", &overrides, 1)?;
    let folder = std::env::temp_dir().join(format!("skein-bench-hold-{}", std::process::id()));
    let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false };
    let mut swarm = Processes::start(&scenario, &folder, setup)?;
    let console = swarm.console();
    let operator = std::thread::spawn(move || measure(console, vehicles, holds));
    while !operator.is_finished() {
        swarm.step();
    }
    let measured = operator.join().map_err(|_| anyhow::anyhow!("the operator's thread has panicked"))?;
    drop(swarm);
    // What is left there is of no use to anybody.
    let _ = std::fs::remove_dir_all(&folder);
    let mut times_ms = measured?;
    times_ms.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let rank = (times_ms.len() as f64 * share).ceil() as usize;
        times_ms.get(rank.saturating_sub(1)).copied().unwrap_or_default()
    };
    let (p50, p99, max) = (at(0.5), at(0.99), at(1.0));
    if as_json {
        println!(
            "{}",
            json!({ "vehicles": vehicles, "holds": times_ms.len(), "ack_ms": { "p50": p50, "p99": p99, "max": max } })
        );
    } else {
        println!(
            "Hold to the last of {vehicles} acknowledgements, {} times: median {p50:.1} ms, p99 {p99:.1} ms, longest {max:.1} ms",
            times_ms.len()
        );
    }
    Ok(())
}

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

/// Times each hold in milliseconds, from the moment its order is sent.
fn measure(console: std::net::SocketAddr, vehicles: usize, holds: usize) -> anyhow::Result<Vec<f64>> {
    let mut socket = connect(console)?;
    let deadline = Instant::now() + PATIENCE;
    loop {
        ensure!(Instant::now() < deadline, "the swarm was not in the air within {} s", PATIENCE.as_secs());
        let message = next(&mut socket)?;
        let armed =
            message["vehicles"].as_array().map(|all| all.iter().filter(|v| v["armed"] == true).count());
        if message["type"] == "fleet" && armed == Some(vehicles) {
            break;
        }
    }
    let mut times_ms = Vec::new();
    for _ in 0..holds {
        times_ms.push(order(&mut socket, "hold")?.as_secs_f64() * 1000.0);
        // On hold, so that nobody arrives meanwhile.
        std::thread::sleep(PAUSE);
        order(&mut socket, "resume")?;
    }
    Ok(times_ms)
}

fn connect(console: std::net::SocketAddr) -> anyhow::Result<Socket> {
    let deadline = Instant::now() + PATIENCE;
    loop {
        match tungstenite::connect(format!("ws://{console}/live")) {
            Ok((socket, _)) => {
                if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
                    stream.set_nodelay(true)?;
                }
                return Ok(socket);
            }
            Err(error) if Instant::now() > deadline => {
                return Err(error).context("the console does not answer");
            }
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
        }
    }
}

/// Gives an order to all; returns how long it took until all had acknowledged it.
fn order(socket: &mut Socket, what: &str) -> anyhow::Result<Duration> {
    let began = Instant::now();
    let order = json!({ "type": "order", "tag": what, "what": what, "to": "all" });
    socket.send(Message::text(order.to_string()))?;
    let mut number = None;
    let mut newest = Value::Null;
    while began.elapsed() < PATIENCE {
        let message = next(socket)?;
        match message["type"].as_str() {
            Some("ordered") => number = Some(message["id"].clone()),
            Some("orders") => {
                newest = message["orders"].as_array().and_then(|all| all.last()).cloned().unwrap_or_default()
            }
            _ => continue,
        }
        let answers = newest["answers"].as_object();
        let all = answers.is_some_and(|all| all.values().all(|answer| answer["state"] == "acknowledged"));
        if number.as_ref() == Some(&newest["id"]) && all {
            return Ok(began.elapsed());
        }
    }
    anyhow::bail!("`{what}` was not acknowledged by all: {newest}")
}

fn next(socket: &mut Socket) -> anyhow::Result<Value> {
    loop {
        if let Message::Text(text) = socket.read()? {
            return Ok(serde_json::from_str(&text)?);
        }
    }
}
