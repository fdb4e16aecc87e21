//! From an operator's Hold in the console to the last vehicle's acknowledgement there.
//!
//! World, ground station and every agent run as processes over Zenoh on loopback; the operator is a WebSocket client of
//! the ground station's console, like a browser. A hold is acknowledged once its block is sure to be kept (G3).

use std::net::SocketAddr;
use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_sim::cli::{Exit, Network, Setup};
use skein_sim::processes::Processes;
use skein_sim::scenario::{Overrides, Scenario};

use crate::operator::Operator;
use crate::quantile::quantile;
use crate::task::Task;

/// Between two orders, a time that is no multiple of any period in the system.
const PAUSE: Duration = Duration::from_millis(137);

#[derive(Args)]
pub struct Holds {
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 8)]
    vehicles: usize,
    /// Times that it is held.
    #[arg(long, value_name = "N", default_value_t = 200)]
    holds: usize,
    /// Use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    port_offset: u16,
}

impl Task for Holds {
    const NAME: &'static str = "hold";
    const ABOUT: &'static str =
        "From an operator's Hold to the last vehicle's acknowledgement, each in a process of its own";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Self { vehicles, holds, port_offset } = *self;
        let overrides = Overrides { vehicles: Some(vehicles), ..Overrides::default() };
        // Nobody sets out there before everybody is in the air.
        let scenario = Scenario::open("antipodal", &overrides, 1)?;
        let folder = std::env::temp_dir().join(format!("skein-bench-hold-{}", std::process::id()));
        let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false, secure: false };
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
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(&times_ms, share));
        if as_json {
            let ack_ms = json!({ "p50": p50, "p99": p99, "max": max });
            println!("{}", json!({ "vehicles": vehicles, "holds": times_ms.len(), "ack_ms": ack_ms }));
        } else {
            println!(
                "Hold to the last of {vehicles} acknowledgements, {} times: median {p50:.1} ms, p99 {p99:.1} ms, longest {max:.1} ms",
                times_ms.len()
            );
        }
        Ok(Exit::Done)
    }
}

/// Times each hold in milliseconds, from the moment its order is sent.
fn measure(console: SocketAddr, vehicles: usize, holds: usize) -> anyhow::Result<Vec<f64>> {
    let mut operator = Operator::connect(console)?;
    operator.await_armed(vehicles)?;
    let all = json!("all");
    let mut times_ms = Vec::new();
    for _ in 0..holds {
        times_ms.push(operator.order("hold", &all)?.as_secs_f64() * 1000.0);
        // On hold, so that nobody arrives meanwhile.
        std::thread::sleep(PAUSE);
        operator.order("resume", &all)?;
    }
    Ok(times_ms)
}
