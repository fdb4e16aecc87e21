//! Box tables: what is read and what is refused.

use std::path::Path;

use nalgebra::Vector3;
use proptest::prelude::*;
use skein_world::{Scene, Shape};

fn refuse(text: &str) -> String {
    Scene::from_csv(text, "boxes.csv").expect_err("an unsound table").to_string()
}

#[test]
fn reads_centres_and_sizes() {
    let text = "x, y, z, dx, dy, dz\r\n\n# pillars\n1,2,1.25,0.5,0.5,2.5\r\n -1 , 0,1,2,2,2\n";
    let scene = Scene::from_csv(text, "boxes.csv").expect("a sound table");
    let obstacles = scene.obstacles();
    assert_eq!(obstacles.len(), 2);
    assert_eq!(obstacles[0].pose.translation.vector, Vector3::new(1.0, 2.0, 1.25));
    assert_eq!(obstacles[0].shape, Shape::Box { half_extents: Vector3::new(0.25, 0.25, 1.25) });
    assert_eq!((scene.name(), obstacles[1].name.as_str()), ("boxes.csv", "box 2"));
}

#[test]
fn errors_name_line_column_and_expectation() {
    let cases = [
        ("1,2,3,1,1\n", "boxes.csv:1:10: expected `dz`, found the line's end"),
        ("1,2,3,1,1,1\n1, two,3,1,1,1\n", "boxes.csv:2:4: expected `y`, a number, found `two`"),
        ("1,2,3,1,0,1\n", "boxes.csv:1:9: expected `dy`, a size above 0, found `0`"),
        ("1,2,3,1,-1,1\n", "boxes.csv:1:9: expected `dy`, a size above 0, found `-1`"),
        ("nan,2,3,1,1,1\n", "boxes.csv:1:1: expected `x`, a number, found `nan`"),
        ("1,2,3,1,1,inf\n", "boxes.csv:1:11: expected `dz`, a size above 0, found `inf`"),
        ("1,2,3,1,1,1,9\n", "boxes.csv:1:13: expected the line's end after `dz`"),
        ("1,,3,1,1,1\n", "boxes.csv:1:3: expected `y`, a number, found ``"),
    ];
    for (text, expected) in cases {
        let message = refuse(text);
        assert!(message.starts_with(expected), "{message}");
        assert!(message.contains("x,y,z,dx,dy,dz"), "{message}");
    }
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "(.|\n){0,100}") {
        let _ = Scene::from_csv(&text, "any");
    }

    #[test]
    fn what_is_written_is_read(rows in prop::collection::vec((-9.0..9.0, 0.1..9.0), 0..9)) {
        let text: String = rows
            .iter()
            .map(|(place, size)| format!("{place},{place},{place},{size},{size},{size}\n"))
            .collect();
        let scene = Scene::from_csv(&text, "any").expect("a sound table");
        let read: Vec<(f64, f64)> = scene
            .obstacles()
            .iter()
            .map(|o| match o.shape {
                Shape::Box { half_extents } => (o.pose.translation.x, half_extents.x * 2.0),
                _ => (f64::NAN, f64::NAN),
            })
            .collect();
        prop_assert_eq!(read, rows);
    }
}

/// The published worlds, where they are at hand.
#[test]
fn published_tables_are_read() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/lsc/world"));
    if !folder.exists() {
        println!("skipped: needs ../shared/data");
        return;
    }
    for name in ["forest/forest10.csv", "maze/dense/maze1.csv"] {
        let text = std::fs::read_to_string(folder.join(name)).expect("a readable file");
        let scene = Scene::from_csv(&text, name).expect("a sound table");
        assert_eq!(scene.obstacles().len(), text.lines().count(), "{name}");
    }
}
