//! Plans for many vehicles at once, where [`skein_planning`] plans for one: pure functions without I/O.
//!
//! * [`assignment`] pairs vehicles with targets, and [`dealing`] deals out as many as there are; [`coverage`] and [`formation`] make their routes.
//! * [`route`] plans through known terrain and threats, by a particle swarm ([`particle_swarm`]) with tabu search.
//! * [`traffic`] plans in space and time through corridors with room for one.

pub mod assignment;
pub mod coverage;
pub mod dealing;
pub mod formation;
pub mod particle_swarm;
pub mod route;
pub mod traffic;
