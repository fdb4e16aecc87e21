//! From an operator's zone in the console to the last vehicle that keeps it, on its disk, as the console tells.
//!
//! World, ground station and every agent run as processes over Zenoh on loopback, as in the benchmark of holds. The
//! zones stand beside the swarm, which flies on.

use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_sim::cli::Exit;

use super::hold::{Swarm, with_operator};
use crate::quantile::quantile;
use crate::task::Task;

/// Between two changes of the map, a time that is no multiple of any period in the system.
const PAUSE: Duration = Duration::from_millis(137);

#[derive(Args)]
pub struct Zones {
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 20)]
    vehicles: usize,
    /// Zones that are drawn and removed, one after another.
    #[arg(long, value_name = "N", default_value_t = 50)]
    zones: usize,
    /// Use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    port_offset: u16,
}

impl Task for Zones {
    const NAME: &'static str = "zone";
    const ABOUT: &'static str =
        "From an operator's zone to the last vehicle that keeps it on its disk, each in a process of its own";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Self { vehicles, zones, port_offset } = *self;
        let measure = move |operator: &mut crate::operator::Operator| {
            let mut times_ms = Vec::new();
            // Nobody arrives meanwhile.
            operator.order("hold", &json!("all"))?;
            for number in 0..zones {
                let name = format!("zone-{number}");
                let zone =
                    json!({ "name": name, "kind": "no_fly", "centre_m": [500, number], "radius_m": 5 });
                times_ms.push(operator.draw(&zone)?.as_secs_f64() * 1000.0);
                std::thread::sleep(PAUSE);
                operator.erase(&name)?;
            }
            Ok(times_ms)
        };
        let swarm = Swarm { vehicles, disk: None, garbage: false, port_offset };
        let mut times_ms = with_operator("zone", swarm, measure)?.times_ms;
        times_ms.sort_by(f64::total_cmp);
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(&times_ms, share));
        if as_json {
            let kept_ms = json!({ "p50": p50, "p99": p99, "max": max });
            println!("{}", json!({ "vehicles": vehicles, "zones": times_ms.len(), "kept_ms": kept_ms }));
        } else {
            println!(
                "Zone to the last of {vehicles} vehicles that keeps it, {} times: median {p50:.1} ms, p99 {p99:.1} ms, \
                 longest {max:.1} ms",
                times_ms.len()
            );
        }
        Ok(Exit::Done)
    }
}
