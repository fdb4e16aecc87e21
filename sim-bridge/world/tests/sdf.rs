//! Gazebo worlds: what is read, what is warned of, what is refused.

use std::path::Path;

use nalgebra::Vector3;
use proptest::prelude::*;
use skein_world::{NoFiles, Reading, Scene, SdfError, Shape};

fn world(content: &str) -> String {
    format!("<sdf version='1.6'>\n<world name='w'>\n{content}\n</world>\n</sdf>")
}

fn read(content: &str) -> (Scene, Vec<String>) {
    noted(Scene::from_sdf(&world(content), "test.world", &NoFiles).expect("a sound world"))
}

/// A scene of which nothing is missing, and what is said about it.
fn noted(reading: Reading) -> (Scene, Vec<String>) {
    let (scene, account) = reading.whole().expect("a whole world");
    (scene, account.notes().map(ToString::to_string).collect())
}

fn refuse(text: &str) -> String {
    Scene::from_sdf(text, "test.world", &NoFiles).expect_err("an unsound world").to_string()
}

fn model(pose: &str, geometry: &str) -> String {
    format!(
        "<model name='m'><static>true</static>{pose}<link name='l'><collision name='c'>\
         <geometry>{geometry}</geometry></collision></link></model>"
    )
}

const GROUND: &str = "<include><uri>model://ground_plane</uri></include>";

#[test]
fn reads_every_supported_shape() {
    let content = [
        GROUND.to_owned(),
        model("", "<box><size>1 2 3</size></box>"),
        model("", "<cylinder><radius>0.5</radius><length>4</length></cylinder>"),
        model("", "<sphere><radius>2</radius></sphere>"),
        model(
            "<pose>0 0 9 3.14159265358979 0 0</pose>",
            "<plane><normal>0 0 1</normal><size>9 9</size></plane>",
        ),
    ]
    .concat();
    let (scene, warnings) = read(&content);
    assert_eq!(warnings, Vec::<String>::new());
    let shapes: Vec<Shape> = scene.obstacles().iter().map(|o| o.shape.clone()).collect();
    assert_eq!(
        shapes,
        [
            Shape::Box { half_extents: Vector3::new(0.5, 1.0, 1.5) },
            Shape::Cylinder { radius: 0.5, half_height: 2.0 },
            Shape::Sphere { radius: 2.0 },
            Shape::Plane { normal: Vector3::z_axis() },
        ]
    );
    assert_eq!(scene.name(), "w");
    assert_eq!(scene.obstacles()[0].name, "m::l::c");
    // The plane hangs upside down at 9 m: a ceiling.
    let below_ceiling = scene.clearance(&Vector3::new(30.0, 0.0, 8.0));
    assert!((below_ceiling - 1.0).abs() < 1e-9);
}

#[test]
fn poses_of_nested_models_links_and_collisions_compose() {
    let content = "<model name='outer'><static>1</static><pose>10 0 0 0 0 1.5707963267948966</pose>\
         <model name='inner'><pose>2 0 0 0 0 0</pose><link name='l'><pose>0 1 0 0 0 0</pose>\
         <collision name='c'><pose>0 0 3 0 0 0</pose><geometry><sphere><radius>1</radius></sphere>\
         </geometry></collision></link></model></model>";
    let (scene, _) = read(content);
    let centre = scene.obstacles()[0].pose.translation.vector;
    assert!((centre - Vector3::new(9.0, 2.0, 3.0)).norm() < 1e-12, "{centre}");
    assert_eq!(scene.obstacles()[0].name, "outer::inner::l::c");
}

#[test]
fn a_level_plane_at_zero_is_the_ground_and_no_obstacle() {
    let (scene, warnings) = read(&model("", "<plane><normal>0 0 1</normal></plane>"));
    assert!(scene.obstacles().is_empty());
    assert_eq!(warnings, Vec::<String>::new());
}

#[test]
fn rotations_in_degrees_and_quaternions_are_read() {
    let lying = "<cylinder><radius>0.1</radius><length>4</length></cylinder>";
    for pose in [
        "<pose degrees='true'>0 0 1 0 90 0</pose>",
        "<pose rotation_format='quat_xyzw'>0 0 1 0 0.70710678118 0 0.70710678118</pose>",
    ] {
        let (scene, _) = read(&model(pose, lying));
        let clearance = scene.clearance(&Vector3::new(3.0, 0.0, 1.0));
        assert!((clearance - 1.0).abs() < 1e-6, "{pose}: {clearance}");
    }
}

#[test]
fn the_datum_is_read() {
    let (scene, _) = read(
        "<spherical_coordinates><latitude_deg>47</latitude_deg><longitude_deg>-8</longitude_deg>\
         <elevation>400</elevation><heading_deg>0</heading_deg></spherical_coordinates>",
    );
    let datum = scene.datum();
    assert_eq!(
        (datum.latitude_rad, datum.longitude_rad, datum.height_m),
        (47_f64.to_radians(), -8_f64.to_radians(), 400.0)
    );
    let turned = "<spherical_coordinates><heading_deg>90</heading_deg></spherical_coordinates>";
    let turned = Scene::from_sdf(&world(turned), "test.world", &NoFiles).expect("a sound file");
    assert!(turned.whole().is_err_and(|lacking| lacking.to_string().contains("turned against east")));
}

/// Everything that is not read is named, once, with how often.
#[test]
fn what_is_left_out_is_named() {
    let oak = "<include><uri>model://oak</uri></include>\n";
    let content = [
        GROUND,
        "\n",
        oak,
        oak,
        &model("", "<mesh><uri>rock.dae</uri></mesh>"),
        &model("", "<image><uri>maze.png</uri></image>"),
        "<population/>",
        "<actor name='crowd'><skin/><plugin name='p' filename='libWalk.so'/></actor>",
        "<model name='ball'><link name='l'><collision name='c'><geometry>\
         <sphere><radius>1</radius></sphere></geometry></collision></link></model>",
        "<model name='ghost'><static>1</static><link name='l'><visual name='v'/></link></model>",
        "<tree_of_ours/>",
    ]
    .concat();
    let reading = Scene::from_sdf(&world(&content), "test.world", &NoFiles).expect("a sound file");
    let notes: Vec<String> = reading.account.notes().map(ToString::to_string).collect();
    let expected = [
        "model `ball` is not static; it stands still here",
        "link `l` can be seen but has no <collision>; left out",
        "<tree_of_ours> is not of the format; left out",
    ];
    assert_eq!(notes.len(), expected.len(), "{notes:#?}");
    let refused: Vec<String> = reading.account.refused().map(ToString::to_string).collect();
    let unreadable = [
        "test.world:4:1: included model `model://oak` is not there (2 times)",
        "the mesh `rock.dae` of `l::c` is not there",
        "`l::c` is a <image>, which cannot be read",
        "the models that a <population> strews cannot be read",
        "actor `crowd` moves as a plugin says, which cannot be read",
    ];
    assert_eq!(refused.len(), unreadable.len(), "{refused:#?}");
    for (message, expected) in notes.iter().zip(expected).chain(refused.iter().zip(unreadable)) {
        assert!(message.contains(expected), "{message}");
    }
    let lacking = reading.clone().whole().expect_err("a world that lacks something").to_string();
    assert!(lacking.contains("model://oak") && lacking.contains("--without-missing"), "{lacking}");
    assert_eq!(reading.without_missing().0.obstacles().len(), 1);
}

#[test]
fn a_world_without_ground_plane_says_that_it_gets_one() {
    let (_, warnings) = read("");
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("flat ground"));
}

#[test]
fn a_bare_model_is_a_world() {
    let text = format!("<sdf version='1.6'>{}</sdf>", model("", "<sphere><radius>1</radius></sphere>"));
    let (scene, warnings) = noted(Scene::from_sdf(&text, "model.sdf", &NoFiles).expect("a sound model"));
    assert_eq!((scene.name(), scene.obstacles().len()), ("m", 1));
    assert_eq!(warnings, Vec::<String>::new());
}

#[test]
fn malformed_numbers_name_line_element_and_expectation() {
    let cases = [
        ("<pose>1 2 x 0 0 0</pose>", "<pose> holds `1 2 x 0 0 0`; expected six numbers"),
        ("<pose>1 2 3</pose>", "<pose> holds `1 2 3`; expected six numbers"),
        ("<pose>1 2 3 0 0 0 7</pose>", "expected six numbers"),
        ("<pose>NaN 0 0 0 0 0</pose>", "expected six numbers"),
        ("<pose>0 0 1e300 0 0 0</pose>", "expected six numbers"),
        ("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>", "a quaternion that is not zero"),
    ];
    for (pose, expected) in cases {
        let message = refuse(&world(&model(pose, "<sphere><radius>1</radius></sphere>")));
        assert!(message.starts_with("test.world:3:"), "{message}");
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn sizes_that_no_solid_can_have_are_refused() {
    let cases = [
        ("<box><size>1 1</size></box>", "three sizes above 0"),
        ("<box><size>1 0 1</size></box>", "three sizes above 0"),
        ("<sphere><radius>-1</radius></sphere>", "<radius> holds `-1`; expected a size above 0"),
        ("<sphere><radius>inf</radius></sphere>", "a size above 0"),
        ("<sphere><radius>NaN</radius></sphere>", "a size above 0"),
        ("<cylinder><radius>1</radius></cylinder>", "<cylinder> needs a size above 0"),
        ("<plane><normal>0 0 0</normal></plane>", "a direction that is not zero"),
        ("", "<geometry> needs a shape"),
    ];
    for (geometry, expected) in cases {
        let message = refuse(&world(&model("", geometry)));
        assert!(message.starts_with("test.world:3:"), "{message}");
        assert!(message.contains(expected), "{message}");
    }
}

/// Gazebo's own worlds have both.
#[test]
fn what_is_not_quite_xml_is_taken() {
    let content = format!(
        "<!-- run: gz sim \n--verbose -->{}<gz:note gz:by='me'/><gz::rank>3</gz::rank>\
         <!-- b --><model name='x'><pose>a</pose></model>",
        model("", "<sphere><radius>1</radius></sphere>")
    );
    let message = refuse(&world(&content));
    assert!(message.starts_with("test.world:4:"), "{message}");
    let text = format!("\n<?xml version='1.0'?>\n{}", world(&content.replace("<pose>a</pose>", "")));
    let (scene, _) = noted(Scene::from_sdf(&text, "test.world", &NoFiles).expect("a sound world"));
    assert_eq!(scene.obstacles().len(), 1);
}

/// Classic Gazebo had x point west, unless it was told 180.
#[test]
fn a_heading_of_180_is_none_in_the_old_format_only() {
    let turned = |version: &str| {
        let content = "<spherical_coordinates><heading_deg>180</heading_deg></spherical_coordinates>";
        let text = world(content).replace("version='1.6'", &format!("version='{version}'"));
        Scene::from_sdf(&text, "test.world", &NoFiles).expect("a sound file").whole().is_err()
    };
    assert_eq!((turned("1.6"), turned("1.8"), turned("1.10")), (false, true, true));
}

#[test]
fn broken_xml_is_refused_where_it_breaks() {
    let unclosed = refuse("<sdf>\n<world>\n  <!-- oops\n</world>\n</sdf>");
    assert_eq!(
        unclosed,
        "test.world:3:3: a comment opens here and never closes; close it with `-->` or delete it"
    );
    let crossed = refuse("<sdf>\n<world>\n</sdf>\n</world>");
    assert!(crossed.starts_with("test.world:3:1: expected 'world' tag, not 'sdf'"), "{crossed}");
    let cut_off = refuse("<sdf>\n<world>\n<model>");
    assert!(cut_off.starts_with("test.world:3:8: "), "{cut_off}");
    assert!(cut_off.contains("cut off"), "{cut_off}");
    assert!(refuse("").contains("cut off"));
    assert!(refuse("<robot/>").contains("<robot> needs an <sdf>"));
    assert!(refuse("<sdf/>").contains("<sdf> needs a <world> or <model>"));
}

#[test]
fn models_nest_to_a_limit() {
    let nested = |depth: usize| world(&["<model name='m'>".repeat(depth), "</model>".repeat(depth)].concat());
    assert!(Scene::from_sdf(&nested(32), "deep.world", &NoFiles).is_ok());
    let error = Scene::from_sdf(&nested(33), "deep.world", &NoFiles).expect_err("too deep");
    assert!(matches!(error, SdfError::TooDeep { .. }), "{error}");
    let error = Scene::from_sdf(&nested(20_000), "deep.world", &NoFiles).expect_err("far too deep");
    assert!(matches!(error, SdfError::TooDeep { .. }), "{error}");
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in ".{0,200}") {
        let _ = Scene::from_sdf(&text, "any", &NoFiles);
    }

    #[test]
    fn no_damage_to_a_sound_world_makes_the_reader_panic(
        cut in 0..400_usize,
        length in 0..40_usize,
        instead in "[<>/!a-z0-9. '-]{0,10}",
    ) {
        let mut text = world(&model(
            "<pose>1 2 3 0 0 0</pose>",
            "<box><size>1 2 3</size></box>",
        ));
        let start = cut.min(text.len());
        let end = (start + length).min(text.len());
        text.replace_range(start..end, &instead);
        let _ = Scene::from_sdf(&text, "any", &NoFiles);
    }
}

/// The published Gazebo worlds, where they are at hand.
#[test]
fn published_worlds_are_read_as_their_readme_says() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/gazebo"));
    if !folder.exists() {
        println!("skipped: needs ../shared/data");
        return;
    }
    let load = |name: &str| {
        let text = std::fs::read_to_string(folder.join(name)).expect("a readable file");
        Scene::from_sdf(&text, name, &NoFiles)
    };
    for (name, boxes) in [("boxes1.world", 1), ("boxes2.world", 2), ("boxes3.world", 6)] {
        let (scene, _) = noted(load(name).expect("a sound world"));
        assert_eq!(scene.obstacles().len(), boxes, "{name}");
    }

    let refused = load("moving_boxes.world").expect_err("not well-formed").to_string();
    assert!(refused.starts_with("moving_boxes.world:111:5: a comment opens"), "{refused}");

    let reading = load("simple_obstacle.world").expect("a sound world");
    let text: String = reading.account.refused().map(|entry| format!("{entry}\n")).collect();
    for expected in [
        "`model://vrc_driving_terrain` is not there\n",
        "`model://pine_tree` is not there (4 times)",
        "`model://oak_tree` is not there (8 times)",
    ] {
        assert!(text.contains(expected), "{text}");
    }
    assert!(reading.whole().is_err());

    // The window: an opening 1.15 m wide and 1.75 m high.
    let (scene, _) = noted(load("window.world").expect("a sound world"));
    let middle = Vector3::new(5.0, 0.45, 3.0);
    let free = |offset: Vector3<f64>| scene.clearance(&(middle + offset)) > 0.0;
    for (half, axis) in [(0.575, Vector3::y()), (0.875, Vector3::z())] {
        for side in [-1.0, 1.0] {
            assert!(free(axis * (half - 0.01) * side), "{axis} {side}");
            assert!(!free(axis * (half + 0.01) * side), "{axis} {side}");
        }
    }
}

#[test]
fn long_names_and_many_warnings_cost_no_more_than_in_proportion() {
    let shape = "<box><size>1 2 3</size></box>";
    let collisions: String =
        (0..100).map(|n| format!("<collision name='{n}'><geometry>{shape}</geometry></collision>")).collect();
    let link = format!("<link name='l'>{collisions}</link>");
    let named = format!("<model name='{}'>{link}</model>", "\u{e9}".repeat(10_000));
    let (scene, _) = read(&format!("{GROUND}{named}"));
    assert_eq!(scene.obstacles().len(), 100);
    assert_eq!(scene.obstacles()[7].name, format!("{}::l::7", "\u{e9}".repeat(64)));

    let unknown: String = (0..1100).map(|n| format!("<odd{n}/>")).collect();
    let reading = Scene::from_sdf(&world(&unknown), "many.world", &NoFiles).expect("a sound world");
    assert_eq!((reading.account.entries.len(), reading.account.unlisted), (1000, 102));
}
