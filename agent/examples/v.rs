use std::time::{Duration, Instant};
use skein_agent::*; use skein_agent::bthreads::LinkLossPolicy; use skein_agent::verify::*;
use skein_mav::Datum;
fn main() {
    let config = AgentConfig {
        fleet: "t".into(), node: "uav/1".into(), ground: "ground/main".into(),
        roster: ["uav/1","uav/2","ground/main"].map(str::to_owned).to_vec(), incarnation: 1, system_id: 1,
        datum: Datum::from_degrees(47.4, 8.5, 400.0), home: [0.0; 3],
        waypoints: vec![[50.0, 0.0, 3.0],[0.0,0.0,3.0]], takeoff_height_m: 2.0, return_altitude_m: 4.0, lidar: true,
        fence: Fence { min: [-60.0, -60.0, -1.0], max: [60.0, 60.0, 20.0] }, envelope: Envelope::default(),
        link_loss: LinkLossPolicy::Return, controller: Controller::Bp, scripts: Vec::new(), lease: Duration::from_secs(1),
        authority: skein_wire::standard_authority(), kept: skein_dbp::Kept::default(), seed: 1 };
    let most: usize = std::env::args().nth(1).map_or(200_000, |a| a.parse().unwrap());
    let only = std::env::args().nth(2);
    let v = VehicleVerifier::new(&config).unwrap().most_states(most);
    let mut all = vec![];
    for scene in v.scenes() {
        if only.as_deref().is_some_and(|o| o != scene.name()) { continue }
        let t = Instant::now();
        let r = v.verify(scene, |_| {});
        println!("== {scene}: {:.1} s, burst {:?}\n{}", t.elapsed().as_secs_f64(), r.report.longest_burst, r.report);
        if std::env::var("T").is_ok() { let mut n: Vec<_> = r.coverage.bthreads.iter().map(|(n,c)| (c.states, n)).collect(); n.sort(); println!("{n:?}"); }
        all.push(r);
    }
    println!("{:#?}", v.not_covered(&all));
}
