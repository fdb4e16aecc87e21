use super::places::{Boxes, roads};
use super::run::fly;
use nalgebra::{Vector2, Vector3};
use std::path::PathBuf;

fn numbers(text: &str) -> Vec<f64> {
    text.split(',').map(|n| n.trim().parse().unwrap()).collect()
}

pub fn load(family: &str, k: usize) -> ([Vector2<f64>; 2], Boxes, Vec<(Vector3<f64>, Vector3<f64>)>) {
    let root = PathBuf::from("/work/shared/data/lsc");
    let (m, w) = if family == "forest" {
        (format!("missions/forest10/forest10_{k}.json"), format!("world/forest/forest{k}.csv"))
    } else {
        (format!("missions/maze10_dense/maze10_{k}.json"), format!("world/maze/dense/maze{k}.csv"))
    };
    let text = std::fs::read_to_string(root.join(m)).unwrap();
    let text: String = text.lines().map(|l| l.split('#').next().unwrap()).collect::<Vec<_>>().join("\n");
    let arr = |after: &str, from: usize| {
        let i = text[from..].find(after)? + from + after.len();
        let a = text[i..].find('[').unwrap() + i + 1;
        let b = text[a..].find(']').unwrap() + a;
        Some((numbers(&text[a..b]), b))
    };
    let (d, _) = arr("\"dimension\"", 0).unwrap();
    let mut agents = vec![];
    let mut at = 0;
    while let Some((s, e)) = arr("\"start\"", at) {
        let (g, e2) = arr("\"goal\"", e).unwrap();
        agents.push((Vector3::new(s[0], s[1], s[2]), Vector3::new(g[0], g[1], g[2])));
        at = e2;
    }
    let boxes = std::fs::read_to_string(root.join(w))
        .unwrap()
        .lines()
        .filter(|l| !l.is_empty())
        .map(|l| {
            let n = numbers(l);
            (Vector2::new(n[0], n[1]), Vector2::new(n[3], n[4]))
        })
        .collect();
    ([Vector2::new(d[0], d[1]), Vector2::new(d[3], d[4])], boxes, agents)
}

#[test]
fn explore() {
    let only: Option<usize> = std::env::var("K").ok().and_then(|k| k.parse().ok());
    for family in ["forest", "maze"] {
        if std::env::var("F").is_ok_and(|f| f != family) {
            continue;
        }
        for k in 1..=15 {
            if only.is_some_and(|o| o != k) {
                continue;
            }
            let (bounds, boxes, agents) = load(family, k);
            let z = if std::env::var("D3").is_ok() { [0.5, 2.2] } else { [1.0, 1.0] };
            let roads = roads(bounds, z, agents[0].0, boxes);
            let t = std::time::Instant::now();
            let o = fly(&roads, &agents, 400);
            eprintln!(
                "{family}{k} steps {:?} time {:.1} closest {:.3} turns {} mean exp {} max {} wall/turn {:.2} ms",
                o.steps,
                f64::from(o.steps.unwrap_or(0)) * 0.52,
                o.closest * 0.25,
                o.turns,
                o.expanded / o.turns,
                o.most_expanded,
                t.elapsed().as_secs_f64() * 1e3 / o.turns as f64
            );
        }
    }
}
