//! A companion and an autopilot's endpoint, joined by a link that loses datagrams.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use skein_mav::{
    AutopilotCommand, Battery, CommandResult, Companion, CompanionConfig, Datum, Endpoint, EndpointConfig,
    FlightMode, Landed, MavEvent, Parameter, ParameterTable, ParameterValue, Request, VehicleState,
};

pub const TICK: Duration = Duration::from_millis(20);

/// Both ends, and what has come of it.
pub struct Pair {
    pub companion: Companion,
    pub endpoint: Endpoint,
    pub state: VehicleState,
    /// Delay with which the state is told.
    pub late: Duration,
    /// The state is told with its last time stamp.
    pub is_frozen: bool,
    pub events: Vec<MavEvent>,
    pub commands: Vec<AutopilotCommand>,
    pub other_requests: Vec<Request>,
    /// What the endpoint answers to commands.
    pub result: CommandResult,
    now: Duration,
    /// Share of the datagrams that are lost, each way.
    pub loss: f64,
    random: ChaCha8Rng,
}

pub fn datum() -> Datum {
    Datum::from_degrees(47.397_742, 8.545_594, 488.0)
}

pub fn parameters() -> ParameterTable {
    let real = |name, value| Parameter { name, value: ParameterValue::Real(value), min: 0.0, max: 10.0 };
    ParameterTable::new(vec![
        real("COM_OF_LOSS_T", 0.5),
        real("MPC_XY_VEL_MAX", 8.0),
        Parameter { name: "COM_OBL_RC_ACT", value: ParameterValue::Int(4), min: 0.0, max: 5.0 },
    ])
}

/// What an autopilot tells that stands on the ground.
pub fn standing() -> VehicleState {
    VehicleState {
        measured: Duration::ZERO,
        mode: FlightMode::Hold,
        armed: false,
        landed: Landed::OnGround,
        position: Some(Vector3::new(10.0, -4.0, 0.15)),
        velocity: Vector3::new(1.0, 2.0, 3.0),
        position_sigma_m: [0.4, 0.7],
        has_fix: true,
        attitude: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
        angular_rate: Vector3::new(0.01, 0.02, 0.03),
        battery: Battery { fraction: 0.83, voltage_v: 16.2 },
        home: Some(Vector3::new(10.0, -4.0, 0.15)),
        sensors_ok: true,
        ready_to_arm: true,
        failsafe: false,
        throttle: 0.0,
        mission_item: 0,
    }
}

impl Pair {
    pub fn new(loss: f64, seed: u64) -> Self {
        Self {
            companion: Companion::new(CompanionConfig::new(3, datum())),
            endpoint: Endpoint::new(EndpointConfig {
                system_id: 3,
                datum: datum(),
                parameters: parameters(),
                accepts_item: |item| item.z < 100.0,
                accepts_fence: |items| items.len() != 2,
                accepts_rally: |_| true,
            }),
            state: standing(),
            late: Duration::ZERO,
            is_frozen: false,
            events: Vec::new(),
            commands: Vec::new(),
            other_requests: Vec::new(),
            result: CommandResult::Accepted,
            now: Duration::ZERO,
            loss,
            random: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// A pair that has found itself.
    pub fn connected(loss: f64, seed: u64) -> Self {
        let mut pair = Self::new(loss, seed);
        pair.run(Duration::from_secs(10));
        pair.events.clear();
        pair
    }

    pub fn now(&self) -> Duration {
        self.now
    }

    pub fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.step();
        }
    }

    /// Runs until an event that satisfies `wanted`, for at most a minute.
    pub fn run_until(&mut self, wanted: impl Fn(&MavEvent) -> bool) -> MavEvent {
        let end = self.now + Duration::from_secs(60);
        while self.now < end {
            self.step();
            if let Some(found) = self.events.iter().find(|event| wanted(event)) {
                return found.clone();
            }
        }
        panic!("did not happen; events: {:?}", self.events);
    }

    pub fn step(&mut self) {
        self.now += TICK;
        self.companion.tick(self.now);
        let up = self.companion.take_output();
        if !up.is_empty() && !self.lost() {
            self.endpoint.receive(self.now, &up);
        }
        while let Some(request) = self.endpoint.next_request() {
            match request {
                Request::Command { ticket, command, .. } => {
                    self.commands.push(command);
                    self.endpoint.answer(ticket, self.result);
                }
                other => self.other_requests.push(other),
            }
        }
        if !self.is_frozen {
            self.state.measured = self.now.saturating_sub(self.late);
        }
        self.endpoint.report(self.now, &self.state);
        let down = self.endpoint.take_output();
        if !down.is_empty() && !self.lost() {
            self.companion.receive(self.now, &down);
        }
        while let Some(event) = self.companion.poll_event() {
            self.events.push(event);
        }
    }

    fn lost(&mut self) -> bool {
        f64::from(self.random.next_u32()) < self.loss * f64::from(u32::MAX)
    }
}
