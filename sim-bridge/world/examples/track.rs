use std::time::Duration;
use nalgebra::Vector3;
use skein_mav::{Command, Companion, CompanionConfig, FlightMode, SetPoint};
use skein_world::*;
fn main() {
    let a: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let (vsig, rate, kp, lag, ticks, mode, kv, psig) = (a[0], a[1], a[2], a[3], a[4] as u32, a[5] as i32, a[6], a[7]);
    // speeds pattern per step
    let mut pat: Vec<[i32;2]> = vec![[0,0]];
    for r in 0..3 { pat.extend([[1,0],[1,0],[0,1],[1,0],[1,0],[0,1],[0,1],[-1,0],[-1,0],[0,0],[1,0],[0,0],[0,-1],[0,-1],[0,0],[0,0],[0,0]]); let _ = r; }
    pat.extend([[0,0]; 6]);
    let mut cmd_sum = vec![];
    let mut devs = vec![]; let mut hov = vec![]; let mut curve: Vec<Vec<(f64,f64)>> = vec![];
    for seed in 0..6u64 {
        let mut model = VehicleModel::built_in("crazyflie").unwrap();
        model.gps.sigma_horizontal_m = psig; model.gps.sigma_vertical_m = psig; model.gps.sigma_velocity_m_s = vsig; model.gps.rate_hz = rate;
        let scene = Scene::new("x", vec![]); let datum = *scene.datum();
        let mut sim = Simulation::new(SimulationConfig { scene, vehicles: vec![VehicleSetup { model, position: Vector3::new(1.0,2.0,0.0), yaw: 0.0, system_id: 1 }], seed, wind: WindConfig::default() });
        let mut c = Companion::new(CompanionConfig::new(1, datum));
        let start = Vector3::new(1.0,2.0,1.0);
        let mut exp = start; let mut cmd = Vector3::zeros(); let mut asked = Duration::ZERO; let mut t0 = None; let mut pm = start; let mut vm = Vector3::<f64>::zeros();
        let mut path = vec![];
        for tick in 0..20000u32 {
            for _ in 0..5 { sim.step(); c.receive(sim.now(), &sim.receive(0)); }
            while c.poll_event().is_some() {}
            let now = sim.now(); c.tick(now);
            let t = c.telemetry().clone();
            let Some(p) = t.position else { sim.send(0, &c.take_output()); continue };
            let wish = match t.mode { _ if !t.armed => t.ready_to_arm.then_some(Command::Arm), FlightMode::Takeoff | FlightMode::Offboard => None, FlightMode::Hold if (p.value.z-1.0).abs()<0.15 => Some(Command::Offboard), _ => Some(Command::Takeoff { height_m: 1.0 }) };
            if let Some(w) = wish { if now > asked + Duration::from_secs(1) { c.command(now, w); asked = now; } }
            let (mut rp, mut rv) = (start, Vector3::zeros()); let mut ra = Vector3::<f64>::zeros();
            if t.mode == FlightMode::Offboard { let t0 = *t0.get_or_insert(tick + 150); if tick >= t0 {
                let k = ((tick - t0) / ticks) as usize; let ph = f64::from((tick - t0) % ticks) / f64::from(ticks);
                if k + 1 >= pat.len() { break; }
                let mut pos = Vector3::<f64>::zeros();
                for i in 0..k { for x in 0..2 { pos[x] += f64::from(pat[i][x] + pat[i+1][x]); } }
                let ts = f64::from(ticks)*0.02;
                for x in 0..2 { let (s,n) = (f64::from(pat[k][x]), f64::from(pat[k+1][x])); rp[x] = start[x] + 0.25*(pos[x] + ph*(2.0*s + ph*(n-s))); rv[x] = (s + ph*(n-s))*0.5/ts; ra[x] = (n-s)*0.5/ts/ts; }
            } }
            let _ = ra;
            // model: mode 0 first order, 1 second order
            if mode == 0 { exp += (rp - exp) * (0.02/lag); } else { pm += (rp - pm) * (0.02/(lag*0.6)); exp += (pm - exp) * (0.02/(lag*0.4)); }
            vm += (rv - vm) * (0.02/lag);
            let err = exp - p.value; let verr = vm - t.velocity.unwrap().value;
            let w = rv + err*kp + verr*kv;
            for x in 0..2 { let d = 2.0*0.02; cmd[x] = (cmd[x] + (w[x]-cmd[x]).clamp(-d,d)).clamp(-1.0f64,1.0); }
            c.set_point(now, SetPoint::Planar { vx: cmd.x, vy: cmd.y, z: 1.0, yaw: None });
            sim.send(0, &c.take_output());
            let truth = sim.vehicle(0).unwrap().motion.position;
            if let Some(t0) = t0 { if tick >= t0 { devs.push((truth - exp).xy().norm()); path.push((truth.x, truth.y)); cmd_sum.push(cmd.amax()); } else if tick + 100 >= t0 { hov.push((truth-start).xy().norm()); } }
        }
        curve.push(path);
    }
    // spread between seeds (noise part)
    let n = curve.iter().map(Vec::len).min().unwrap(); let mut spread = vec![];
    for i in 0..n { for a in 0..curve.len() { for b in 0..a { let (p,q)=(curve[a][i],curve[b][i]); spread.push(((p.0-q.0).powi(2)+(p.1-q.1).powi(2)).sqrt()); } } }
    let q = |v: &mut Vec<f64>, s: f64| { v.sort_by(f64::total_cmp); v[((v.len()-1) as f64*s) as usize] };
    println!("{a:?}: dev median {:.3} p99 {:.3} max {:.3}; hover p50 {:.3} max {:.3}; pair spread p50 {:.3} p99 {:.3} max {:.3}", q(&mut devs,0.5), q(&mut devs,0.99), q(&mut devs,1.0), q(&mut hov,0.5), q(&mut hov,1.0), q(&mut spread,0.5), q(&mut spread,0.99), q(&mut spread,1.0));
}
