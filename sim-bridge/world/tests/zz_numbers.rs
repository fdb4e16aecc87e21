#![allow(missing_docs)]
mod flight;
use flight::*;
use skein_world::VehicleModel;
#[test]
fn numbers() {
    for name in ["x500", "crazyflie"] {
        let model = VehicleModel::built_in(name).unwrap();
        let mut f = Flight::ready(model.clone(), 5);
        println!("{name}: ready at {:?}", f.now());
        let t0 = f.now();
        f.take_off(3.0);
        println!("  takeoff 3 m: {:?}", f.now() - t0);
        f.run(2.0);
        // hover wander
        let (mut lo, mut hi) = (f.truth().motion.position, f.truth().motion.position);
        let mut vmax = 0.0_f64; let mut ratemax=0.0_f64;
        for _ in 0..500 { f.tick(); let m = f.truth().motion; lo = lo.inf(&m.position); hi = hi.sup(&m.position); vmax = vmax.max(m.velocity.norm()); ratemax=ratemax.max(m.angular_rate.norm()); }
        println!("  hover box {:?} vmax {vmax:.3} ratemax {ratemax:.3}", (hi - lo).as_slice());
        f.set_point = Some(velocity(0.0, 0.0, 0.0)); f.run(0.5);
        f.command(skein_mav::Command::Offboard); f.run(2.0);
        for v in [0.5, 1.0, 2.0] {
            let x0=f.truth().motion.position;
            f.set_point = Some(velocity(v, 0.0, 0.0));
            let (mut t63, mut t90, mut max) = (0.0, 0.0, 0.0_f64);
            for k in 1..=150 { f.tick(); let s = f.truth().motion.velocity.x; max = max.max(s); let t = k as f64*0.02; if t63==0.0 && s > 0.63*v {t63=t} if t90==0.0 && s>0.9*v {t90=t} }
            let _ = x0;
            f.set_point = Some(velocity(0.0,0.0,0.0));
            let p0=f.truth().motion.position; let mut back=0.0_f64; let mut stop=0.0;
            for k in 1..=150 { f.tick(); let s=f.truth().motion.velocity.x; back=back.min(s); if stop==0.0 && s<0.1*v {stop=k as f64*0.02} }
            println!("  v={v}: t63 {t63:.2} t90 {t90:.2} over {:.0}% ; stop t10 {stop:.2} back {back:.2} dist {:.2}", (max/v-1.0)*100.0, (f.truth().motion.position-p0).x);
        }
        f.set_point = Some(velocity(0.0, 0.0, 0.0)); f.run(3.0);
        let p = f.truth().motion.position;
        for _ in 0..1500 { f.tick(); }
        println!("  30 s of zero velocity drift {:.3}", (f.truth().motion.position - p).norm());
        let mut worst=[0.0_f64;3]; let mut sum=[0.0_f64;3]; let mut n=0.0;
        for r in 0..100 { let a = r as f64*0.7; f.set_point=Some(velocity(2.0*a.cos(),2.0*a.sin(),0.0)); for _ in 0..25 { f.tick(); let m=f.truth().motion; let h=f.telemetry();
            let e=[(h.position.unwrap().value-m.position).norm(),(h.velocity.unwrap().value-m.velocity).norm(),h.attitude.unwrap().value.angle_to(&m.attitude)];
            for i in 0..3 { worst[i]=worst[i].max(e[i]); sum[i]+=e[i]*e[i]; } n+=1.0; } }
        println!("  estimate rms {:?} worst {worst:?}", sum.map(|s| (s/n).sqrt()));
        let wall=std::time::Instant::now(); let n=20000; for _ in 0..n { f.tick(); } 
        println!("  {:.2} us per 4 ms step (whole world + companion)", wall.elapsed().as_secs_f64()*1e6/(n as f64*5.0));
        println!("  hash {:x?}", f.truth().motion.position.as_slice().iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    }
}
