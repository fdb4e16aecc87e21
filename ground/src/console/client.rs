//! One browser: it is told what is so, and brings orders.

use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use serde_json::json;
use tokio::sync::{broadcast::error::RecvError, watch};
use tokio::time::timeout;

use super::feed::{Question, Reasons, Subscription, Text};
use super::request::{self, Mailbox, Request};
use crate::Order;

/// A browser that takes nothing for this long is let go.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why a browser is no longer attended.
struct Gone;

/// Attends a browser until it goes.
pub(super) async fn attend(mut socket: WebSocket, mut subscription: Subscription, mailbox: &Mailbox) {
    let history = subscription.history();
    let mut outcome = send(&mut socket, &history).await;
    let mut question: Option<Question> = None;
    while outcome.is_ok() {
        outcome = tokio::select! {
            // Orders before pictures.
            biased;
            message = socket.recv() => match message {
                Some(Ok(message)) => match read(&message) {
                    Some((_, Ok(Request::Why(vehicle)))) => {
                        question = vehicle.map(|vehicle| subscription.ask_about(vehicle));
                        Ok(())
                    }
                    Some((tag, Ok(Request::Script(script)))) => {
                        send(&mut socket, &json!({ "type": "script", "tag": tag, "script": script }).to_string()).await
                    }
                    Some((tag, Ok(Request::Order(order)))) => give(&mut socket, tag, order, mailbox).await,
                    Some((tag, Err(why))) => refuse(&mut socket, tag, &why).await,
                    None if matches!(message, Message::Close(_)) => Err(Gone),
                    None => Ok(()),
                },
                Some(Err(_)) | None => Err(Gone),
            },
            orders = newest(&mut subscription.orders) => tell(&mut socket, orders).await,
            scene = newest(&mut subscription.scene) => tell(&mut socket, scene).await,
            events = subscription.events.recv() => match events {
                Ok(events) => send(&mut socket, &events).await,
                // What it was too slow for is in the recording.
                Err(RecvError::Lagged(_)) => Ok(()),
                Err(RecvError::Closed) => Err(Gone),
            },
            fleet = newest(&mut subscription.fleet) => tell(&mut socket, fleet).await,
            reasons = newest(&mut subscription.reasons) => match reasons {
                Ok(reasons) => tell(&mut socket, Ok(reason(&reasons, question.as_ref()))).await,
                Err(gone) => Err(gone),
            },
        };
    }
}

/// What is so, once it has changed.
async fn newest<T: Clone>(watch: &mut watch::Receiver<T>) -> Result<T, Gone> {
    watch.changed().await.map_err(|_| Gone)?;
    Ok(watch.borrow_and_update().clone())
}

/// The answer to what this browser asks.
fn reason(reasons: &Reasons, question: Option<&Question>) -> Option<Text> {
    reasons.get(&question?.vehicle).cloned()
}

async fn tell(socket: &mut WebSocket, message: Result<Option<Text>, Gone>) -> Result<(), Gone> {
    match message? {
        Some(text) => send(socket, &text).await,
        None => Ok(()),
    }
}

async fn send(socket: &mut WebSocket, text: &str) -> Result<(), Gone> {
    match timeout(PATIENCE, socket.send(Message::text(text))).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}

/// What a browser wants, and the tag under which it is to be answered; none if it says nothing.
fn read(message: &Message) -> Option<(Option<String>, Result<Request, String>)> {
    match message {
        Message::Text(text) => Some(request::read(text)),
        Message::Binary(_) => Some(request::read("a binary message")),
        Message::Close(_) | Message::Ping(_) | Message::Pong(_) => None,
    }
}

async fn give(
    socket: &mut WebSocket,
    tag: Option<String>,
    order: Order,
    mailbox: &Mailbox,
) -> Result<(), Gone> {
    let given = match mailbox.put(order) {
        Ok(given) => given.await.map_err(|_| "the station is ending".to_owned()),
        Err(why) => Err(why.to_owned()),
    };
    match given.and_then(|given| given.map_err(|stranger| stranger.to_string())) {
        Ok(id) => send(socket, &json!({ "type": "ordered", "tag": tag, "id": id }).to_string()).await,
        Err(why) => refuse(socket, tag, &why).await,
    }
}

async fn refuse(socket: &mut WebSocket, tag: Option<String>, why: &str) -> Result<(), Gone> {
    send(socket, &json!({ "type": "error", "tag": tag, "message": why }).to_string()).await
}
