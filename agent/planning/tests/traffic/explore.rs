use super::places::Place;
use super::run::fly;

#[test]
fn explore() {
    let n: u64 = std::env::var("N").ok().and_then(|k| k.parse().ok()).unwrap_or(5);
    let first: u64 = std::env::var("S").ok().and_then(|k| k.parse().ok()).unwrap_or(0);
    for (name, make) in [("maze", Place::maze as fn(u64) -> Place), ("forest", Place::forest)] {
        if std::env::var("F").is_ok_and(|f| f != name) {
            continue;
        }
        let mut times = vec![];
        let mut closest = f64::INFINITY;
        let mut turns = 0;
        let mut exp = 0;
        let mut most = 0;
        let t = std::time::Instant::now();
        for seed in first..first + n {
            let o = fly(&make(seed), 400);
            closest = closest.min(o.closest);
            turns += o.turns;
            exp += o.expanded;
            most = most.max(o.most_expanded);
            match o.steps {
                Some(s) => times.push(s),
                None => eprintln!("{name} {seed} FAILED"),
            }
        }
        times.sort();
        eprintln!(
            "{name}: {}/{n} steps median {} max {} closest {:.3} m, exp mean {} most {most}, {:.2} ms/turn",
            times.len(),
            times[times.len() / 2],
            times[times.len() - 1],
            closest * 0.25,
            exp / turns,
            t.elapsed().as_secs_f64() * 1e3 / turns as f64
        );
    }
}
