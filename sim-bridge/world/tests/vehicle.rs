//! Vehicle files: what is read and what is refused.

use skein_world::{PositionIntegral, VehicleError, VehicleModel};

const X500: &str = include_str!("../vehicles/x500.toml");

fn refuse(from: &str, to: &str) -> String {
    assert!(X500.contains(from), "the test no longer fits the file: {from}");
    VehicleModel::from_toml(&X500.replacen(from, to, 1), "mine.toml")
        .expect_err("an unsound vehicle")
        .to_string()
}

#[test]
fn every_built_in_vehicle_is_sound_and_bears_its_name() {
    let names: Vec<&str> = VehicleModel::built_in_names().collect();
    assert_eq!(names, ["x500", "x500-vertical-scanner", "crazyflie", "crazyflie-indoor"]);
    for name in names {
        let model = VehicleModel::built_in(name).expect("a sound vehicle");
        assert_eq!(model.name, name);
        let share = model.hover_share();
        assert!((0.3..0.7).contains(&share), "{name} hovers at {share}");
    }
}

#[test]
fn unknown_names_are_answered_with_the_known_ones() {
    let error = VehicleModel::built_in("x9").expect_err("unknown");
    assert_eq!(
        error.to_string(),
        "no built-in vehicle `x9`; there are: x500, x500-vertical-scanner, crazyflie, crazyflie-indoor"
    );
}

#[test]
fn the_hull_is_a_quarter_metre_unless_stated() {
    let text = X500.replacen("hull_radius_m = 0.25\n", "", 1);
    let model = VehicleModel::from_toml(&text, "mine.toml").expect("a sound vehicle");
    assert_eq!(model.hull_radius_m, 0.25);
}

#[test]
fn the_position_loop_has_an_integral_where_the_file_says_so() {
    assert_eq!(
        VehicleModel::built_in("x500").expect("a sound vehicle").control.position_integral,
        PositionIntegral::None
    );
    let text = format!("{X500}\n[control]\nposition_integral = \"variable\"\n");
    let model = VehicleModel::from_toml(&text, "mine.toml").expect("a sound vehicle");
    assert_eq!(model.control.position_integral, PositionIntegral::Variable);
    let error = refuse("[battery]", "[control]\nposition_integral = \"some\"\n[battery]");
    assert!(error.contains("`none`, `plain`, `variable`"), "{error}");
}

#[test]
fn syntax_errors_name_line_and_column() {
    let message = refuse("mass_kg = 2.0", "mass_kg = heavy");
    assert!(message.starts_with("mine.toml:5:11: "), "{message}");
    let message = refuse("mass_kg = 2.0", "mass = 2.0");
    assert!(message.starts_with("mine.toml:5:1: "), "{message}");
    assert!(message.contains("mass"), "{message}");
    let message = refuse("inertia = [0.0217, 0.0217, 0.0400]", "inertia = [1.0]");
    assert!(message.starts_with("mine.toml:7:"), "{message}");
}

#[test]
fn numbers_out_of_range_name_their_field() {
    let cases = [
        ("mass_kg = 2.0", "mass_kg = -1.0", "`mass_kg` is -1; expected a number above 0"),
        ("arm_m = 0.25", "arm_m = nan", "`arm_m` is NaN"),
        ("arm_m = 0.25", "arm_m = inf", "`arm_m` is inf"),
        ("linear_drag = 0.20", "linear_drag = -0.2", "`linear_drag` is -0.2; expected 0 or more"),
        ("rays = 720", "rays = 0", "`lidar.rays` is 0; expected 4 to 10000"),
        ("rate_hz = 10.0", "rate_hz = 7.0", "`lidar.rate_hz` is 7; expected a rate that divides 250"),
        ("full_v = 16.8", "full_v = 1.0", "`battery.full_v` is 1; expected at least battery.empty_v"),
        ("max_thrust_n = 10.0", "max_thrust_n = 5.0", "`max_thrust_n` is 5; expected four rotors"),
    ];
    for (from, to, expected) in cases {
        let message = refuse(from, to);
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn errors_are_typed() {
    let error = VehicleModel::from_toml("", "empty.toml").expect_err("nothing in it");
    assert!(matches!(error, VehicleError::Syntax { .. }), "{error}");
}
