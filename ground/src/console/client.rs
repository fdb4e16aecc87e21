//! One browser: it is told what is so, and brings orders.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{self, WebSocket};
use nalgebra::Vector3;
use skein_wire::Who;
use skein_wire::event::What;
use tokio::sync::{broadcast::error::RecvError, watch};
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::feed::Message;
use super::plan_view::PlanView;
use super::request::{self, Granted, Mailbox, OrderMessage, Request, Wanted};
use super::session::Session;
use super::subscription::{Pictures, Question, Reasons, Subscription, Text};
use super::token;
use crate::giver::Giver;
use crate::planning::plan;

/// A browser that takes nothing for this long is let go.
const PATIENCE: Duration = Duration::from_secs(10);

/// So many scripts and plans of one browser are looked at at once.
const MOST_READINGS: usize = 2;

/// A request, and the tag under which it is to be answered.
type Read = (Option<String>, Result<Request, String>);

/// Why a browser is no longer attended.
struct Gone;

/// Attends a browser until it goes.
pub(super) async fn attend(
    mut socket: WebSocket,
    mut session: Session,
    mut subscription: Subscription,
    mailbox: &Mailbox,
) {
    let history = subscription.history();
    let mut outcome = say(&mut socket, &Message::you(&session, None)).await;
    if outcome.is_ok() {
        outcome = say(&mut socket, &Message::events(history.iter())).await;
    }
    let mut shown = Pictures::new();
    let mut question: Option<Question> = None;
    let mut readings = JoinSet::new();
    while outcome.is_ok() {
        outcome = tokio::select! {
            // Orders before pictures.
            biased;
            message = socket.recv() => match message {
                Some(Ok(message)) => match text(&message) {
                    Some(text) if request::takes_long(&text) => look_at(text, &mut readings, &mut socket).await,
                    Some(text) => match request::read(&text) {
                        (tag, Ok(Request::Plan(who, targets))) => {
                            let surveyed = survey(&session, who, targets, mailbox).await;
                            begin_plan(tag, surveyed, &mut readings, &mut socket).await
                        }
                        request => {
                            answer(request, &mut socket, &mut session, &mut question, &subscription, mailbox).await
                        }
                    },
                    None if matches!(message, ws::Message::Close(_)) => Err(Gone),
                    None => Ok(()),
                },
                Some(Err(_)) | None => Err(Gone),
            },
            Some(Ok(request)) = readings.join_next() => {
                answer(request, &mut socket, &mut session, &mut question, &subscription, mailbox).await
            },
            pictures = newest(&mut subscription.pictures) => match pictures {
                Ok(pictures) => show(&mut socket, pictures, &mut shown).await,
                Err(gone) => Err(gone),
            },
            events = subscription.events.recv() => match events {
                Ok(events) => send(&mut socket, &events).await,
                // What it was too slow for is in the recording.
                Err(RecvError::Lagged(_)) => Ok(()),
                Err(RecvError::Closed) => Err(Gone),
            },
            reasons = newest(&mut subscription.reasons) => match reasons {
                Ok(reasons) => match reason(&reasons, question.as_ref()) {
                    Some(reason) => send(&mut socket, &reason).await,
                    None => Ok(()),
                },
                Err(gone) => Err(gone),
            },
        };
    }
}

/// The newest value, once there is one.
async fn newest<T: Clone>(watch: &mut watch::Receiver<T>) -> Result<T, Gone> {
    watch.changed().await.map_err(|_| Gone)?;
    Ok(watch.borrow_and_update().clone())
}

/// The answer to what this browser asks.
fn reason(reasons: &Reasons, question: Option<&Question>) -> Option<Text> {
    reasons.get(&question?.vehicle).cloned()
}

/// Sends those pictures that are not yet shown.
async fn show(socket: &mut WebSocket, pictures: Pictures, shown: &mut Pictures) -> Result<(), Gone> {
    for (kind, picture) in &pictures {
        if shown.get(kind).is_none_or(|shown| !Arc::ptr_eq(shown, picture)) {
            send(socket, picture).await?;
        }
    }
    *shown = pictures;
    Ok(())
}

async fn say(socket: &mut WebSocket, message: &Message<'_>) -> Result<(), Gone> {
    send(socket, &message.text()).await
}

async fn send(socket: &mut WebSocket, text: &str) -> Result<(), Gone> {
    match timeout(PATIENCE, socket.send(ws::Message::text(text))).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}

/// The text of a message; none if it says nothing.
fn text(message: &ws::Message) -> Option<String> {
    match message {
        ws::Message::Text(text) => Some(text.to_string()),
        ws::Message::Binary(_) => Some("a binary message".to_owned()),
        ws::Message::Close(_) | ws::Message::Ping(_) | ws::Message::Pong(_) => None,
    }
}

/// Reads what may take long on a thread that has time for it, so that orders are heard meanwhile.
async fn look_at(text: String, readings: &mut JoinSet<Read>, socket: &mut WebSocket) -> Result<(), Gone> {
    if readings.len() < MOST_READINGS {
        readings.spawn_blocking(move || request::read(&text));
        return Ok(());
    }
    say(socket, &Message::Error { tag: request::tag(&text), message: too_many() }).await
}

fn too_many() -> String {
    format!("{MOST_READINGS} scripts or plans are being looked at already; wait for an answer")
}

/// The fleet as the station knows it now, for whoever may send it somewhere.
async fn survey(
    session: &Session,
    who: Who,
    targets: Vec<Vector3<f64>>,
    mailbox: &Mailbox,
) -> Result<Granted, String> {
    let by = session.giver(What::Route)?;
    granted(by, Wanted::Survey(who, targets), mailbox).await
}

/// Plans on a thread that has time for it.
async fn begin_plan(
    tag: Option<String>,
    surveyed: Result<Granted, String>,
    readings: &mut JoinSet<Read>,
    socket: &mut WebSocket,
) -> Result<(), Gone> {
    let message = match surveyed {
        Ok(Granted::Surveyed(_)) if readings.len() >= MOST_READINGS => too_many(),
        Ok(Granted::Surveyed(problem)) => {
            readings.spawn_blocking(move || {
                let planned = plan(&problem).map(|plan| Request::Planned(Box::new(plan)));
                (tag, planned.map_err(|error| error.to_string()))
            });
            return Ok(());
        }
        Ok(_) => "the station has misunderstood what was asked".to_owned(),
        Err(message) => message,
    };
    say(socket, &Message::Error { tag, message }).await
}

/// Does what a browser asks for.
async fn answer(
    (tag, request): Read,
    socket: &mut WebSocket,
    session: &mut Session,
    question: &mut Option<Question>,
    subscription: &Subscription,
    mailbox: &Mailbox,
) -> Result<(), Gone> {
    match request {
        Ok(Request::Why(vehicle)) => {
            *question = vehicle.map(|vehicle| subscription.ask_about(vehicle));
            Ok(())
        }
        Ok(Request::Planned(plan)) => say(socket, &Message::Plan { tag, plan: PlanView::of(&plan) }).await,
        // It was begun where it was heard.
        Ok(Request::Plan(..)) => Ok(()),
        Ok(Request::Script(script)) => say(socket, &Message::Script { tag, script }).await,
        Ok(Request::Order(order)) => give(socket, session, tag, *order, mailbox).await,
        Ok(Request::Map(wanted)) => change_map(socket, session, tag, wanted, mailbox).await,
        Ok(Request::Replay(message)) => {
            let by = session.name().cloned().unwrap_or_else(Giver::looking_on);
            let granted = granted(by, Wanted::Replay(message), mailbox).await;
            match granted {
                Ok(granted) => say(socket, &Message::granted(tag, &granted)).await,
                Err(message) => say(socket, &Message::Error { tag, message }).await,
            }
        }
        Ok(Request::Hello(name)) => {
            let answer = match session.introduce(&name) {
                Ok(()) => Message::you(session, tag),
                Err(message) => Message::Error { tag, message },
            };
            say(socket, &answer).await
        }
        Err(message) => say(socket, &Message::Error { tag, message }).await,
    }
}

async fn give(
    socket: &mut WebSocket,
    session: &Session,
    tag: Option<String>,
    order: OrderMessage,
    mailbox: &Mailbox,
) -> Result<(), Gone> {
    match wish(session, order, mailbox).await {
        Ok(granted) => say(socket, &Message::granted(tag, &granted)).await,
        Err(message) => say(socket, &Message::Error { tag, message }).await,
    }
}

async fn change_map(
    socket: &mut WebSocket,
    session: &Session,
    tag: Option<String>,
    wanted: Wanted,
    mailbox: &Mailbox,
) -> Result<(), Gone> {
    let granted = match session.drawer() {
        Ok(by) => granted(by, wanted, mailbox).await,
        Err(message) => Err(message),
    };
    match granted {
        Ok(granted) => say(socket, &Message::granted(tag, &granted)).await,
        Err(message) => say(socket, &Message::Error { tag, message }).await,
    }
}

/// The station's answer to a request. Rights are looked at before anything else is.
async fn wish(session: &Session, order: OrderMessage, mailbox: &Mailbox) -> Result<Granted, String> {
    let by = session.giver(order.what)?;
    granted(by, order.wanted(token::random)?, mailbox).await
}

async fn granted(by: Giver, wanted: Wanted, mailbox: &Mailbox) -> Result<Granted, String> {
    let given = mailbox.put(by, wanted)?.await;
    given.map_err(|_| "the station is ending".to_owned())?.map_err(|refusal| refusal.to_string())
}
