//! An operator's orders, and what vehicles answer.

use super::Text;

skein_bp::words! {
    /// What an operator may order, as console, scripts, scenarios and events name it.
    pub enum What {
        /// Take off, one after another, those that stand ready.
        Launch = "launch",
        /// Take off together, once every vehicle of the roster is there and ready.
        LaunchTogether = "launch_together",
        /// Stay where you are until resumed.
        Hold = "hold",
        /// Go on after a hold.
        Resume = "resume",
        /// Land where you are.
        Land = "land",
        /// Fly home and land there.
        Return = "return",
        /// Land together, wherever you are: every vehicle of the roster learns of it before anything else is decided.
        Abort = "abort",
        /// Fly there and hover until resumed.
        GoTo = "goto",
        /// Fly these points instead of what is left of the mission, and land under the last.
        Route = "route",
        /// Fly again by yourself: the pilot has let go.
        HandBack = "hand_back",
        /// Run a script beside whatever you do.
        Load = "load",
        /// Run a script no more.
        Unload = "unload",
        /// Ask whoever holds the vehicle to give it away.
        Ask = "ask",
        /// Give the vehicle to another person or program.
        Give = "give",
        /// Hold the vehicle from now on, whoever holds it.
        Take = "take",
        /// Hold the vehicle no more.
        Release = "release",
        /// Go on holding the vehicle, or hold it if nobody does: whoever holds it is still there.
        Keep = "keep",
    }
}

impl What {
    /// Those of which something is true, in the order of their declaration.
    pub fn those(is_so: fn(Self) -> bool) -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().filter(move |what| is_so(*what))
    }

    /// Whether it is for every vehicle, and cannot be for some.
    pub fn is_for_all(self) -> bool {
        matches!(self, Self::Launch | Self::LaunchTogether | Self::Abort)
    }

    /// Whether it needs more than whom it is for: a place, or a script.
    pub fn needs_more(self) -> bool {
        matches!(self, Self::GoTo | Self::Route | Self::Load | Self::Unload | Self::Give)
    }

    pub fn is_launch(self) -> bool {
        matches!(self, Self::Launch | Self::LaunchTogether)
    }

    /// Whether it is about a script.
    pub fn is_about_script(self) -> bool {
        matches!(self, Self::Load | Self::Unload)
    }

    /// Whether it is about who holds a vehicle. It reaches the vehicle as [`Handover`].
    pub fn is_handover(self) -> bool {
        matches!(self, Self::Ask | Self::Give | Self::Take | Self::Release | Self::Keep)
    }

    /// Whether only who holds a vehicle may order it; whoever orders it takes a vehicle that nobody holds. Anybody with
    /// the right may always hold a vehicle in its place, send it home, or land it.
    pub fn needs_holder(self) -> bool {
        self.is_launch() || self.sets_going() || self.is_about_script() || self == Self::Route
    }

    /// Whether it is for safety: it brings a vehicle to a stop, home, or down.
    pub fn is_for_safety(self) -> bool {
        self == Self::Hold || self.calls_launch_off()
    }

    /// Whether a vehicle takes it in at its gateway, as [`OrderTaken`]. The ground station carries out the others.
    pub fn reaches_vehicle(self) -> bool {
        matches!(self, Self::Resume | Self::Land | Self::Return | Self::GoTo | Self::Route | Self::HandBack)
    }

    /// Whether a script may give it to its own vehicle.
    pub fn is_open_to_scripts(self) -> bool {
        matches!(self, Self::Hold | Self::Resume | Self::Land | Self::Return | Self::GoTo)
    }

    /// Whether it sets a vehicle going. Such an order is not brought any more after a while.
    pub fn sets_going(self) -> bool {
        matches!(self, Self::Resume | Self::GoTo | Self::HandBack)
    }

    /// Whether it frees a vehicle whose agent has started in the air.
    pub fn releases(self) -> bool {
        matches!(self, Self::Resume | Self::Return)
    }

    /// Whether it ends a hold: whoever is ordered elsewhere, home or down must be free to move, like who is to go on.
    pub fn ends_hold(self) -> bool {
        matches!(self, Self::Resume | Self::Land | Self::Return | Self::GoTo)
    }

    /// Whether it brings a vehicle to the ground.
    pub fn brings_down(self) -> bool {
        matches!(self, Self::Land | Self::Return)
    }

    /// Whether it calls a launch off, if it is for all: who orders the swarm down does not want the rest of it up.
    pub fn calls_launch_off(self) -> bool {
        self.brings_down() || self == Self::Abort
    }

    /// Whether it says nothing against what other orders have set going.
    pub fn is_beside_flight(self) -> bool {
        self.is_launch() || self.is_about_script() || self.is_handover() || self == Self::Route
    }
}

skein_bp::events! {
    /// Orders at a vehicle, and its answers.
    pub const ORDERS;

    /// An operator orders this vehicle: the one gateway for remote safety requests.
    OrderTaken = "order", Operator {
        what: What,
        /// Where to, for `goto`.
        x: Option<f64> ["m"],
        y: Option<f64> ["m"],
        z: Option<f64> ["m"],
        /// The points of a `route`, in m: `x y z; x y z`.
        way: Option<Text>,
        /// The person or program that has given it; of a script, its b-thread: `script/NAME`. One that names nobody is
        /// declined.
        by: Text,
        /// Whether it was given aboard: by a script, or at the vehicle's own computer.
        aboard: Option<bool>,
    }
    /// Somebody asks for this vehicle, gives it away, takes it, lets it go, or keeps it.
    Handover = "handover", Operator {
        what: What,
        /// The person or program that says so.
        by: Text,
        /// To whom the vehicle is given.
        to: Option<Text>,
    }
    /// Who holds this vehicle has changed, or who asks for it: only the holder's orders set it going.
    Held = "held", Own {
        /// The person or program; none if nobody holds it.
        by: Option<Text>,
        /// Who asks for it.
        asked_by: Option<Text>,
        why: Text,
    }
    /// An operator gives the vehicle back to its agent after a pilot had it.
    HandBack = "hand_back", Own;
    /// An order is not carried out.
    Declined = "declined", Own {
        what: What,
        why: Text,
    }
    /// The vehicle takes on a route instead of what was left of its mission.
    Rerouted = "rerouted", Own {
        /// Its points, in m: `x y z; x y z`.
        way: Text,
        /// The person or program that has sent it.
        by: Text,
    }
    /// A joint decision is taken to heart.
    Heeded = "heeded", Own {
        what: What,
    }
}

impl OrderTaken {
    /// An order of this person or program that needs no more than its word.
    pub fn plain(what: What, by: &str) -> Self {
        Self { what, x: None, y: None, z: None, way: None, by: by.into(), aboard: None }
    }

    /// The order to go there, metres ENU.
    pub fn go_to([x, y, z]: [f64; 3], by: &str) -> Self {
        Self { x: Some(x), y: Some(y), z: Some(z), ..Self::plain(What::GoTo, by) }
    }

    /// The same order, given aboard.
    #[must_use]
    pub fn given_aboard(self) -> Self {
        Self { aboard: Some(true), ..self }
    }

    /// Where to go, metres ENU.
    pub fn place(&self) -> Option<[f64; 3]> {
        Some([self.x?, self.y?, self.z?])
    }
}
