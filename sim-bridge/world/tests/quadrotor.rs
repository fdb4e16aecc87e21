//! Flight dynamics with known answers.

use nalgebra::{UnitQuaternion, Vector3};
use skein_world::vehicle::GRAVITY_M_S2;
use skein_world::{MotorCommands, Quadrotor, RigidState, VehicleModel};

const STILL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

fn x500() -> VehicleModel {
    VehicleModel::built_in("x500").expect("a built-in vehicle")
}

fn at_height(model: VehicleModel, z: f64) -> Quadrotor {
    Quadrotor::new(model, Vector3::new(0.0, 0.0, z), 0.0)
}

/// Lets the rotors reach these commands, then puts the vehicle back at rest in the air.
fn spun_up(commands: MotorCommands) -> Quadrotor {
    let mut quadrotor = at_height(x500(), 50.0);
    let rest = *quadrotor.state();
    for _ in 0..250 {
        quadrotor.step(&commands, &STILL);
    }
    quadrotor.set_state(rest);
    quadrotor
}

#[test]
fn hover_thrust_holds_height() {
    let hover = MotorCommands([x500().hover_share(); 4]);
    let mut quadrotor = spun_up(hover);
    for _ in 0..2500 {
        quadrotor.step(&hover, &STILL);
    }
    let state = quadrotor.state();
    assert!((state.position - Vector3::new(0.0, 0.0, 50.0)).norm() < 1e-6, "{state:?}");
    assert!((quadrotor.specific_force() - Vector3::new(0.0, 0.0, GRAVITY_M_S2)).norm() < 1e-9);
}

#[test]
fn free_fall_without_air_is_a_parabola() {
    let mut model = x500();
    (model.linear_drag, model.quadratic_drag) = (0.0, 0.0);
    let mut quadrotor = at_height(model, 100.0);
    for _ in 0..500 {
        quadrotor.step(&MotorCommands::default(), &STILL);
    }
    let fallen = 100.0 - quadrotor.state().position.z;
    assert!((fallen - GRAVITY_M_S2 * 2.0).abs() < 1e-9, "{fallen}");
    assert!(quadrotor.specific_force().norm() < 1e-9, "weightless");
}

#[test]
fn a_long_fall_ends_at_terminal_speed() {
    let model = x500();
    let (linear, quadratic) = (model.linear_drag, model.quadratic_drag);
    let weight = model.mass_kg * GRAVITY_M_S2;
    let terminal = (-linear + (linear * linear + 4.0 * quadratic * weight).sqrt()) / (2.0 * quadratic);
    let mut quadrotor = at_height(model, 5000.0);
    for _ in 0..10_000 {
        quadrotor.step(&MotorCommands::default(), &STILL);
    }
    assert!((quadrotor.state().velocity.z + terminal).abs() < 1e-3);
}

#[test]
fn wind_carries_the_vehicle_along() {
    let hover = MotorCommands([x500().hover_share(); 4]);
    let mut quadrotor = spun_up(hover);
    let wind = Vector3::new(0.0, 3.0, 0.0);
    for _ in 0..25_000 {
        quadrotor.step(&hover, &wind);
    }
    assert!((quadrotor.state().velocity - wind).norm() < 1e-2);
}

/// The sign of each body axis' rate after one rotor pair got more than the other.
#[test]
fn torques_turn_the_body_the_right_way() {
    let h = x500().hover_share();
    let (more, less) = (h + 0.01, h - 0.01);
    // Order: front-right, rear-left, front-left, rear-right.
    let rate_after = |commands| {
        let mut quadrotor = spun_up(MotorCommands([h; 4]));
        for _ in 0..10 {
            quadrotor.step(&MotorCommands(commands), &STILL);
        }
        quadrotor.state().angular_rate
    };
    let left_side_up = rate_after([less, more, more, less]);
    assert!(left_side_up.x > 0.05 && left_side_up.y.abs() < 1e-9 && left_side_up.z.abs() < 1e-9);
    let nose_down = rate_after([less, more, less, more]);
    assert!(nose_down.y > 0.05 && nose_down.x.abs() < 1e-9 && nose_down.z.abs() < 1e-9);
    // The counter-clockwise rotors push the body clockwise.
    let clockwise = rate_after([more, more, less, less]);
    assert!(clockwise.z < -0.001 && clockwise.x.abs() < 1e-9 && clockwise.y.abs() < 1e-9);
}

#[test]
fn nose_down_flies_forward() {
    let mut quadrotor = spun_up(MotorCommands([x500().hover_share(); 4]));
    let tilted =
        RigidState { attitude: UnitQuaternion::from_euler_angles(0.0, 0.1, 0.0), ..*quadrotor.state() };
    quadrotor.set_state(tilted);
    for _ in 0..50 {
        quadrotor.step(&MotorCommands([x500().hover_share(); 4]), &STILL);
    }
    assert!(quadrotor.state().velocity.x > 0.1);
}

#[test]
fn a_rotor_reaches_63_percent_after_its_time_constant() {
    let model = x500();
    let full = 4.0 * model.max_thrust_n / model.mass_kg;
    let mut quadrotor = at_height(model, 50.0);
    // Five steps of 4 ms are the time constant of 20 ms; the force is a mean over the step.
    for _ in 0..5 {
        quadrotor.step(&MotorCommands([1.0; 4]), &STILL);
    }
    let late = quadrotor.specific_force().z / full;
    quadrotor.step(&MotorCommands([1.0; 4]), &STILL);
    let early = quadrotor.specific_force().z / full;
    let expected = 1.0 - (-1.0_f64).exp();
    assert!(late < expected && expected < early, "{late} {early}");
}

#[test]
fn the_ground_carries_without_bounce() {
    let mut quadrotor = at_height(x500(), 0.4);
    let mut touchdowns = Vec::new();
    for _ in 0..250 {
        touchdowns.extend(quadrotor.step(&MotorCommands::default(), &STILL));
    }
    assert_eq!(touchdowns.len(), 1);
    assert!((touchdowns[0].descent_m_s - 2.2).abs() < 0.1, "{touchdowns:?}");
    assert!(!touchdowns[0].is_crash());
    let state = quadrotor.state();
    assert_eq!((state.position.z, state.velocity), (0.15, Vector3::zeros()));
    assert!((quadrotor.specific_force().z - GRAVITY_M_S2).abs() < 1e-9);
}

#[test]
fn legs_put_a_tilted_vehicle_upright_and_keep_its_yaw() {
    let mut quadrotor = at_height(x500(), 0.2);
    quadrotor.set_state(RigidState {
        attitude: UnitQuaternion::from_euler_angles(0.2, -0.1, 1.0),
        velocity: Vector3::new(0.5, 0.0, 0.0),
        ..*quadrotor.state()
    });
    for _ in 0..250 {
        quadrotor.step(&MotorCommands::default(), &STILL);
    }
    let (roll, pitch, yaw) = quadrotor.state().attitude.euler_angles();
    assert!(roll.abs() < 1e-6 && pitch.abs() < 1e-6 && (yaw - 1.0).abs() < 0.02);
    assert_eq!(quadrotor.state().velocity, Vector3::zeros(), "friction stops it");
}

#[test]
fn fast_or_tilted_touchdowns_are_crashes() {
    let drop_from = |z, attitude| {
        let mut quadrotor = at_height(x500(), z);
        quadrotor.set_state(RigidState { attitude, ..*quadrotor.state() });
        (0..2000).find_map(|_| quadrotor.step(&MotorCommands::default(), &STILL)).expect("it comes down")
    };
    let upright = UnitQuaternion::identity();
    assert!(!drop_from(0.3, upright).is_crash());
    assert!(drop_from(2.0, upright).is_crash());
    let on_its_side = UnitQuaternion::from_euler_angles(1.2, 0.0, 0.0);
    assert!(drop_from(0.3, on_its_side).is_crash());
}

#[test]
fn hover_empties_the_battery_at_the_stated_power_and_empty_means_no_thrust() {
    let mut model = x500();
    model.battery.capacity_wh = 2.0;
    let seconds =
        model.battery.capacity_wh * 3600.0 / (model.battery.hover_power_w + model.battery.idle_power_w);
    let hover = MotorCommands([model.hover_share(); 4]);
    let mut quadrotor = at_height(model, 1000.0);
    assert_eq!(quadrotor.battery().voltage_v, 16.8);
    let mut steps = 0;
    while quadrotor.battery().fraction > 0.0 {
        quadrotor.step(&hover, &STILL);
        steps += 1;
    }
    assert!((f64::from(steps) * 0.004 - seconds).abs() < 0.2);
    for _ in 0..250 {
        quadrotor.step(&hover, &STILL);
    }
    assert!(quadrotor.state().velocity.z < -5.0, "it falls");
    assert_eq!(quadrotor.battery().voltage_v, 13.2);
}

#[test]
fn commands_out_of_range_are_limited_and_nan_is_off() {
    let after = |command| {
        let mut quadrotor = at_height(x500(), 50.0);
        for _ in 0..100 {
            quadrotor.step(&MotorCommands([command; 4]), &STILL);
        }
        *quadrotor.state()
    };
    assert_eq!(after(7.0), after(1.0));
    assert_eq!(after(-1.0), after(0.0));
    assert_eq!(after(f64::NAN), after(0.0));
}
