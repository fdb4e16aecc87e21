//! Why the station does not give an order.

use skein_dbp::NodeName;
use skein_wire::Zone;
use skein_wire::event::What;

use crate::launch_offer::OFFER_LASTS;

/// Why an order is not given; nobody is ordered anything then.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("`{name}` is no vehicle of this station")]
    UnknownVehicle { name: NodeName },
    #[error("{}", held_by(holder, vehicle))]
    Held { vehicle: NodeName, holder: String },
    #[error(
        "you do not hold `{vehicle}`, and only who holds it can order {what}: {} holds it",
        somebody(holder)
    )]
    NotHolder { vehicle: NodeName, holder: String, what: What },
    #[error(
        "a launch takes two messages: ask for it, and return within {} s the token that you are answered with",
        OFFER_LASTS.as_secs()
    )]
    LaunchUnasked,
    #[error("this station was not told what to plan with: its configuration needs the table [planning]")]
    NoTheatre,
    #[error("nobody has told what it has to fly: there is nothing to rehearse")]
    NobodyToRehearse,
    #[error("nobody is on the ground with a mission before it: there is nothing to launch")]
    NobodyToLaunch,
    #[error(
        "no launch is offered to you under this token: it has served, it is older than {} s, another has taken its \
         place, or it was never yours; ask for the launch again",
        OFFER_LASTS.as_secs()
    )]
    NoSuchOffer,
    #[error("{most} zones are drawn already: remove one first", most = Zone::MOST)]
    TooManyZones,
    #[error("all zones would have {corners} corners: expected at most {most}", most = Zone::MOST_CORNERS_IN_ALL)]
    TooManyCorners { corners: usize },
    #[error("the zone `{name}` is just being removed: draw it again in a moment")]
    ZoneGoing { name: String },
    #[error("no zone `{name}` is drawn here, and no vehicle that is heard has regard for one")]
    NoSuchZone { name: String },
    #[error("this is a live station: there is no recording that could be played otherwise")]
    NotRecorded,
    #[error("this is a recording: nobody is ordered anything by it")]
    Recorded,
    #[error("who would be launched has changed since you asked; ask for the launch again")]
    OfferOutdated,
}

/// Why an order of another is not heeded by a vehicle that `holder` holds, and the remedy.
pub(crate) fn held_by(holder: &str, vehicle: &NodeName) -> String {
    format!(
        "{holder} holds `{vehicle}`: order `ask`, and {holder} may give it to you, or `take`, which both of you see"
    )
}

fn somebody(holder: &str) -> &str {
    if holder.is_empty() { "nobody" } else { holder }
}
