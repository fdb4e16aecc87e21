//! The person at a browser, and their rights.

use std::net::SocketAddr;

use serde::{Deserialize, Serialize};
use skein_wire::event::What;

use super::subscription::{Attendance, Present};
use crate::giver::Giver;

/// The rights of a person or program at the console.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Sees everything.
    Observer,
    /// Also holds, returns and lands.
    Safety,
    /// Everything.
    Operator,
}

impl Role {
    /// Whether who has this role may order this.
    #[must_use]
    pub fn may(self, what: What) -> bool {
        match self {
            Self::Observer => false,
            Self::Safety => what.is_for_safety(),
            Self::Operator => true,
        }
    }

    /// The word for it, as configurations write it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Observer => "observer",
            Self::Safety => "safety",
            Self::Operator => "operator",
        }
    }
}

/// One connection's other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Caller {
    pub(super) address: SocketAddr,
    pub(super) identity: Identity,
}

/// The known name at the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// On the loopback interface anybody may be anybody.
    Anybody,
    /// By the certificate shown.
    Known(Giver, Role),
    /// The common name of a certificate that has no role here.
    Stranger(String),
}

/// The speaker of one connection.
pub(super) struct Session {
    caller: Caller,
    name: Option<Giver>,
    present: Present,
    attendance: Option<Attendance>,
}

impl Session {
    pub(super) fn new(caller: Caller, present: Present) -> Self {
        let mut session = Self { name: None, present, attendance: None, caller };
        if let Identity::Known(name, _) = &session.caller.identity {
            session.enter(name.clone());
        }
        session
    }

    fn enter(&mut self, name: Giver) {
        if self.role() == Role::Operator {
            self.attendance = Some(self.present.enter(name.clone()));
        }
        self.name = Some(name);
    }

    pub(super) fn role(&self) -> Role {
        match self.caller.identity {
            Identity::Anybody => Role::Operator,
            Identity::Known(_, role) => role,
            Identity::Stranger(_) => Role::Observer,
        }
    }

    pub(super) fn name(&self) -> Option<&Giver> {
        self.name.as_ref()
    }

    pub(super) fn is_certified(&self) -> bool {
        self.caller.identity != Identity::Anybody
    }

    /// Says who speaks from now on.
    ///
    /// # Errors
    /// The name is none, or the certificate says another.
    pub(super) fn introduce(&mut self, name: &str) -> Result<(), String> {
        let name = Giver::new(name).map_err(|error| error.to_string())?;
        match &self.caller.identity {
            Identity::Anybody => self.enter(name),
            Identity::Known(certified, _) if *certified == name => {}
            Identity::Known(certified, _) => {
                return Err(format!("your certificate says that you are {certified}, not {name}"));
            }
            Identity::Stranger(_) => return Err("your certificate has no role here".into()),
        }
        Ok(())
    }

    /// The giver of this order, if they may give it. Whoever has not said their name may still order what is for
    /// safety, and is called by their address.
    pub(super) fn giver(&self, what: What) -> Result<Giver, String> {
        let role = self.role();
        if !role.may(what) {
            return Err(format!(
                "{what} is beyond your role, {}: ask an operator, or whoever keeps the station's [console.roles]",
                role.word()
            ));
        }
        match &self.name {
            Some(name) => Ok(name.clone()),
            None if what.is_for_safety() => {
                Giver::new(&format!("unnamed at {}", self.caller.address)).map_err(|error| error.to_string())
            }
            None => Err(format!(
                "{what} needs to know who orders it: say {{\"type\":\"hello\",\"name\":\"...\"}} first"
            )),
        }
    }
}

impl Session {
    /// The one who draws on the map, and removes from it, if they may.
    pub(super) fn drawer(&self) -> Result<Giver, String> {
        let role = self.role();
        if role != Role::Operator {
            return Err(format!("to draw zones is beyond your role, {}: ask an operator", role.word()));
        }
        self.name.clone().ok_or_else(|| {
            "a zone needs to know who draws or removes it: say {\"type\":\"hello\",\"name\":\"...\"} first".into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(certified: Option<(&str, Role)>) -> Session {
        let known = |(name, role)| Identity::Known(Giver::new(name).unwrap(), role);
        let identity = certified.map_or(Identity::Anybody, known);
        Session::new(Caller { address: ([127, 0, 0, 1], 4000).into(), identity }, Present::default())
    }

    #[test]
    fn an_observer_sees_a_safety_officer_also_stops_and_an_operator_does_everything() {
        for &what in What::ALL {
            let stops = matches!(what, What::Hold | What::Return | What::Land | What::Abort);
            assert!(session(Some(("Olga", Role::Observer))).giver(what).is_err(), "{what}");
            assert_eq!(session(Some(("Sam", Role::Safety))).giver(what).is_ok(), stops, "{what}");
            assert!(session(Some(("Anna", Role::Operator))).giver(what).is_ok(), "{what}");
        }
    }

    #[test]
    fn only_an_operator_who_is_known_draws_zones() {
        for (role, draws) in [(Role::Observer, false), (Role::Safety, false), (Role::Operator, true)] {
            assert_eq!(session(Some(("Anna", role))).drawer().is_ok(), draws);
        }
        assert!(session(None).drawer().unwrap_err().contains("hello"));
    }

    #[test]
    fn who_has_no_name_stops_the_swarm_and_does_not_set_it_going() {
        let mut session = session(None);
        assert_eq!(session.giver(What::Hold).unwrap().as_str(), "unnamed at 127.0.0.1:4000");
        assert!(session.giver(What::Resume).unwrap_err().contains("hello"));
        assert!(session.introduce("a/b").unwrap_err().contains("names no person"));
        session.introduce("Anna").unwrap();
        assert_eq!(session.giver(What::Resume).unwrap().as_str(), "Anna");
    }

    #[test]
    fn a_certificate_says_who_one_is() {
        let mut session = session(Some(("Anna", Role::Operator)));
        assert!(session.introduce("Ben").unwrap_err().contains("your certificate says that you are Anna"));
        session.introduce("Anna").unwrap();
        assert_eq!(session.giver(What::Take).unwrap().as_str(), "Anna");
    }

    #[test]
    fn who_may_command_is_present_until_they_have_gone() {
        let present = Present::default();
        let at = |name: &str, role| {
            let identity = Identity::Known(Giver::new(name).unwrap(), role);
            Session::new(Caller { address: ([127, 0, 0, 1], 4000).into(), identity }, present.clone())
        };
        let names = || present.names().iter().map(Giver::to_string).collect::<Vec<_>>();
        let (first, second) = (at("Anna", Role::Operator), at("Anna", Role::Operator));
        let observer = at("Olga", Role::Observer);
        assert_eq!(names(), ["Anna"]);
        drop((first, observer));
        assert_eq!(names(), ["Anna"], "she has another browser open");
        drop(second);
        assert!(names().is_empty());
    }
}
